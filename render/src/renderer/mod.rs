//! From patches to a frame: the one place that decides the order of commands.
//!
//! A renderer holds nothing but device memory, and the caller has all that is in it. So after the loss of a device it is made anew and
//! given one patch with the whole mesh and the tiles it then asks for. Cost of a frame on the processor: the patch,
//! one block of uniforms, a handful of commands and one draw a visible range (or one for all of them).

mod draw;
mod imagery;
mod material;

pub use draw::Prepared;
use draw::begin_pass;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};

use wgpu::util::DeviceExt;

use crate::attachments::{Attachments, Key};
use crate::error::{RenderError, Result};
use crate::frame::{DepthRange, DrawStats, Frame, PassFormat, RendererOptions, Target};
use crate::mesh::{MeshBuffers, MeshPatch, Morph, UploadStats};
use crate::pipelines::{Modules, Pipelines, Variant, bind_group_layout};
use crate::ramps::Ramp;
use crate::tiles::{
    GRADIENT_FORMAT, Imagery, Pyramid, TILE_CELLS, TilePool, TileStats, WantedTiles, pack_gradients,
};
use crate::timing::GpuTimer;
use crate::uniforms::Uniforms;
use crate::view::{TerrainShape, clip_from_eye, near_m};
use glam::Mat4;
use terrasoar::view::View;
use terrasoar_layout::imagery::TileId;

/// Frames whose commands may wait in one submission.
const UNIFORM_PLACES: u64 = 16;
const RAMP_TEXELS: u32 = 1024;
/// From so many ranges on, one indirect call is cheaper than as many direct ones.
const INDIRECT_FROM: usize = 64;

/// Draws one terrain on one device.
#[derive(Debug)]
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    terrain: TerrainShape,
    /// Which renderer of this process it is.
    instance: u64,
    multi_draw: bool,
    mesh: MeshBuffers,
    morph: Morph,
    walls: Option<Walls>,
    tiles: TilePool,
    wanted: WantedTiles,
    imagery: Option<Imagery>,
    material: Option<material::OnDevice>,
    layout: wgpu::BindGroupLayout,
    modules: Modules,
    pipelines: HashMap<Variant, Pipelines>,
    attachments: Option<Attachments>,
    uniforms: wgpu::Buffer,
    uniform_stride: u64,
    next_place: u64,
    sampler: wgpu::Sampler,
    ramp: Option<(&'static Ramp, wgpu::TextureView)>,
    bind_group: Option<(u64, wgpu::BindGroup)>,
    timer: Option<GpuTimer>,
    near_m: f64,
}

#[derive(Debug)]
struct Walls {
    edges: wgpu::Buffer,
    count: u32,
    bottom_m: f32,
}

