//! A terrain in sight: an engine that refines it and a renderer that holds its mesh, kept in step.
//!
//! A frame is [`Scene::update`], which brings the mesh to a view, and [`Scene::draw`], which sends what changed and records the picture. They
//! come one by one, so refinement may be frozen while the eye goes on: draw without update, and say which view the mesh is for. Updates that
//! are not drawn cost nothing but memory for their changes; before the first picture not even that.
//!
//! **The device holds nothing that is not here.** After its loss [`Scene::recover`] takes a new one, which may be able to do other things, and the next picture is the same. Light
//! comes from tiles of heights: a bounded number a frame for a window, all of them for a picture that must repeat byte by byte.
//!
//! Cost on the processor: the engine's update, a copy of its patch, some 2 ms a tile.

pub use super::options::{Drawn, SceneError, SceneOptions, TileService};

use super::border::border;
use super::drape::Drape;
use super::feed::{Feed, Refined};
use super::pending::Pending;
use super::repaint::{Picture, Repaint};
use super::sight::{ahead, shape};
use super::streamed::streamed_feed;
use crate::mapped::feed;
use std::sync::Arc;
use terrasoar::refine::Culling;
use terrasoar::stream::GroundPatch;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::Edit;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::imagery::{Imagery, Paint, TileFormat, TileId};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{
    Frame, Gpu, Look, MeshPatch, RenderError, Renderer, RendererOptions, Target, TerrainShape, TileStats,
    UploadStats, wgpu,
};

/// Tiles that are asked for, for each that is given in a frame.
const TILES_ASKED: usize = 8;

/// Tiles of the image that a frame of a window is given at most: a megabyte of BC1.
const IMAGE_TILES_A_FRAME: usize = 8;
/// Texels across the scorch of a crater at most: one as wide takes a third of a second.
const WIDEST_SCORCH: f64 = 2048.0;

/// An opened terrain, its engine and its renderer.
pub struct Scene<'a> {
    feed: Box<dyn Feed + 'a>,
    renderer: Renderer,
    options: SceneOptions,
    pending: Pending,
    /// Border edges, as vertex slots, and how far down walls go from them.
    walls: Option<(Vec<[u32; 2]>, f32)>,
    heights_m: Vec<f32>,
    wanted: Vec<TileId>,
    drape: Option<Drape>,
    /// Whether the last picture had the image in it.
    shows_image: bool,
    /// What the device takes of images.
    formats: &'static [TileFormat],
    /// The views of the last two updates, which say where the eye is going.
    ways: [Option<View>; 2],
}

impl<'a> Scene<'a> {
    /// A scene without a mesh; the first [`Scene::update`] makes it. Reads nothing but the terrain's header.
    ///
    /// # Errors
    /// [`SceneError::NotInAddressSpace`], and what [`Renderer::new`] says.
    pub fn new(terrain: &'a Terrain, gpu: &Gpu, options: SceneOptions) -> Result<Self, SceneError> {
        let feed = feed(terrain, options.engine, options.culling)
            .ok_or_else(|| SceneError::NotInAddressSpace(terrain.path().display().to_string()))?;
        // Tiles are read, not mapped, whatever the records are.
        let drape = match Imagery::open(terrain)? {
            None => None,
            Some(_) => Drape::of(
                Arc::new(terrain.open_again_unmapped()?),
                gpu.capabilities.imagery_formats(),
                options.is_for_a_window(),
            )?,
        };
        Self::over(feed, drape, terrain, gpu, options)
    }

    /// A scene over a terrain that need not be mapped: its pages are read into `cache_bytes` of memory by threads, and no frame waits for one. The engine
    /// is [`PictureEngine::Kinetic`] whatever the options say.
    ///
    /// # Errors
    /// [`SceneError::Layout`], and what [`Renderer::new`] says.
    pub fn streamed(
        terrain: &Arc<Terrain>,
        cache_bytes: u64,
        gpu: &Gpu,
        options: SceneOptions,
    ) -> Result<Self, SceneError> {
        let feed = streamed_feed(terrain, cache_bytes, options.culling)?;
        let formats = gpu.capabilities.imagery_formats();
        let drape = Drape::of(Arc::clone(terrain), formats, options.is_for_a_window())?;
        Self::over(feed, drape, terrain, gpu, options)
    }

