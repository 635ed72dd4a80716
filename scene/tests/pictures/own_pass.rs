//! Ground drawn into a render pass that is the caller's: the same pixels as in a pass of the scene's own, and things that hide and are hidden as they should.

use super::rig::{Rig, puget_sound, puget_sound_unmapped, view};
use super::{Outcome, Test, ensure};
use glam::{DVec3, Vec3};
use terrasoar::ground::{Ground, StreamOptions};
use terrasoar::view::View;
use terrasoar_render::{DepthRange, Gpu, Look, Offscreen, PassFormat, wgpu};
use terrasoar_scene::scene::{Scene, SceneError, SceneOptions};

pub const TESTS: &[Test] = &[
    ("own_pass::shows_the_same_pixels", same_pixels),
    ("own_pass::depth_may_run_either_way", either_way),
    ("own_pass::things_in_the_pass_hide_and_are_hidden", hidden),
    ("own_pass::what_does_not_belong_together_is_refused", refused),
    ("own_pass::edits_show_in_the_next_frame", edits),
];

const SIZE_PX: [u32; 2] = [320, 200];
const CLEAR: wgpu::Color = wgpu::Color { r: 1.0, g: 0.0, b: 1.0, a: 1.0 };

fn low() -> View {
    view([98.0, 52.0, 3.6], [75.0, -10.0, 5.0], 45.0, SIZE_PX)
}

fn texture(gpu: &Gpu, format: wgpu::TextureFormat) -> wgpu::TextureView {
    let size = wgpu::Extent3d { width: SIZE_PX[0], height: SIZE_PX[1], depth_or_array_layers: 1 };
    let made = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    made.create_view(&Default::default())
}

/// A pass over the whole picture, drawn by `record`; its pixels.
fn picture(
    gpu: &Gpu,
    format: &PassFormat,
    record: impl FnOnce(&mut wgpu::RenderPass<'_>) -> Outcome,
) -> Result<Vec<u8>, String> {
    let offscreen = Offscreen::new(&gpu.device, SIZE_PX).map_err(|e| e.to_string())?;
    let depth = texture(gpu, format.depth);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: offscreen.target().view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(CLEAR), store: wgpu::StoreOp::Store },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(format.depth_range.clear()),
                store: wgpu::StoreOp::Store,
            }),
            stencil_ops: None,
        }),
        ..Default::default()
    });
    record(&mut pass)?;
    drop(pass);
    gpu.queue.submit([encoder.finish()]);
    let rgba = offscreen.read_rgba(&gpu.device, &gpu.queue).map_err(|e| e.to_string())?;
    gpu.watch.check().map_err(|e| e.to_string())?;
    Ok(rgba)
}

fn plain() -> PassFormat {
    PassFormat::new(wgpu::TextureFormat::Rgba8UnormSrgb)
}

fn forward() -> PassFormat {
    plain().depth(wgpu::TextureFormat::Depth32Float, DepthRange::Forward)
}

fn differing(a: &[u8], b: &[u8]) -> usize {
    a.chunks_exact(4).zip(b.chunks_exact(4)).filter(|(a, b)| a != b).count()
}

fn is_cleared(pixel: &[u8]) -> bool {
    pixel == [255, 0, 255, 255]
}

fn same_pixels(gpu: &Gpu) -> Outcome {
    let mut rig = Rig::plain(gpu, SIZE_PX);
    for (i, name) in ["relief", "wireframe", "contours"].into_iter().enumerate() {
        let view = View { eye_m: low().eye_m + DVec3::new(300.0 * i as f64, 0.0, 0.0), ..low() };
        let look = Look::named(name).unwrap_or_default();
        let by_scene = rig.shoot(&view, &look);
        let Rig { ground, scene, .. } = &mut rig;
        let frame = scene.frame(ground, &view, &look, &plain()).map_err(|e| e.to_string())?;
        let own =
            picture(gpu, &plain(), |pass| frame.draw_with_sky(pass).map(drop).map_err(|e| e.to_string()))?;
        ensure(own == by_scene, || format!("{name}: {} pixels differ", differing(&own, &by_scene)))?;
        // Without sky the caller's own colour stays where no ground is.
        let bare = picture(gpu, &plain(), |pass| frame.draw(pass).map(drop).map_err(|e| e.to_string()))?;
        let sky = bare.chunks_exact(4).filter(|pixel| is_cleared(pixel)).count();
        ensure(sky > 2000 && differing(&bare, &by_scene) == sky, || {
            format!("{name}: {sky} pixels without ground")
        })?;
    }
    Ok(())
}

