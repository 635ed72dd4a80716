//! A device, a renderer and a picture in one: what most tests need.

use terrasoar_render::{
    DrawStats, Frame, Gpu, HEIGHTS_PER_TILE, Look, MeshPatch, Offscreen, Renderer, RendererOptions,
    TILE_CELLS, TileId, UploadStats, View, read_depth_m,
};

use super::picture::Picture;
use super::refiner::{Mesh, Square};

/// A square on a device.
pub struct Scene<'a> {
    pub gpu: &'a Gpu,
    pub square: &'a Square,
    pub renderer: Renderer,
}

impl<'a> Scene<'a> {
    pub fn new(gpu: &'a Gpu, square: &'a Square) -> Self {
        Self::with(gpu, square, RendererOptions::default())
    }

    pub fn with(gpu: &'a Gpu, square: &'a Square, options: RendererOptions) -> Self {
        let renderer = Renderer::new(&gpu.device, &gpu.queue, square.terrain, options).unwrap();
        Self { gpu, square, renderer }
    }

    pub fn apply(&mut self, patch: &MeshPatch<'_>) -> UploadStats {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let stats = self.renderer.apply(&mut encoder, patch).unwrap();
        self.gpu.queue.submit([encoder.finish()]);
        stats
    }

    /// Replaces the mesh by another, all at once.
    pub fn show(&mut self, mesh: &Mesh) -> UploadStats {
        let triangles: Vec<_> = (0..).zip(mesh.triangles.iter().copied()).collect();
        self.apply(&MeshPatch {
            vertices: &self.square.entries(&mesh.slots),
            triangles: &triangles,
            draws: &[0..triangles.len() as u32],
        })
    }

    /// Gives all tiles that the view wants, until it wants no more.
    pub fn give_tiles(&mut self, view: &View) {
        loop {
            let wanted = self.renderer.want_tiles(view, 8).to_vec();
            if wanted.is_empty() {
                return;
            }
            for tile in wanted {
                self.renderer.give_tile(tile, &heights_of(self.square, tile)).unwrap();
            }
        }
    }

    pub fn draw(&mut self, view: &View, look: &Look) -> Picture {
        self.draw_counted(view, look).0
    }

    pub fn draw_counted(&mut self, view: &View, look: &Look) -> (Picture, DrawStats) {
        self.draw_frame(Frame { view, refined_for: None, look })
    }

    pub fn draw_frame(&mut self, frame: Frame<'_>) -> (Picture, DrawStats) {
        let size_px = frame.view.viewport.size_px();
        let picture = Offscreen::new(&self.gpu.device, size_px).unwrap();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let stats = self.renderer.render(&mut encoder, picture.target(), frame).unwrap();
        self.gpu.queue.submit([encoder.finish()]);
        let rgba = picture.read_rgba(&self.gpu.device, &self.gpu.queue).unwrap();
        self.gpu.watch.check().unwrap();
        (Picture { size_px, rgba }, stats)
    }

    /// Metres along the line of sight of the last picture.
    pub fn depth_m(&self) -> Vec<f32> {
        read_depth_m(&self.renderer, &self.gpu.device, &self.gpu.queue).unwrap()
    }
}

/// Heights of a tile, samples as they are.
pub fn heights_of(square: &Square, tile: TileId) -> Vec<f32> {
    let side = i64::from(TILE_CELLS) + 3;
    let [x0, y0] = [tile.x, tile.y].map(|t| i64::from((t * TILE_CELLS) << tile.level));
    let cell = 1_i64 << tile.level;
    let heights: Vec<f32> = (0..side * side)
        .map(|n| {
            let at = |first: i64, i: i64, corner: u32| first + (i - 1) * cell - i64::from(corner);
            square.height_at(at(x0, n % side, square.corner[0]), at(y0, n / side, square.corner[1]))
        })
        .collect();
    assert_eq!(heights.len(), HEIGHTS_PER_TILE);
    heights
}
