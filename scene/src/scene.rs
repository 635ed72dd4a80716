//! A terrain in sight: a renderer that holds the mesh of some ground, kept in step with it.
//!
//! A frame begins with [`Ground::update`], which refines the mesh for a view. Then there are two ways to the picture. [`Scene::frame`] prepares it, and [`SceneFrame::draw`] draws it into a
//! render pass of the caller, beside whatever else is in it; the caller does clearing, depth buffer and sky. Or [`Scene::sync`] and [`Scene::draw`] record everything, pass
//! and sky included, into an encoder. To freeze refinement while the eye goes on, leave the update out, and say which view the mesh is for.
//!
//! **What is drawn is the present mesh of the ground.** The scene knows which step of the mesh the device has, and sends what is missing: the change of one update, or the whole mesh if
//! the device missed more than one. Ground of another terrain than the scene was made for is refused.
//!
//! **The device holds nothing that the scene cannot send again.** After its loss [`Scene::recover`] takes a new one, which may have other features, and the next picture is the same. Light
//! comes from tiles of heights: a bounded number a frame for a window, all of them for a picture that must repeat byte by byte.
//!
//! Cost on the processor: a copy of what changed in the mesh, some 2 ms a tile.

pub use super::drape::Served;
pub use super::options::{Drawn, SceneError, SceneOptions, TileService};

use super::border::border;
use super::drape::Drape;
use super::frame::SceneFrame;
use super::repaint::{Picture, Repaint};
use super::sight::{ahead, shape};
use std::ops::Range;
use std::sync::Arc;
use terrasoar::ground::{Ground, MeshChange, MeshStep};
use terrasoar::refine::kinetic::Patch;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::Edit;
use terrasoar_layout::imagery::{Imagery, Paint, TileFormat, TileId};
use terrasoar_render::{
    DrawStats, Frame, Gpu, Look, Material, MeshPatch, PassFormat, RenderError, Renderer, RendererOptions,
    Target, TerrainShape, TileStats, UploadStats, height_tile, wgpu,
};

/// Tiles that are asked for, for each that is given in a frame.
const TILES_ASKED: usize = 8;

/// Tiles of the image that a frame of a window is given at most: a megabyte of BC1.
const IMAGE_TILES_A_FRAME: usize = 8;
/// Texels across the scorch of a crater at most: one as wide takes a third of a second.
const WIDEST_SCORCH: f64 = 2048.0;

/// The renderer of some ground.
pub struct Scene {
    renderer: Renderer,
    device: wgpu::Device,
    queue: wgpu::Queue,
    options: SceneOptions,
    /// The ground that it was made for, and the opened file that it has now.
    land: u64,
    file: u64,
    /// The step of the mesh that the device has; none before the first.
    seen: Option<MeshStep>,
    /// One past the highest triangle slot ever sent. Slots past it are empty, and the device has not heard of them.
    end: u32,
    draws: Vec<Range<u32>>,
    /// Edited rectangles of the ground that light knows of.
    edits_seen: u64,
    /// Border edges, as vertex slots, and how far down walls go from them.
    walls: Option<(Vec<[u32; 2]>, f32)>,
    heights_m: Vec<f32>,
    wanted: Vec<TileId>,
    drape: Option<Drape>,
    material: Option<Material>,
    /// Whether the last picture had the image in it.
    shows_image: bool,
    /// What the device takes of images.
    formats: &'static [TileFormat],
}

impl Scene {
    /// A scene of `ground`, without a mesh; the first [`Scene::sync`] brings it. Reads the directory of the terrain's image, if it has one.
    ///
    /// # Errors
    /// Damage of the image; what [`Renderer::new`] says.
    pub fn new(ground: &Ground<'_>, gpu: &Gpu, options: SceneOptions) -> Result<Self, SceneError> {
        let formats = gpu.capabilities.imagery_formats();
        let threads = options.is_for_a_window();
        let drape = match ground.shared_terrain() {
            Some(terrain) => Drape::of(Arc::clone(terrain), formats, threads)?,
            None if Imagery::open(ground.terrain())?.is_none() => None,
            // Tiles are read, not mapped, whatever the records are.
            None => Drape::of(Arc::new(ground.terrain().open_again_unmapped()?), formats, threads)?,
        };
        let renderer = new_renderer(shape(ground.terrain()), drape.as_ref(), gpu, options)?;
        Ok(Self {
            renderer,
            device: gpu.device.clone(),
            queue: gpu.queue.clone(),
            options,
            land: ground.land(),
            file: ground.terrain().instance(),
            seen: None,
            end: 0,
            draws: Vec::new(),
            edits_seen: ground.edited_since(0).1,
            walls: None,
            heights_m: Vec::new(),
            wanted: Vec::new(),
            drape,
            material: None,
            shows_image: false,
            formats,
        })
    }

