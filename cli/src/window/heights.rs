//! The heights of the terrain on show, for flying and picking, from what is in memory. It never waits.
//!
//! A place outside the data or in a void has no height. Where records are not in memory it is the height of the finest triangle that is.

use terrasoar::flight::generate::Ground;
use terrasoar::ground::Ground as GroundOnShow;

/// Heights of a terrain on show.
pub(crate) struct SceneGround<'a> {
    ground: &'a GroundOnShow<'static>,
}

impl<'a> SceneGround<'a> {
    /// The heights of `ground`, as it knows them now.
    pub(crate) fn new(ground: &'a GroundOnShow<'static>) -> Self {
        Self { ground }
    }

    /// Metres from sample to sample, east and north.
    pub(crate) fn spacing_m(&self) -> [f64; 2] {
        self.ground.terrain().grid().spacing_m()
    }
}

impl Ground for SceneGround<'_> {
    fn extent_m(&self) -> [f64; 2] {
        self.ground.extent_m()
    }

    fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
        self.ground.height_at(east_m, north_m).height_m
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.ground.height_range_m()
    }
}
