//! How a scene is made, what its pictures cost, and why there may be none: plain values.

use super::drape::Served;
use terrasoar_layout::LayoutError;
use terrasoar_render::{RenderError, Renderer, UploadStats};

/// How a scene is made.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SceneOptions {
    /// Normal tiles given a frame.
    pub tiles: TileService,
    /// Device memory for the tiles of the image, in bytes.
    pub imagery_bytes: u64,
    /// Whether frames are timed on the device, where it can ([`Scene::gpu_time_ms`](super::scene::Scene::gpu_time_ms)).
    pub timestamps: bool,
}

impl SceneOptions {
    /// These options with another number of normal tiles a frame.
    pub fn tiles(self, tiles: TileService) -> Self {
        Self { tiles, ..self }
    }

    /// These options with so many bytes of device memory for tiles of the image.
    pub fn imagery_bytes(self, imagery_bytes: u64) -> Self {
        Self { imagery_bytes, ..self }
    }

    /// These options with frames timed on the device, or not.
    pub fn timestamps(self, timestamps: bool) -> Self {
        Self { timestamps, ..self }
    }

    /// Whether frames must not wait.
    pub(super) fn is_for_a_window(self) -> bool {
        self.tiles != TileService::All
    }
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { tiles: TileService::default(), imagery_bytes: Renderer::IMAGERY_BYTES, timestamps: false }
    }
}

/// How many of the normal tiles that a view lacks it is given before it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TileService {
    /// All: the picture depends on the view alone.
    #[default]
    All,
    /// So many a frame, the coarsest first; what is missing shows coarser shading for some frames.
    AFrame(usize),
}

/// Why there is no scene or picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The scene was made for another terrain, or for this one opened another time.
    #[error("{0}: the scene was made for another terrain; make one for this ground")]
    AnotherTerrain(String),
    /// The terrain cannot be read.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The renderer or its device failed. [`RenderError::DeviceLost`] is over with [`Scene::recover`](super::scene::Scene::recover).
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// What a picture cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Mesh sent to the device.
    pub upload: UploadStats,
    /// Tiles given and their bytes.
    pub tiles: [u64; 2],
    /// Tiles that the view still lacks.
    pub tiles_missing: u32,
    /// Tiles of the image given.
    pub image: Served,
    /// Tiles of the image that the view still lacks.
    pub image_missing: u32,
}
