//! A terrain in sight: an engine that refines it and a renderer that holds its mesh, kept in step.
//!
//! A frame is [`Scene::update`], which brings the mesh to a view, and [`Scene::draw`], which sends what changed and records the picture. They
//! come one by one, so refinement may be frozen while the eye goes on: draw without update, and say which view the mesh is for. Updates that
//! are not drawn cost nothing but memory for their changes; before the first picture not even that.
//!
//! **The device holds nothing that is not here.** After its loss [`Scene::recover`] takes a new one, and the next picture is the same. Light comes
//! from tiles of heights: a bounded number a frame for a window, all of them for a picture that must repeat byte by byte.
//!
//! Cost on the processor: the engine's update, a copy of its patch, some 2 ms a tile.

use super::border::border;
use super::drape::{Drape, Served};
use super::feed::{Feed, PictureEngine, Refined, feed};
use super::pending::Pending;
use super::streamed::streamed_feed;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use terrasoar::refine::Culling;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Changes, Edit, EditSession, Editor, Repainted};
use terrasoar_layout::imagery::{Imagery, Paint, Painter};
use terrasoar_layout::terrain::Terrain;
use terrasoar_render::{
    DrawStats, Frame, FrameView, Gpu, ImageryFormat, Look, MeshPatch, RenderError, Renderer, RendererOptions,
    Target, TerrainShape, TileId, TileStats, UploadStats, wgpu,
};

/// Tiles that are asked for, for each that is given in a frame.
const TILES_ASKED: usize = 8;

/// Tiles of the image that a frame of a window is given at most: a megabyte of BC1.
const IMAGE_TILES_A_FRAME: usize = 8;
/// Texels across the scorch of a crater at most: one as wide takes a third of a second.
const WIDEST_SCORCH: f64 = 2048.0;
/// Frames ahead of the eye that tiles of the image are asked for.
const FRAMES_AHEAD: f64 = 24.0;

/// How a scene is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SceneOptions {
    /// What makes the mesh.
    pub engine: PictureEngine,
    /// Where what lies out of view is left out.
    pub culling: Culling,
    /// Normal tiles given a frame.
    pub tiles: TileService,
    /// Device memory for the tiles of the image, in bytes.
    pub imagery_bytes: u64,
    /// Whether frames are timed on the device, where it can ([`Scene::gpu_time_ms`]).
    pub timestamps: bool,
}

impl SceneOptions {
    /// Whether frames must not wait.
    fn is_for_a_window(self) -> bool {
        self.tiles != TileService::All
    }
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            engine: PictureEngine::default(),
            culling: Culling::default(),
            tiles: TileService::default(),
            imagery_bytes: Renderer::IMAGERY_BYTES,
            timestamps: false,
        }
    }
}

/// How many of the normal tiles that a view lacks it is given before it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum TileService {
    /// All: the picture depends on the view alone.
    #[default]
    All,
    /// So many a frame, the coarsest first; what is missing shows coarser shading for some frames.
    AFrame(usize),
}

/// Why there is no scene or picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum SceneError {
    /// The terrain's source does not lend its bytes.
    #[error("{0}: pictures need a mapped or in-memory terrain")]
    NotInAddressSpace(String),
    /// The terrain cannot be read.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The renderer or its device failed. [`RenderError::DeviceLost`] is over with [`Scene::recover`].
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// What a picture cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Drawn {
    /// Mesh sent to the device.
    pub upload: UploadStats,
    /// Draw calls.
    pub draw: DrawStats,
    /// Tiles given and their bytes.
    pub tiles: [u64; 2],
    /// Tiles that the view still lacks.
    pub tiles_missing: u32,
    /// Tiles of the image given.
    pub image: Served,
    /// Tiles of the image that the view still lacks.
    pub image_missing: u32,
}

/// An opened terrain, its engine and its renderer.
pub(crate) struct Scene<'a> {
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
    formats: &'static [ImageryFormat],
    /// The views of the last two updates, which say where the eye is going.
    ways: [Option<View>; 2],
}