    /// Brings the device what it lacks of the ground for a picture of `view`: the mesh, tiles of light and of the image. What it records into `encoder` must be submitted before
    /// the next call.
    ///
    /// # Errors
    /// [`SceneError::AnotherTerrain`] for ground of another terrain than the scene was made for; [`SceneError::Render`] for a mesh that is too large for the device.
    pub fn sync(
        &mut self,
        ground: &mut Ground<'_>,
        encoder: &mut wgpu::CommandEncoder,
        view: &View,
        look: &Look,
    ) -> Result<Drawn, SceneError> {
        let mut drawn = Drawn::default();
        self.note_edits(ground)?;
        if look.tile_normals {
            self.serve_tiles(ground, view, &mut drawn)?;
        }
        if look.imagery > 0.0 {
            self.serve_image(ground, view, &mut drawn)?;
        } else {
            self.shows_image = false;
        }
        drawn.upload = self.sync_mesh(ground, encoder)?;
        Ok(drawn)
    }

    /// Brings the device what it lacks of the mesh; [`Scene::sync`] does so by itself.
    ///
    /// # Errors
    /// As there.
    pub fn sync_mesh(
        &mut self,
        ground: &Ground<'_>,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<UploadStats, SceneError> {
        self.check(ground)?;
        let sent = match ground.change_since(self.seen) {
            MeshChange::Same => return Ok(UploadStats::default()),
            MeshChange::Patch(patch) => self.send(encoder, patch)?,
            MeshChange::Whole(patch) => {
                let before = self.seen.take();
                if before.is_some() {
                    self.renderer.clear_mesh();
                    self.end = 0;
                }
                if before.is_some_and(|seen| !seen.is_of_same_mesh(ground.step()))
                    && self.walls.take().is_some()
                {
                    // They stood along another mesh.
                    self.renderer.set_walls(&[], 0.0);
                }
                self.send(encoder, &patch)?
            }
        };
        self.seen = Some(ground.step());
        Ok(sent)
    }

    fn send(&mut self, encoder: &mut wgpu::CommandEncoder, patch: &Patch) -> Result<UploadStats, SceneError> {
        self.end = patch.triangles.iter().fold(self.end, |end, (slot, _)| end.max(slot + 1));
        let end = self.end;
        self.draws.clear();
        self.draws.extend(patch.draws.iter().map(|r| r.start.min(end)..r.end.min(end)));
        let patch = MeshPatch { vertices: &patch.vertices, triangles: &patch.triangles, draws: &self.draws };
        Ok(self.renderer.apply(encoder, &patch)?)
    }

    /// Records a picture of what the device has into `encoder`: clears `target`, draws ground, walls and sky. `refined_for` is the view of the ground's last update where that is another
    /// than `view` (frozen refinement). Submit the encoder before the next picture, and ask the device's watch whether all went well.
    ///
    /// # Errors
    /// [`SceneError::Render`]: a view that is none.
    pub fn draw(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
        view: &View,
        look: &Look,
        refined_for: Option<&View>,
    ) -> Result<DrawStats, SceneError> {
        Ok(self.renderer.render(encoder, target, Frame { view, refined_for, look })?)
    }