    fn over(
        feed: Box<dyn Feed + 'a>,
        drape: Option<Drape>,
        terrain: &Terrain,
        gpu: &Gpu,
        options: SceneOptions,
    ) -> Result<Self, SceneError> {
        let renderer = new_renderer(shape(terrain), drape.as_ref(), gpu, options)?;
        Ok(Self {
            drape,
            shows_image: false,
            formats: gpu.capabilities.imagery_formats(),
            ways: [None; 2],
            feed,
            renderer,
            options,
            pending: Pending::default(),
            walls: None,
            heights_m: Vec::new(),
            wanted: Vec::new(),
        })
    }

    /// What the mesh and its light are made from: heights of the ground, and what could not be read.
    pub fn feed(&self) -> &(dyn Feed + 'a) {
        &*self.feed
    }

    /// As [`Scene::feed`], to ask for more.
    pub fn feed_mut(&mut self) -> &mut (dyn Feed + 'a) {
        &mut *self.feed
    }

    /// Brings the mesh to a view. Touches no device.
    pub fn update(&mut self, view: &View) -> Refined {
        let refined = self.feed.update(view);
        self.ways = [self.ways[1], Some(*view)];
        self.pending.changed = true;
        if self.pending.begun {
            self.pending.take(self.feed.patch());
        }
        refined
    }

    /// Records what changed and a picture into `encoder`. `refined_for` is the view of the last update where that is another than `view`
    /// (frozen refinement). Submit the encoder before the next draw, and ask the device's watch whether all went well.
    ///
    /// # Errors
    /// [`SceneError::Render`]: a mesh too large for the device, or a view that is none.
    pub fn draw(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
        view: &View,
        look: &Look,
        refined_for: Option<&View>,
    ) -> Result<Drawn, SceneError> {
        let mut tiles = Drawn::default();
        if look.tile_normals {
            self.serve_tiles(view, &mut tiles)?;
        }
        if look.imagery > 0.0 {
            self.serve_image(view, &mut tiles)?;
        } else {
            self.shows_image = false;
        }
        let drawn = self.draw_served(encoder, target, view, look, refined_for)?;
        Ok(Drawn { upload: drawn.upload, draw: drawn.draw, ..tiles })
    }

    /// [`Scene::draw`] without asking for tiles.
    ///
    /// # Errors
    /// As there.
    pub fn draw_served(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
        view: &View,
        look: &Look,
        refined_for: Option<&View>,
    ) -> Result<Drawn, SceneError> {
        let mut drawn = Drawn { upload: self.send(encoder)?, ..Drawn::default() };
        let frame = Frame { view, refined_for, look };
        drawn.draw = self.renderer.render(encoder, target, frame)?;
        Ok(drawn)
    }

    /// Records what changed in the mesh; [`Scene::draw`] does so by itself.
    pub fn send(&mut self, encoder: &mut wgpu::CommandEncoder) -> Result<UploadStats, SceneError> {
        let pending = &mut self.pending;
        if !pending.changed {
            return Ok(UploadStats::default());
        }
        if !pending.begun {
            pending.take(&self.feed.whole());
        }
        let patch =
            MeshPatch { vertices: &pending.vertices, triangles: &pending.triangles, draws: &pending.draws };
        let sent = self.renderer.apply(encoder, &patch)?;
        pending.begun = true;
        pending.clear();
        Ok(sent)
    }

