//! Light from tiles: steady while the mesh changes, whole while tiles are missing.

use glam::DVec3;
use terrasoar_render::{
    Frame, Gpu, HEIGHTS_PER_TILE, Look, Offscreen, RenderError, RendererOptions, Surface, TileId, View, wgpu,
};

use crate::support::landscape::hills;
use crate::support::refiner::Square;
use crate::support::scene::{Scene, heights_of};
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("shading::steady_while_the_mesh_changes", steady),
        ("shading::coarse_tiles_fill_in_for_fine_ones", fallback),
        ("shading::a_forgotten_tile_comes_anew", forgotten),
        ("shading::tiles_that_do_not_fit_are_refused", wrong_tiles),
        ("shading::target_formats_agree", formats),
        ("shading::four_samples_a_pixel_agree_with_one", samples),
    ]
}

fn down() -> View {
    let eye = DVec3::new(2560.0, 2560.0, 5200.0);
    View::look_at(eye, eye - DVec3::Z, [240, 180].into())
}

fn grey() -> Look {
    Look::default().surface(Surface::Plain).morph(false)
}

fn steady(gpu: &Gpu) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let view = down();
    let mut scene = Scene::new(gpu, &square);
    scene.give_tiles(&view);
    let [mut tiled, mut faceted] = [0.0; 2];
    for (tile_normals, difference) in [(true, &mut tiled), (false, &mut faceted)] {
        let look = grey().tile_normals(tile_normals);
        let [fine, coarse] = [0, 3].map(|level| {
            scene.show(&square.down_to(level));
            scene.draw(&view, &look)
        });
        *difference = fine.difference(&coarse);
    }
    ensure(tiled < 0.02 && 4.0 * tiled < faceted, || {
        format!("pictures of a fine and a coarse mesh differ by {tiled:.4} with tiles, {faceted:.4} without")
    })
}

fn fallback(gpu: &Gpu) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let mut view = down();
    view.eye_m.z = 2600.0;
    let whole = {
        let mut scene = Scene::new(gpu, &square);
        scene.show(&square.down_to(0));
        scene.give_tiles(&view);
        scene.draw(&view, &grey())
    };
    // Room for one tile, which must be the coarsest.
    let mut scene = Scene::with(gpu, &square, RendererOptions::default().tile_budget_bytes(1));
    scene.show(&square.down_to(0));
    scene.give_tiles(&view);
    let stats = scene.renderer.tile_stats();
    ensure((stats.resident, stats.capacity, stats.uploads) == (1, 1, 1), || format!("{stats:?}"))?;
    let coarse = scene.draw(&view, &grey());
    let bare = scene.draw(&view, &grey().tile_normals(false));
    let (from_whole, from_bare) = (coarse.difference(&whole), coarse.difference(&bare));
    ensure(from_whole > 1e-4 && from_whole < 0.08, || {
        format!("coarse and fine tiles differ by {from_whole}")
    })?;
    ensure(from_bare > 1e-3, || "tiles were not used".to_owned())
}

fn forgotten(gpu: &Gpu) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let view = down();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    scene.give_tiles(&view);
    let before = scene.draw(&view, &grey());
    let tile = TileId { level: 0, x: 1, y: 0 };
    scene.renderer.forget_tile(tile);
    let without = scene.draw(&view, &grey());
    ensure(without != before, || "a forgotten tile is still shown".to_owned())?;
    ensure(scene.renderer.want_tiles(&view, 8) == [tile], || "the forgotten tile is not wanted".to_owned())?;
    let bytes = scene.renderer.give_tile(tile, &heights_of(&square, tile)).map_err(|e| e.to_string())?;
    ensure(bytes == 129 * 129 * 4 + 16, || format!("{bytes} bytes"))?;
    ensure(scene.draw(&view, &grey()) == before, || "the picture did not come back".to_owned())
}

fn wrong_tiles(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    let root = scene.renderer.pyramid().root();
    let short = scene.renderer.give_tile(root, &[0.0; 7]);
    ensure(matches!(short, Err(RenderError::TileSize { .. })), || format!("{short:?}"))?;
    let nowhere = TileId { level: 0, x: 99, y: 0 };
    let outside = scene.renderer.give_tile(nowhere, &[0.0; HEIGHTS_PER_TILE]);
    ensure(matches!(outside, Err(RenderError::NoSuchTile { .. })), || format!("{outside:?}"))
}

/// A target that encodes sRGB itself and one that does not get the same bytes.
fn formats(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    let view = View::look_at(
        DVec3::new(1280.0, -900.0, 1700.0),
        DVec3::new(1280.0, 1280.0, 400.0),
        [120, 90].into(),
    );
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.refine(&view));
    let encoded = scene.draw(&view, &Look::default());
    let format = wgpu::TextureFormat::Rgba8Unorm;
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 120, height: 90, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let picture = Offscreen::of(texture).map_err(|e| e.to_string())?;
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let look = Look::default();
    let frame = Frame { view: &view, refined_for: None, look: &look };
    scene.renderer.render(&mut encoder, picture.target(), frame).map_err(|e| e.to_string())?;
    gpu.queue.submit([encoder.finish()]);
    let rgba = picture.read_rgba(&gpu.device, &gpu.queue).map_err(|e| e.to_string())?;
    let most = encoded.rgba.iter().zip(&rgba).map(|(a, b)| a.abs_diff(*b)).max();
    ensure(most <= Some(1), || format!("they differ by {most:?}"))
}

fn samples(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    let view = View::look_at(
        DVec3::new(1280.0, -900.0, 1700.0),
        DVec3::new(1280.0, 1280.0, 400.0),
        [120, 90].into(),
    );
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.refine(&view));
    scene.give_tiles(&view);
    let [one, four] =
        [false, true].map(|multisample| scene.draw(&view, &Look::default().multisample(multisample)));
    let difference = one.difference(&four);
    ensure(difference > 0.0 && difference < 0.03, || format!("they differ by {difference}"))
}
