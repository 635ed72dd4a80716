//! The terrain on show: an opened file and its scene, opened, exchanged and closed as one.
//!
//! The file is not mapped: pages of it are read by threads into memory of a fixed size, so that no frame waits for storage and nothing that happens to the file
//! while it is on show ends the program.

use super::heights::SceneGround;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrasoar::refine::Culling;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::Gpu;
use terrasoar_scene::scene::{Scene, SceneOptions, TileService};

/// Normal tiles a frame: each takes some 2 ms, and more would be felt.
const TILES_A_FRAME: usize = 3;

/// A terrain on show.
pub(crate) struct Stage {
    terrain: Arc<Terrain>,
    pub scene: Scene<'static>,
    culling: Culling,
    cache_bytes: u64,
}

impl Stage {
    /// Shows an opened terrain, with `cache_bytes` of memory for its pages.
    ///
    /// # Errors
    /// What [`Scene::streamed`] says.
    pub(crate) fn new(terrain: Terrain, gpu: &Gpu, culling: Culling, cache_bytes: u64) -> Result<Self> {
        let options =
            SceneOptions { culling, tiles: TileService::AFrame(TILES_A_FRAME), ..Default::default() };
        let terrain = Arc::new(terrain);
        let scene = Scene::streamed(&terrain, cache_bytes, gpu, options)?;
        Ok(Self { terrain, scene, culling, cache_bytes })
    }

    /// Opens a terrain file.
    ///
    /// # Errors
    /// What [`Terrain::open_unmapped`] and [`Stage::new`] say.
    pub(crate) fn open(path: &Path, gpu: &Gpu, culling: Culling, cache_bytes: u64) -> Result<Self> {
        Self::new(Terrain::open_unmapped(path)?, gpu, culling, cache_bytes)
    }

    /// The same terrain as it is in the file now, on another scene.
    ///
    /// # Errors
    /// As [`Stage::open`].
    pub(crate) fn again(&self, gpu: &Gpu) -> Result<Self> {
        Self::new(self.terrain.open_again_unmapped()?, gpu, self.culling, self.cache_bytes)
    }

    /// The same terrain culled in another way, with whatever was edited.
    ///
    /// # Errors
    /// As [`Scene::set_culling`]; the stage is then as it was.
    pub(crate) fn set_culling(&mut self, culling: Culling, gpu: &Gpu) -> Result<()> {
        if culling != self.culling {
            self.scene.set_culling(culling, gpu).context("the way of culling stays as it was")?;
            self.culling = culling;
        }
        Ok(())
    }

    /// The terrain file.
    pub(crate) fn path(&self) -> PathBuf {
        self.terrain.path().to_path_buf()
    }

    /// The opened terrain.
    pub(crate) fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// Its ground.
    pub(crate) fn ground(&self) -> SceneGround<'_> {
        SceneGround::new(&self.terrain, self.scene.feed())
    }
}