fn either_way(gpu: &Gpu) -> Outcome {
    let mut rig = Rig::plain(gpu, SIZE_PX);
    let look = Look::default();
    let expected = rig.shoot(&low(), &look);
    let Rig { ground, scene, .. } = &mut rig;
    for format in [forward(), plain().depth(wgpu::TextureFormat::Depth24Plus, DepthRange::Forward)] {
        let frame = scene.frame(ground, &low(), &look, &format).map_err(|e| e.to_string())?;
        let seen =
            picture(gpu, &format, |pass| frame.draw_with_sky(pass).map(drop).map_err(|e| e.to_string()))?;
        // Precision is less far away: some pixels at silhouettes show what lies a little behind.
        let off = differing(&seen, &expected);
        ensure(off < 640, || format!("{:?}: {off} pixels differ", format.depth))?;
    }
    Ok(())
}

/// A white square of a size in metres that faces the eye, at a distance along the line of sight.
struct Square {
    pipeline: wgpu::RenderPipeline,
    corners: wgpu::Buffer,
}

impl Square {
    fn new(
        gpu: &Gpu,
        format: &PassFormat,
        clip: impl Fn(Vec3) -> [f32; 4],
        axes: [Vec3; 3],
        away_m: f32,
        side_m: f32,
    ) -> Self {
        let [right, up, forward] = axes;
        let corner = |x: f32, y: f32| clip(forward * away_m + (right * x + up * y) * (0.5 * side_m));
        let strip = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)];
        let bytes: Vec<u8> = strip.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let corners = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        gpu.queue.write_buffer(&corners, 0, &bytes);
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(
                "@vertex fn at(@location(0) p: vec4<f32>) -> @builtin(position) vec4<f32> { return p; }
                 @fragment fn white() -> @location(0) vec4<f32> { return vec4(1.0); }"
                    .into(),
            ),
        });
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: None,
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: None,
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: 16,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x4],
                })],
            },
            primitive: wgpu::PrimitiveState {
                topology: wgpu::PrimitiveTopology::TriangleStrip,
                ..Default::default()
            },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: format.depth,
                depth_write_enabled: Some(true),
                depth_compare: Some(format.depth_range.compare()),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: None,
                compilation_options: Default::default(),
                targets: &[Some(format.colour.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { pipeline, corners }
    }

    fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_vertex_buffer(0, self.corners.slice(..));
        pass.draw(0..4, 0..1);
    }
}

/// A square is drawn before the ground or after it, nearer than the ground or behind it: of each pixel the nearer one is seen.
fn hidden(gpu: &Gpu) -> Outcome {
    let mut rig = Rig::plain(gpu, SIZE_PX);
    let look = Look::default();
    let view = view([80.0, 70.0, 7.0], [20.0, -45.0, 0.0], 50.0, SIZE_PX);
    rig.shoot(&view, &look);
    let depths = rig.depth_m();
    let middle_m = depths[(SIZE_PX[1] / 2 * SIZE_PX[0] + SIZE_PX[0] / 2) as usize];
    let Rig { ground, scene, .. } = &mut rig;
    for format in [plain(), forward()] {
        for (share, is_nearer) in [(0.6, true), (1.6, false)] {
            let away_m = middle_m * share;
            let frame = scene.frame(ground, &view, &look, &format).map_err(|e| e.to_string())?;
            let clip = |local: Vec3| (frame.clip_from_local(view.eye_m) * local.extend(1.0)).to_array();
            let axes = view.axes().map(|axis| axis.as_vec3());
            let square = Square::new(gpu, &format, clip, axes, away_m, 0.2 * away_m);
            for first in [true, false] {
                let seen = picture(gpu, &format, |pass| {
                    if first {
                        square.draw(pass);
                    }
                    frame.draw_with_sky(pass).map_err(|e| e.to_string())?;
                    if !first {
                        square.draw(pass);
                    }
                    Ok(())
                })?;
                let white = seen.chunks_exact(4).filter(|pixel| **pixel == [255; 4]).count();
                // A fifth of the distance is 0.2 / (2 tan 25 degrees) of the picture's height.
                let side_px = 0.2 / (2.0 * 25f64.to_radians().tan()) * f64::from(SIZE_PX[1]);
                let wanted = if is_nearer { (side_px * side_px) as usize } else { 0 };
                ensure(white.abs_diff(wanted) <= wanted / 20, || {
                    format!(
                        "at {share} of the ground's distance, drawn first: {first}: {white} pixels, not {wanted}"
                    )
                })?;
            }
        }
    }
    Ok(())
}

