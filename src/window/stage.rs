//! The terrain on show: an opened file, its scene and its ground, opened, exchanged and closed as one.

use super::ground::MappedGround;
use crate::app::scene::{Scene, SceneError, SceneOptions, TileService};
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use terrasoar::refine::Culling;
use terrasoar_layout::terrain::Terrain;
use terrasoar_render::Gpu;

/// Normal tiles a frame: each takes some 2 ms, and more would be felt.
const TILES_A_FRAME: usize = 3;

/// What borrows the opened file.
pub(crate) struct Live<'a> {
    pub scene: Scene<'a>,
    pub ground: MappedGround<'a>,
}

self_cell::self_cell!(
    struct Opened {
        owner: Terrain,
        #[not_covariant]
        dependent: Live,
    }
);

/// A terrain on show.
pub(crate) struct Stage {
    opened: Opened,
    culling: Culling,
}

impl Stage {
    /// Shows an opened terrain.
    ///
    /// # Errors
    /// What [`Scene::new`] says.
    pub(crate) fn new(terrain: Terrain, gpu: &Gpu, culling: Culling) -> Result<Self> {
        let options =
            SceneOptions { culling, tiles: TileService::AFrame(TILES_A_FRAME), ..Default::default() };
        let opened = Opened::try_new(terrain, |terrain| -> Result<Live<'_>, SceneError> {
            let scene = Scene::new(terrain, gpu, options)?;
            let ground = MappedGround::new(terrain)
                .ok_or_else(|| SceneError::NotInAddressSpace(terrain.path().display().to_string()))?;
            Ok(Live { scene, ground })
        })?;
        Ok(Self { opened, culling })
    }

    /// Opens a terrain file.
    ///
    /// # Errors
    /// What [`Terrain::open`] and [`Stage::new`] say.
    pub(crate) fn open(path: &Path, gpu: &Gpu, culling: Culling) -> Result<Self> {
        Self::new(Terrain::open(path)?, gpu, culling)
    }

    /// The same terrain culled in another way.
    ///
    /// # Errors
    /// As [`Stage::open`]; the stage is then as it was.
    pub(crate) fn set_culling(&mut self, culling: Culling, gpu: &Gpu) -> Result<()> {
        if culling != self.culling {
            *self = Self::open(&self.path(), gpu, culling).context("the way of culling stays as it was")?;
        }
        Ok(())
    }

    /// The terrain file.
    pub(crate) fn path(&self) -> PathBuf {
        self.opened.borrow_owner().path().to_path_buf()
    }

    /// The opened terrain.
    pub(crate) fn terrain(&self) -> &Terrain {
        self.opened.borrow_owner()
    }

    /// Does something with ground and scene.
    pub(crate) fn with<R>(&mut self, act: impl for<'a> FnOnce(&mut Live<'a>) -> R) -> R {
        self.opened.with_dependent_mut(|_, live| act(live))
    }

    /// Looks at the ground.
    pub(crate) fn on_ground<R>(&self, look: impl for<'a> FnOnce(&MappedGround<'a>) -> R) -> R {
        self.opened.with_dependent(|_, live| look(&live.ground))
    }
}