    /// Brings the device all that a picture of `view` needs, and gives what draws it into a pass like `pass` of the caller's. Submits commands of its own; the caller's pass must be
    /// submitted before the next frame is asked for.
    ///
    /// # Errors
    /// As [`Scene::sync`] and [`Scene::draw`].
    pub fn frame(
        &mut self,
        ground: &mut Ground<'_>,
        view: &View,
        look: &Look,
        pass: &PassFormat,
    ) -> Result<SceneFrame<'_>, SceneError> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let drawn = self.sync(ground, &mut encoder, view, look)?;
        // A view that the mesh was not refined for: refinement is frozen.
        let refined_for = ground.view().filter(|refined_for| *refined_for != view);
        let prepared = self.renderer.prepare(&mut encoder, pass, Frame { view, refined_for, look })?;
        self.queue.submit([encoder.finish()]);
        Ok(SceneFrame {
            renderer: &self.renderer,
            prepared,
            view: *view,
            depth_range: pass.depth_range,
            drawn,
        })
    }

    /// Gives the renderer tiles that the view lacks, as many as the options say, and counts them in `drawn`.
    ///
    /// # Errors
    /// As [`Scene::sync`].
    pub fn serve_tiles(
        &mut self,
        ground: &mut Ground<'_>,
        view: &View,
        drawn: &mut Drawn,
    ) -> Result<(), SceneError> {
        self.check(ground)?;
        let most = match self.options.tiles {
            TileService::All => usize::MAX,
            TileService::AFrame(most) => most,
        };
        loop {
            self.wanted.clear();
            // Pages of more tiles are asked for than are given in a frame.
            self.wanted.extend_from_slice(self.renderer.want_tiles(view, most.saturating_mul(TILES_ASKED)));
            let mut given = 0;
            for tile in &self.wanted {
                if given as usize == most {
                    break;
                }
                if ground.tile_heights_m(height_tile(*tile), &mut self.heights_m) {
                    let bytes = self.renderer.give_tile(*tile, &self.heights_m)?;
                    given += u64::from(bytes > 0);
                    drawn.tiles[1] += bytes;
                }
            }
            drawn.tiles[0] += given;
            // Where no room is left for a wanted tile a coarser one stands in for good.
            if most < usize::MAX || given == 0 {
                break;
            }
        }
        drawn.tiles_missing = self.renderer.tile_stats().missing;
        Ok(())
    }

    /// Gives the renderer tiles of the image that the view lacks, and counts them in `drawn`. A frame of a window is given what has come.
    ///
    /// # Errors
    /// As [`Scene::sync`].
    pub fn serve_image(
        &mut self,
        ground: &Ground<'_>,
        view: &View,
        drawn: &mut Drawn,
    ) -> Result<(), SceneError> {
        let Some(drape) = &mut self.drape else { return Ok(()) };
        self.shows_image = true;
        let ahead = match ground.last_views() {
            [Some(before), Some(now)] => ahead(&before, &now),
            _ => *view,
        };
        drawn.image = drape.serve(&mut self.renderer, view, &ahead, IMAGE_TILES_A_FRAME)?;
        drawn.image_missing = self.renderer.imagery_stats().missing;
        Ok(())
    }

    fn check(&self, ground: &Ground<'_>) -> Result<(), SceneError> {
        if ground.land() == self.land {
            return Ok(());
        }
        Err(SceneError::AnotherTerrain(ground.terrain().path().display().to_string()))
    }

    /// Light follows edits of the ground within some frames, the image a file that was rewritten for them.
    fn note_edits(&mut self, ground: &Ground<'_>) -> Result<(), SceneError> {
        self.check(ground)?;
        if let Some(terrain) = ground.shared_terrain().filter(|terrain| terrain.instance() != self.file) {
            self.file = terrain.instance();
            self.drape.as_mut().map_or(Ok(()), |drape| drape.follow(terrain))?;
        }
        let (rects, now) = ground.edited_since(self.edits_seen);
        self.edits_seen = now;
        match rects {
            Some(rects) => {
                for rect in rects {
                    self.renderer.change_heights([rect.west, rect.south], [rect.east, rect.north]);
                }
            }
            None => {
                let [wide, high] = self.renderer.terrain().samples;
                self.renderer.change_heights([0, 0], [wide - 1, high - 1]);
            }
        }
        Ok(())
    }

    /// Takes over what became of the image in an editing session: the next picture shows paint, an undo and a redo.
    ///
    /// # Errors
    /// Another image, which an undo or a redo led to, cannot be shown.
    pub fn repainted(&mut self, mut repaint: Repaint) -> Result<(), SceneError> {
        match std::mem::replace(&mut repaint.picture, Picture::Same) {
            Picture::Another(file) => {
                let threads = self.options.is_for_a_window();
                self.drape = Some(Drape::over(file, self.formats, threads)?);
                self.show_drape()?;
            }
            Picture::Gone => {
                self.drape = None;
                self.show_drape()?;
            }
            same => repaint.picture = same,
        }
        if let Some(drape) = &mut self.drape {
            drape.repainted(&mut self.renderer, repaint);
        }
        Ok(())
    }

    fn show_drape(&mut self) -> Result<(), RenderError> {
        match &self.drape {
            Some(drape) => drape.show(&mut self.renderer, self.options.imagery_bytes),
            None => {
                self.renderer.clear_imagery();
                Ok(())
            }
        }
    }

    /// Gives the ground a material of your own, or takes it off. Looks show it by default ([`Look::material`]). It stays after the loss of a device.
    ///
    /// # Errors
    /// As [`Renderer::set_material`]; the material before stays then.
    pub fn set_material(&mut self, material: Option<Material>) -> Result<(), SceneError> {
        self.renderer.set_material(material.as_ref())?;
        self.material = material;
        Ok(())
    }

    /// What craters among these edits burn into the image: nothing where there is none, or none that this build can paint, and by none that is too wide to follow the hand.
    pub fn scorches_of(&self, edits: &[Edit]) -> Vec<Paint> {
        let Some(drape) = self.drape.as_ref().filter(|drape| drape.can_be_painted()) else {
            return Vec::new();
        };
        let [east_m, north_m] = drape.shape().texel_m;
        let widest_m = WIDEST_SCORCH * (east_m * north_m).sqrt();
        let scorch = |edit: &Edit| match edit {
            Edit::Crater(crater) => match Paint::scorch_of(crater) {
                Paint::Scorch(scorch) if 2.0 * scorch.radius_m > widest_m => None,
                paint => Some(paint),
            },
            _ => None,
        };
        edits.iter().filter_map(scorch).collect()
    }

    /// Whether an image is draped over the terrain.
    pub fn has_image(&self) -> bool {
        self.drape.is_some()
    }

    /// Whether tiles of the image that the last picture lacked are on their way. [`Ground::is_waiting`] tells the same of the mesh.
    pub fn is_waiting(&self) -> bool {
        self.shows_image && self.drape.as_ref().is_some_and(Drape::is_waiting)
    }

    /// The oldest error of reading the image that has not been reported yet. [`Ground::take_error`] has those of the mesh.
    pub fn take_error(&mut self) -> Option<LayoutError> {
        self.drape.as_mut().and_then(Drape::take_error)
    }

    /// Puts walls below the terrain's border, down to `bottom_m` (before exaggeration), so that it stands as a block. They go along the mesh of the
    /// ground's last update: after another one raise them anew. Costs a walk over the mesh.
    ///
    /// # Errors
    /// [`SceneError::AnotherTerrain`].
    pub fn raise_walls(&mut self, ground: &Ground<'_>, bottom_m: f32) -> Result<(), SceneError> {
        self.check(ground)?;
        if let MeshChange::Whole(whole) = ground.change_since(None) {
            let edges = border(&whole, self.renderer.terrain().samples);
            self.renderer.set_walls(&edges, bottom_m);
            self.walls = Some((edges, bottom_m));
        }
        Ok(())
    }

    /// Goes on with another device, after the loss of the old one: the next picture is as if nothing had happened. All that follows from what a device can do follows from the new
    /// one: formats and decoding of the image's tiles, sizes of pools, how ranges are drawn. The ground is not touched.
    ///
    /// # Errors
    /// What [`Renderer::new`] says; an image that the new device cannot show.
    pub fn recover(&mut self, gpu: &Gpu) -> Result<(), SceneError> {
        self.formats = gpu.capabilities.imagery_formats();
        if let Some(drape) = &mut self.drape {
            drape.suit(self.formats);
        }
        self.renderer = new_renderer(*self.renderer.terrain(), self.drape.as_ref(), gpu, self.options)?;
        self.renderer.set_material(self.material.as_ref())?;
        (self.device, self.queue) = (gpu.device.clone(), gpu.queue.clone());
        (self.seen, self.end) = (None, 0);
        if let Some((edges, bottom_m)) = &self.walls {
            self.renderer.set_walls(edges, *bottom_m);
        }
        Ok(())
    }

    /// The renderer, for what it counts: tiles, bytes, depth, time.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// What the tiles did so far.
    pub fn tile_stats(&self) -> TileStats {
        self.renderer.tile_stats()
    }

    /// The device's time for the newest frame that is known, milliseconds.
    pub fn gpu_time_ms(&mut self) -> Option<f64> {
        self.renderer.gpu_time_ms()
    }
}

fn new_renderer(
    shape: TerrainShape,
    drape: Option<&Drape>,
    gpu: &Gpu,
    options: SceneOptions,
) -> Result<Renderer, RenderError> {
    let mut renderer_options = RendererOptions::from(&gpu.capabilities);
    renderer_options.timestamps &= options.timestamps;
    let mut renderer = Renderer::new(&gpu.device, &gpu.queue, shape, renderer_options)?;
    if let Some(drape) = drape {
        drape.show(&mut renderer, options.imagery_bytes)?;
    }
    Ok(renderer)
}