impl<'a> Scene<'a> {
    /// A scene without a mesh; the first [`Scene::update`] makes it. Reads nothing but the terrain's header.
    ///
    /// # Errors
    /// [`SceneError::NotInAddressSpace`], and what [`Renderer::new`] says.
    pub(crate) fn new(terrain: &'a Terrain, gpu: &Gpu, options: SceneOptions) -> Result<Self, SceneError> {
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
    pub(crate) fn streamed(
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
    pub(crate) fn feed(&self) -> &(dyn Feed + 'a) {
        &*self.feed
    }

    /// As [`Scene::feed`], to ask for more.
    pub(crate) fn feed_mut(&mut self) -> &mut (dyn Feed + 'a) {
        &mut *self.feed
    }

    /// Brings the mesh to a view. Touches no device.
    pub(crate) fn update(&mut self, view: &View) -> Refined {
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
    pub(crate) fn draw(
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
    pub(crate) fn draw_served(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
        view: &View,
        look: &Look,
        refined_for: Option<&View>,
    ) -> Result<Drawn, SceneError> {
        let view = frame_view(view);
        let refined_for = refined_for.map(frame_view);
        let mut drawn = Drawn { upload: self.send(encoder)?, ..Drawn::default() };
        let frame = Frame { view: &view, refined_for: refined_for.as_ref(), look };
        drawn.draw = self.renderer.render(encoder, target, frame)?;
        Ok(drawn)
    }

    /// Records what changed in the mesh; [`Scene::draw`] does so by itself.
    pub(crate) fn send(&mut self, encoder: &mut wgpu::CommandEncoder) -> Result<UploadStats, SceneError> {
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
    pub(crate) fn serve_tiles(&mut self, view: &View, drawn: &mut Drawn) -> Result<(), SceneError> {
        let view = &frame_view(view);
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
    pub(crate) fn serve_image(&mut self, view: &View, drawn: &mut Drawn) -> Result<(), SceneError> {
        let Some(drape) = &mut self.drape else { return Ok(()) };
        self.shows_image = true;
        let ahead = match self.ways {
            [Some(before), Some(now)] => ahead(&before, &now),
            _ => *view,
        };
        drawn.image =
            drape.serve(&mut self.renderer, &frame_view(view), &frame_view(&ahead), IMAGE_TILES_A_FRAME)?;
        drawn.image_missing = self.renderer.imagery_stats().missing;
        Ok(())
    }

    /// Takes over edits of the ground: the next update's mesh shows them, and light follows within some frames. Whether it can: only scenes of windows do.
    ///
    /// # Errors
    /// Edits of another terrain.
    pub(crate) fn ground_changed(&mut self, changes: &Changes, editor: &Editor) -> Result<bool, LayoutError> {
        if !self.feed.ground_changed(changes, editor)? {
            return Ok(false);
        }
        for rect in &changes.samples {
            self.renderer.change_heights([rect.west, rect.south], [rect.east, rect.north]);
        }
        Ok(true)
    }

    /// Takes over what became of the image in an editing session: the next picture shows paint, an undo and a redo. To be called after each of them, and after a commit.
    ///
    /// # Errors
    /// Another image, which an undo or a redo led to, cannot be read or shown.
    pub(crate) fn repainted(&mut self, session: &mut EditSession) -> Result<(), SceneError> {
        let Repainted { tiles, is_another } = session.take_repainted();
        let place = session.header().imagery;
        if is_another {
            let (formats, threads) = (self.formats, self.options.is_for_a_window());
            let over = |painter: &Painter| {
                let (terrain, imagery) = (Arc::clone(painter.terrain()), painter.imagery().clone());
                Drape::over(terrain, imagery, place, formats, threads)
            };
            self.drape = session.open_picture()?.map(over).transpose()?;
            let shape = self.drape.as_ref().map(Drape::shape);
            self.renderer.set_imagery(shape, self.options.imagery_bytes)?;
        }
        if let (Some(drape), Some(painter)) = (&mut self.drape, session.painter()) {
            drape.repainted(&mut self.renderer, &tiles, painter, place);
        }
        Ok(())
    }

    /// What craters among these edits burn into the image: nothing where there is none, or none that this build can paint, and by none that is too wide for a frame to
    /// wait for.
    pub(crate) fn scorches_of(&self, edits: &[Edit]) -> Vec<Paint> {
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
    pub(crate) fn has_image(&self) -> bool {
        self.drape.is_some()
    }

    /// Whether something that the last picture lacked is on its way.
    pub(crate) fn is_waiting(&self) -> bool {
        self.feed.is_waiting() || self.shows_image && self.drape.as_ref().is_some_and(Drape::is_waiting)
    }

    /// What could not be read and nobody has heard of yet.
    pub(crate) fn take_error(&mut self) -> Option<LayoutError> {
        self.feed.take_error().or_else(|| self.drape.as_mut().and_then(Drape::take_error))
    }

    /// Puts walls below the terrain's border, down to `bottom_m` (before exaggeration), so that it stands as a block. They go along the mesh of the
    /// last update: after another one raise them anew. Costs a walk over the mesh.
    pub(crate) fn raise_walls(&mut self, bottom_m: f32) {
        let edges = border(&self.feed.whole(), self.renderer.terrain().samples);
        self.renderer.set_walls(&edges, bottom_m);
        self.walls = Some((edges, bottom_m));
    }

    /// Goes on with another device, after the loss of the old one: the next picture is as if nothing had happened. The engine is not touched.
    ///
    /// # Errors
    /// What [`Renderer::new`] says.
    pub(crate) fn recover(&mut self, gpu: &Gpu) -> Result<(), SceneError> {
        self.renderer = new_renderer(*self.renderer.terrain(), self.drape.as_ref(), gpu, self.options)?;
        self.pending = Pending::default();
        self.pending.changed = true;
        if let Some((edges, bottom_m)) = &self.walls {
            self.renderer.set_walls(edges, *bottom_m);
        }
        Ok(())
    }

    /// The renderer, for what it counts: tiles, bytes, depth, time.
    pub(crate) fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// What the tiles did so far.
    pub(crate) fn tile_stats(&self) -> TileStats {
        self.renderer.tile_stats()
    }

    /// The device's time for the newest frame that is known, milliseconds.
    pub(crate) fn gpu_time_ms(&mut self) -> Option<f64> {
        self.renderer.gpu_time_ms()
    }
}

/// Where a steady eye will be in some frames.
fn ahead(before: &View, now: &View) -> View {
    let turned = |before: f64, now: f64| now + FRAMES_AHEAD * (now - before).sin();
    View {
        eye_m: now.eye_m + FRAMES_AHEAD * (now.eye_m - before.eye_m),
        yaw_rad: turned(before.yaw_rad, now.yaw_rad),
        pitch_rad: turned(before.pitch_rad, now.pitch_rad).clamp(-FRAC_PI_2, FRAC_PI_2),
        ..*now
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
    renderer.set_imagery(drape.map(Drape::shape), options.imagery_bytes)?;
    Ok(renderer)
}

/// What the renderer needs to know of a terrain.
pub(crate) fn shape(terrain: &Terrain) -> TerrainShape {
    let grid = terrain.grid();
    TerrainShape {
        spacing_m: grid.spacing_m(),
        samples: grid.samples(),
        height_range_m: terrain.header().height_range_m,
    }
}

/// A view as the renderer takes it.
pub(crate) fn frame_view(view: &View) -> FrameView {
    let [right, up, forward] = view.axes();
    FrameView {
        eye_m: view.eye_m,
        right,
        up,
        forward,
        vertical_fov_rad: view.vertical_fov_rad,
        viewport_px: [view.viewport.width_px, view.viewport.height_px],
        tolerance_px: view.tolerance_px,
        vertical_exaggeration: view.vertical_exaggeration,
    }
}