    /// Gives the renderer tiles that the view lacks, as many as the options say, and counts them in `drawn`.
    ///
    /// # Errors
    /// What the renderer says.
    pub fn serve_tiles(&mut self, view: &View, drawn: &mut Drawn) -> Result<(), SceneError> {
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
                if self.feed.heights_m(*tile, &mut self.heights_m) {
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
    pub fn serve_image(&mut self, view: &View, drawn: &mut Drawn) -> Result<(), SceneError> {
        let Some(drape) = &mut self.drape else { return Ok(()) };
        self.shows_image = true;
        let ahead = match self.ways {
            [Some(before), Some(now)] => ahead(&before, &now),
            _ => *view,
        };
        drawn.image = drape.serve(&mut self.renderer, view, &ahead, IMAGE_TILES_A_FRAME)?;
        drawn.image_missing = self.renderer.imagery_stats().missing;
        Ok(())
    }

    /// Takes over edits of the ground: the next update's mesh shows them, and light follows within some frames. Whether it can: only scenes of windows do.
    ///
    /// # Errors
    /// Edits of another terrain.
    pub fn ground_changed(&mut self, patch: GroundPatch) -> Result<bool, LayoutError> {
        let areas = patch.samples.clone();
        if !self.feed.ground_changed(patch)? {
            return Ok(false);
        }
        for rect in &areas {
            self.renderer.change_heights([rect.west, rect.south], [rect.east, rect.north]);
        }
        Ok(true)
    }

    /// Takes notice that edits are in the file: these pages lie there now, as they were told last.
    pub fn committed(&mut self, places: &[(u64, Entry)]) {
        self.feed.relocate(places);
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

    /// Whether something that the last picture lacked is on its way.
    pub fn is_waiting(&self) -> bool {
        self.feed.is_waiting() || self.shows_image && self.drape.as_ref().is_some_and(Drape::is_waiting)
    }

    /// What could not be read and nobody has heard of yet.
    pub fn take_error(&mut self) -> Option<LayoutError> {
        self.feed.take_error().or_else(|| self.drape.as_mut().and_then(Drape::take_error))
    }

    /// Puts walls below the terrain's border, down to `bottom_m` (before exaggeration), so that it stands as a block. They go along the mesh of the
    /// last update: after another one raise them anew. Costs a walk over the mesh.
    pub fn raise_walls(&mut self, bottom_m: f32) {
        let edges = border(&self.feed.whole(), self.renderer.terrain().samples);
        self.renderer.set_walls(&edges, bottom_m);
        self.walls = Some((edges, bottom_m));
    }

    /// Goes on with another device, after the loss of the old one: the next picture is as if nothing had happened. All that follows from what a device can do follows from the new
    /// one: formats and decoding of the image's tiles, sizes of pools, how ranges are drawn. The engine is not touched.
    ///
    /// # Errors
    /// What [`Renderer::new`] says; an image that the new device cannot show.
    pub fn recover(&mut self, gpu: &Gpu) -> Result<(), SceneError> {
        self.formats = gpu.capabilities.imagery_formats();
        if let Some(drape) = &mut self.drape {
            drape.suit(self.formats);
        }
        self.renderer = new_renderer(*self.renderer.terrain(), self.drape.as_ref(), gpu, self.options)?;
        self.pending = Pending::default();
        self.pending.changed = true;
        if let Some((edges, bottom_m)) = &self.walls {
            self.renderer.set_walls(edges, *bottom_m);
        }
        Ok(())
    }

    /// Culls in another way from now on; whatever was edited stays so. The next update makes the mesh anew, and it goes to the device as a whole. Whether it can: only scenes of
    /// windows do.
    ///
    /// # Errors
    /// As [`Scene::recover`]; the scene is then as it was.
    pub fn set_culling(&mut self, culling: Culling, gpu: &Gpu) -> Result<bool, SceneError> {
        let renderer = new_renderer(*self.renderer.terrain(), self.drape.as_ref(), gpu, self.options)?;
        if !self.feed.set_culling(culling) {
            return Ok(false);
        }
        self.options.culling = culling;
        self.renderer = renderer;
        self.pending = Pending::default();
        // They stood along the old mesh.
        self.walls = None;
        Ok(true)
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