impl Renderer {
    /// A renderer without a mesh. Takes a few milliseconds, the compilation of shaders apart, which the first frame of
    /// each target format pays for.
    ///
    /// # Errors
    ///
    /// [`RenderError::Usage`] for a terrain without extent.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        terrain: TerrainShape,
        options: RendererOptions,
    ) -> Result<Self> {
        static INSTANCES: AtomicU64 = AtomicU64::new(0);
        terrain.check()?;
        let layout = bind_group_layout(device);
        let uniform_stride = (size_of::<Uniforms>() as u64)
            .next_multiple_of(u64::from(device.limits().min_uniform_buffer_offset_alignment));
        let tile_layout = crate::tiles::TileLayout { format: GRADIENT_FORMAT, texels: TILE_CELLS + 1 };
        Ok(Self {
            instance: INSTANCES.fetch_add(1, Ordering::Relaxed),
            mesh: MeshBuffers::new(device),
            morph: Morph::new(device),
            walls: None,
            tiles: TilePool::new(
                device,
                Pyramid::over(terrain.samples),
                tile_layout,
                options.tile_budget_bytes,
            ),
            wanted: WantedTiles::default(),
            imagery: None,
            material: None,
            modules: Modules::new(device, &layout),
            layout,
            pipelines: HashMap::new(),
            attachments: None,
            uniforms: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("uniforms"),
                size: uniform_stride * UNIFORM_PLACES,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            uniform_stride,
            next_place: 0,
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("smooth"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
            ramp: None,
            bind_group: None,
            timer: if options.timestamps { GpuTimer::new(device, queue) } else { None },
            near_m: near_m(&terrain),
            multi_draw: options.multi_draw,
            device: device.clone(),
            queue: queue.clone(),
            terrain,
        })
    }

    /// Records the changes of the mesh into `encoder`, before the frame that shows them. Bytes sent follow the
    /// patch, not the mesh.
    ///
    /// # Errors
    ///
    /// [`RenderError::TooLarge`], [`RenderError::RangeOutside`]; the mesh is then unchanged.
    pub fn apply(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        patch: &MeshPatch<'_>,
    ) -> Result<UploadStats> {
        self.mesh.apply(&self.device, encoder, patch)
    }

    /// Replaces the walls along the terrain's edge: pairs of vertex slots along its border, from which walls go down to
    /// `bottom_m` (metres before exaggeration). They move with the mesh, so they never gape. None by default.
    pub fn set_walls(&mut self, edges: &[[u32; 2]], bottom_m: f32) {
        self.walls = (!edges.is_empty()).then(|| Walls {
            edges: self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("walls"),
                contents: bytemuck::cast_slice(edges),
                usage: wgpu::BufferUsages::VERTEX,
            }),
            count: edges.len() as u32,
            bottom_m,
        });
    }

    /// Forgets the mesh: the next patch is applied to an empty one. Walls stay along the slots that they were set by.
    pub fn clear_mesh(&mut self) {
        self.mesh.clear(&self.device);
    }

    /// Records the frame into `encoder`: clears the target, draws ground, walls and sky. What the caller records after
    /// it, such as an overlay, comes on top. At most 16 frames may lie in one submission.
    ///
    /// # Errors
    ///
    /// [`RenderError::Usage`] for a view that is none.
    pub fn render(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
        frame: Frame<'_>,
    ) -> Result<DrawStats> {
        if target.size_px.contains(&0) {
            return Err(RenderError::Usage("a target needs at least one pixel"));
        }
        let format = PassFormat::new(target.format).samples(if frame.look.multisample { 4 } else { 1 });
        let timing = self.timer.as_ref().and_then(GpuTimer::begin);
        let prepared = self.prepare_timed(encoder, &format, frame, timing)?;
        let key = Key { size_px: target.size_px, format: target.format, samples: format.samples };
        let attachments = Attachments::keep_or_make(self.attachments.take(), &self.device, key);
        let timed = self.timer.as_ref().zip(timing);
        let timestamps = timed.map(|(timer, place)| timer.ends_with_render(place, !frame.look.morph));
        let mut pass = begin_pass(encoder, &attachments, target, timestamps);
        let stats = self.draw_prepared(&mut pass, &prepared, true)?;
        drop(pass);
        if let Some((timer, place)) = timed {
            timer.end(place, encoder);
        }
        self.attachments = Some(attachments);
        Ok(stats)
    }

    /// Records into `encoder` all that a frame needs before its render pass, which is the caller's and like `format` says: the numbers of the view, and the
    /// movement of vertices. [`Renderer::draw`] then draws the frame in that pass. At most 16 frames may lie in one submission.
    ///
    /// # Errors
    ///
    /// [`RenderError::Usage`] for a view that is none.
    pub fn prepare(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        format: &PassFormat,
        frame: Frame<'_>,
    ) -> Result<Prepared> {
        self.prepare_timed(encoder, format, frame, None)
    }

    /// Draws a frame that was prepared last into the caller's pass: ground, walls and, if asked for, the sky where nothing was drawn yet. Clears nothing. Leaves pipeline, bind group 0, index and
    /// vertex buffer of the pass changed, and bind group 1 where a material binds something.
    ///
    /// # Errors
    ///
    /// [`RenderError::Usage`] for a frame of another renderer, or one whose mesh was changed since.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, prepared: &Prepared, sky: bool) -> Result<DrawStats> {
        self.draw_prepared(pass, prepared, sky)
    }

    /// From metres east, north and up of a view's eye, heights exaggerated, to clip space, as the ground is drawn: for whatever else is drawn in the same pass. Take
    /// the eye off in double precision first.
    pub fn clip_from_eye(&self, view: &View, range: DepthRange) -> Mat4 {
        clip_from_eye(view.axes(), view.half_tangents(), self.near_m, range)
    }

    /// Finds out which normal tiles a view wants and returns those that are not on the device, most urgent first, at most
    /// `most`. To be called once a frame; tiles not wanted for longest make room for new ones.
    pub fn want_tiles(&mut self, view: &View, most: usize) -> &[TileId] {
        let wanted = self.wanted.find(&self.tiles.pyramid, &self.terrain, view);
        self.tiles.residency.want(wanted);
        let missing = self.tiles.residency.missing();
        &missing[..missing.len().min(most)]
    }

    /// Gives a tile by its heights, [`crate::HEIGHTS_PER_TILE`] of them as [`pack_gradients`] wants them. Returns the bytes sent; none where
    /// all room is taken by tiles of the current view.
    ///
    /// # Errors
    ///
    /// [`RenderError::TileSize`], [`RenderError::NoSuchTile`].
    pub fn give_tile(&mut self, tile: TileId, heights_m: &[f32]) -> Result<u64> {
        let bytes = pack_gradients(&self.terrain, tile, heights_m)?;
        self.tiles.upload(&self.queue, tile, &bytes)
    }

    /// Gives a tile as [`pack_gradients`] made it, on another thread perhaps.
    ///
    /// # Errors
    ///
    /// [`RenderError::TileSize`], [`RenderError::NoSuchTile`].
    pub fn give_packed_tile(&mut self, tile: TileId, bytes: &[u8]) -> Result<u64> {
        self.tiles.upload(&self.queue, tile, bytes)
    }

    /// Notes that heights changed between two samples, both included: tiles of slopes that show them are wanted anew, and stay until the new ones come.
    pub fn change_heights(&mut self, south_west: [u32; 2], north_east: [u32; 2]) {
        let TilePool { pyramid, residency, .. } = &mut self.tiles;
        for tile in pyramid.around(south_west, north_east, crate::tiles::TILE_BORDER) {
            residency.outdate(tile);
        }
    }

    /// Forgets a tile whose heights changed; it will be wanted again.
    pub fn forget_tile(&mut self, tile: TileId) {
        self.tiles.forget(&self.queue, tile);
    }

    /// All tiles there are.
    pub fn pyramid(&self) -> &Pyramid {
        &self.tiles.pyramid
    }

    /// What the tiles did.
    pub fn tile_stats(&self) -> TileStats {
        self.tiles.stats()
    }

    /// The terrain it was made for.
    pub fn terrain(&self) -> &TerrainShape {
        &self.terrain
    }

    /// Device memory held in buffers and tiles, bytes; targets apart.
    pub fn device_bytes(&self) -> u64 {
        self.mesh.device_bytes()
            + self.morph.device_bytes()
            + self.tiles.device_bytes()
            + self.imagery.as_ref().map_or(0, |i| i.pool.device_bytes())
            + self.uniforms.size()
    }

    /// Time the device took for the newest frame that is known, milliseconds. To be called after submission. None where the device or the
    /// options say no, or nothing is known yet.
    pub fn gpu_time_ms(&mut self) -> Option<f64> {
        self.timer.as_mut().and_then(|timer| timer.collect_ms(&self.device))
    }

    /// Depth of the last frame and its near plane in metres: a texel d is `near / d` metres along the line of sight, 0
    /// is sky. None before the first frame and with smoothed edges.
    pub fn depth(&self) -> Option<(&wgpu::Texture, f64)> {
        let depth = &self.attachments.as_ref()?.depth;
        (depth.sample_count() == 1).then_some((depth, self.near_m))
    }

    fn set_ramp(&mut self, ramp: &'static Ramp) {
        if self.ramp.as_ref().is_some_and(|(is, _)| std::ptr::eq(*is, ramp)) {
            return;
        }
        let texture = self.device.create_texture_with_data(
            &self.queue,
            &wgpu::TextureDescriptor {
                label: Some("ramp"),
                size: wgpu::Extent3d { width: RAMP_TEXELS, height: 1, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba32Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            },
            wgpu::util::TextureDataOrder::LayerMajor,
            bytemuck::cast_slice(ramp.linear(RAMP_TEXELS as usize).as_flattened()),
        );
        self.ramp = Some((ramp, texture.create_view(&Default::default())));
        self.bind_group = None;
    }

    fn bind(&mut self) {
        let generation = self.mesh.generation;
        let Some((_, ramp)) = &self.ramp else { return };
        if self.bind_group.as_ref().is_some_and(|(made_for, _)| *made_for == generation) {
            return;
        }
        let uniform = wgpu::BufferBinding {
            buffer: &self.uniforms,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<Uniforms>() as u64),
        };
        self.morph.fit(&self.device, &self.mesh, uniform.clone());
        // Without an image no program looks at one: whatever has its kind will do.
        let image = self.imagery.as_ref().map_or(&self.tiles, |i| &i.pool);
        let resources = [
            wgpu::BindingResource::Buffer(uniform),
            self.mesh.vertices.as_entire_binding(),
            self.mesh.indices.as_entire_binding(),
            wgpu::BindingResource::TextureView(&self.tiles.table_view),
            wgpu::BindingResource::TextureView(&self.tiles.view),
            wgpu::BindingResource::Sampler(&self.sampler),
            wgpu::BindingResource::TextureView(ramp),
            self.morph.moved_heights().as_entire_binding(),
            wgpu::BindingResource::TextureView(&image.table_view),
            wgpu::BindingResource::TextureView(&image.view),
        ];
        let entries: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &self.layout,
            entries: &entries,
        });
        self.bind_group = Some((generation, group));
    }
}
