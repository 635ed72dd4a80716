//! The terrain on show: an opened file, its ground and its scene, opened, exchanged and closed as one.
//!
//! The file is not mapped: pages of it are read by threads into memory of a fixed size, so that no frame waits for storage and nothing that happens to the file
//! while it is on show ends the program. The mesh has a few milliseconds of each frame: at the start, and where the eye leaps, it is coarse at once and finer with every frame.

use super::heights::SceneGround;
use anyhow::{Result, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use terrasoar::ground::{Ground, Refined, StreamOptions};
use terrasoar::refine::Culling;
use terrasoar::refine::kinetic::Budget;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{Gpu, Look, Target, wgpu};
use terrasoar_scene::scene::{Drawn, Scene, SceneOptions, TileService};

/// Normal tiles a frame: each takes some 2 ms, and more would be felt.
const TILES_A_FRAME: usize = 3;

/// What refining may take of a frame. The first picture, and the one after a leap, is coarse; each after it is finer.
const REFINING: Duration = Duration::from_millis(4);

/// How a terrain on show is streamed: no frame waits for its pages or for its mesh.
fn streaming(culling: Culling, cache_bytes: u64) -> StreamOptions {
    StreamOptions::default()
        .culling(culling)
        .cache_bytes(cache_bytes)
        .first_wait(Duration::ZERO)
        .budget(Budget::default().time(REFINING))
}

/// A terrain on show.
pub(crate) struct Stage {
    pub ground: Ground<'static>,
    pub scene: Scene,
    culling: Culling,
    cache_bytes: u64,
}

impl Stage {
    /// Shows an opened terrain, with `cache_bytes` of memory for its pages.
    ///
    /// # Errors
    /// What [`Ground::streamed`] and [`Scene::new`] say.
    pub(crate) fn new(terrain: Terrain, gpu: &Gpu, culling: Culling, cache_bytes: u64) -> Result<Self> {
        let ground = Ground::streamed(Arc::new(terrain), &streaming(culling, cache_bytes))?;
        let options = SceneOptions::default().tiles(TileService::AFrame(TILES_A_FRAME));
        let scene = Scene::new(&ground, gpu, options)?;
        Ok(Self { ground, scene, culling, cache_bytes })
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
        self.with(self.terrain().open_again_unmapped()?, gpu)
    }

    /// Another terrain in the same way, on another scene.
    ///
    /// # Errors
    /// As [`Stage::new`].
    pub(crate) fn with(&self, terrain: Terrain, gpu: &Gpu) -> Result<Self> {
        Self::new(terrain, gpu, self.culling, self.cache_bytes)
    }

    /// The same terrain culled in another way, with whatever was edited.
    ///
    /// # Errors
    /// Ground that cannot be culled in another way; it is then as it was.
    pub(crate) fn set_culling(&mut self, culling: Culling) -> Result<()> {
        if culling != self.culling {
            if !self.ground.set_culling(culling) {
                bail!("the way of culling stays as it was");
            }
            self.culling = culling;
        }
        Ok(())
    }

    /// Brings the mesh to a view.
    pub(crate) fn update(&mut self, view: &View) -> Refined {
        self.ground.update(view)
    }

    /// Records a picture into `encoder`; `frozen` is the view that the mesh was refined for, where that is another.
    ///
    /// # Errors
    /// What the scene says.
    pub(crate) fn draw(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
        view: &View,
        look: &Look,
        frozen: Option<&View>,
    ) -> Result<Drawn> {
        let drawn = self.scene.sync(&mut self.ground, encoder, view, look)?;
        self.scene.draw(encoder, target, view, look, frozen)?;
        Ok(drawn)
    }

    /// Whether something that the last picture lacked is on its way.
    pub(crate) fn is_waiting(&self) -> bool {
        self.ground.is_waiting() || self.scene.is_waiting()
    }

    /// The oldest error of reading that has not been reported yet.
    pub(crate) fn take_error(&mut self) -> Option<LayoutError> {
        self.ground.take_error().or_else(|| self.scene.take_error())
    }

    /// The terrain file.
    pub(crate) fn path(&self) -> PathBuf {
        self.terrain().path().to_path_buf()
    }

    /// The opened terrain.
    pub(crate) fn terrain(&self) -> &Terrain {
        self.ground.terrain()
    }

    /// Its heights.
    pub(crate) fn heights(&self) -> SceneGround<'_> {
        SceneGround::new(&self.ground)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;
    use terrasoar_layout::build::{BuildOptions, build};
    use terrasoar_layout::dem::{MemoryDem, SampleType};
    use terrasoar_layout::progress::Silent;

    /// Refines for a view until nothing is on its way; tells the vertex tests of the first frame, its triangles, and the triangles of the last.
    fn come_to_rest(ground: &mut Ground<'_>, view: &View) -> [u64; 3] {
        let (begun, refined) = (Instant::now(), ground.update(view));
        let first = [refined.work.tests, refined.triangles];
        loop {
            let refined = ground.update(view);
            if !ground.is_waiting() && refined.work.late == 0 {
                return [first[0], first[1], refined.triangles];
            }
            assert!(begun.elapsed() < Duration::from_secs(120), "{refined:?}");
        }
    }

    /// At the start and after a leap to a place whose pages are all in memory.
    #[test]
    fn a_picture_is_coarse_at_once_and_fine_in_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("land.iqt");
        let steep = |x: u32, y: u32| f64::from(((x * 37) ^ (y * 91)) % 61 + (x ^ y) % 512);
        let dem = MemoryDem::from_fn([1025; 2], SampleType::I16, steep);
        build(&dem, &path, &BuildOptions::default().spacing_m([10.0; 2]), &Silent).unwrap();
        let open = || Arc::new(Terrain::open_unmapped(&path).unwrap());
        let views = [
            View::new([5000.0, 500.0, 2000.0], 0.0, -25.0).tolerance_px(0.5),
            View::new([5000.0, 9500.0, 2500.0], 180.0, -25.0).tolerance_px(0.5),
        ];
        for culling in Culling::ALL {
            let mut whole =
                Ground::streamed(open(), &StreamOptions::default().culling(culling).cache_bytes(64 << 20))
                    .unwrap();
            let all = views.each_ref().map(|view| come_to_rest(&mut whole, view)[2]);
            assert!(all[0] > 300_000, "{all:?} are made in one frame");
            let mut shown = Ground::streamed(open(), &streaming(culling, 64 << 20)).unwrap();
            for (leap, i) in [0, 1, 0, 1].into_iter().enumerate() {
                let [tests, first, last] = come_to_rest(&mut shown, &views[i]);
                assert_eq!(last, all[i], "{culling:?}, view {i}");
                // Clusters are culled alone, so that a mesh which serves both places is kept: then its tests are few, and its triangles are not.
                assert!(4 * tests < last, "{culling:?}, view {i}: {tests} tests for {last} triangles");
                let is_kept = leap > 0 && culling == Culling::Clusters;
                assert!(is_kept || 2 * first < last, "{culling:?}, view {i}: {first} of {last} at first");
            }
        }
    }
}
