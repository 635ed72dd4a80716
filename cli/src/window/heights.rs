//! The heights of the terrain on show as flying and picking want them: what is at hand of it, and never a wait.
//!
//! A place outside the data or at a void has no height. Where records are away it is the height of the finest triangle at hand.

use terrasoar::flight::generate::Ground;
use terrasoar_layout::grid::Grid;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_scene::feed::Feed;

/// Heights of a terrain on show.
pub(crate) struct SceneGround<'a> {
    feed: &'a dyn Feed,
    grid: Grid,
}

impl<'a> SceneGround<'a> {
    /// The ground of `terrain`, as `feed` knows it now.
    pub(crate) fn new(terrain: &Terrain, feed: &'a dyn Feed) -> Self {
        Self { feed, grid: *terrain.grid() }
    }

    /// Metres from sample to sample, east and north.
    pub(crate) fn spacing_m(&self) -> [f64; 2] {
        self.grid.spacing_m()
    }
}

impl Ground for SceneGround<'_> {
    fn extent_m(&self) -> [f64; 2] {
        self.grid.extent_m()
    }

    fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
        self.feed.ground_m(east_m, north_m)
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.feed.height_range_m()
    }
}