fn refused(gpu: &Gpu) -> Outcome {
    let mut rig = Rig::plain(gpu, SIZE_PX);
    let (view, look) = (low(), Look::default());
    rig.shoot(&view, &look);
    // The same file opened another time is another terrain: pages of one say nothing of the other.
    let mut other =
        Ground::streamed(puget_sound_unmapped(), &StreamOptions::default()).map_err(|e| e.to_string())?;
    other.update(&view);
    let said = rig.scene.frame(&mut other, &view, &look, &plain()).err();
    ensure(matches!(said, Some(SceneError::AnotherTerrain(_))), || format!("{said:?}"))?;
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let said = rig.scene.sync(&mut other, &mut encoder, &view, &look).err();
    ensure(matches!(said, Some(SceneError::AnotherTerrain(_))), || format!("{said:?}"))?;
    // Another ground of the same opened terrain takes over.
    let expected = rig.draw(&view, &look);
    let mut second = Ground::mapped(puget_sound(), Default::default(), Default::default())
        .map_err(|error| error.to_string())?;
    second.update(&view);
    rig.ground = second;
    let seen = rig.draw(&view, &look);
    ensure(seen == expected, || format!("{} pixels differ", differing(&seen, &expected)))
}

/// The ground's own edits, seen by a scene that knows nothing but the ground; and undone.
fn edits(gpu: &Gpu) -> Outcome {
    use terrasoar_layout::edit::{Crater, Edit};
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = folder.path().join("land.iqt");
    std::fs::copy(puget_sound().path(), &path).map_err(|e| e.to_string())?;
    let mut ground = terrasoar::terrain::Terrain::open(&path)
        .and_then(|terrain| terrain.stream(StreamOptions::default()))
        .map_err(|e| e.to_string())?;
    let (view, look) = (view([80.0, 70.0, 7.0], [20.0, -45.0, 0.0], 50.0, SIZE_PX), Look::default());
    let mut scene = Scene::new(&ground, gpu, SceneOptions::default()).map_err(|e| e.to_string())?;
    let mut shoot = |ground: &mut Ground<'static>| -> Result<Vec<u8>, String> {
        let begun = std::time::Instant::now();
        loop {
            let told = ground.update(&view);
            let frame = scene.frame(ground, &view, &look, &plain()).map_err(|e| e.to_string())?;
            let seen = picture(gpu, &plain(), |pass| {
                frame.draw_with_sky(pass).map(drop).map_err(|e| e.to_string())
            })?;
            if told.work.late == 0 && frame.drawn().tiles_missing == 0 && !ground.is_waiting() {
                return Ok(seen);
            }
            ensure(begun.elapsed().as_secs() < 60, || "what is missing does not come".into())?;
        }
    };
    let before = shoot(&mut ground)?;
    let at = [82_400.0, 76_500.0];
    let crater = Crater { centre_m: at, direction_deg: 0.0, radius_m: 1500.0, depth_m: 150.0 };
    let height_m = ground.height_at(at[0], at[1]).height_m.ok_or("no ground")?;
    ground.edit(&[Edit::Crater(crater)]).map_err(|e| e.to_string())?;
    let after = shoot(&mut ground)?;
    let seen = differing(&before, &after);
    ensure(seen > 200, || format!("{seen} pixels differ"))?;
    let now_m = ground.height_at(at[0], at[1]).height_m.ok_or("no ground")?;
    ensure(now_m < height_m - 50.0, || format!("{height_m} m before, {now_m} m now"))?;
    let saved = ground
        .commit("a crater")
        .and_then(|ticket| ticket.wait().map_err(|e| terrasoar_layout::LayoutError::Usage(e.to_string())));
    let saved = saved.map_err(|e| e.to_string())?;
    ensure(saved.pages > 0, || "nothing was written".into())?;
    ensure(shoot(&mut ground)? == after, || "a commit changes the picture".into())?;
    ensure(ground.undo().map_err(|e| e.to_string())?, || "there is something to undo".into())?;
    ensure(shoot(&mut ground)? == before, || "an undo does not bring the ground back".into())
}
