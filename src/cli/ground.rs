//! A terrain file as the ground that flights are made over.
//!
//! The ground's interface knows no failure; the first one is kept and asked for when the flight is made.

use std::cell::RefCell;
use terrasoar::flight::generate::Ground;
use terrasoar_layout::LayoutError;
use terrasoar_layout::terrain::Terrain;

/// Heights of a terrain.
pub(super) struct TerrainGround<'a> {
    terrain: &'a Terrain,
    failure: RefCell<Option<LayoutError>>,
}

impl<'a> TerrainGround<'a> {
    pub(super) fn new(terrain: &'a Terrain) -> Self {
        Self { terrain, failure: RefCell::new(None) }
    }

    /// Whether every height so far could be read.
    pub(super) fn check(&self) -> Result<(), LayoutError> {
        self.failure.borrow_mut().take().map_or(Ok(()), Err)
    }
}

impl Ground for TerrainGround<'_> {
    fn extent_m(&self) -> [f64; 2] {
        self.terrain.grid().extent_m()
    }

    fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
        match self.terrain.height_m(east_m, north_m) {
            Ok(height) => height,
            Err(error) => {
                self.failure.borrow_mut().get_or_insert(error);
                None
            }
        }
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.terrain.header().height_range_m
    }
}
