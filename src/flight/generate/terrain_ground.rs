//! A terrain file as the ground that flights are made over.
//!
//! The interface of the ground has no errors. So the first error is kept here, and asked for when the flight has been made.

use super::Ground;
use std::cell::RefCell;
use terrasoar_layout::LayoutError;
use terrasoar_layout::read::terrain::Terrain;

/// Heights of a terrain. What cannot be read counts as void, until [`TerrainGround::check`] says so.
pub struct TerrainGround<'a> {
    terrain: &'a Terrain,
    failure: RefCell<Option<LayoutError>>,
}

impl<'a> TerrainGround<'a> {
    /// The ground of `terrain`.
    pub fn new(terrain: &'a Terrain) -> Self {
        Self { terrain, failure: RefCell::new(None) }
    }

    /// Whether every height so far could be read.
    ///
    /// # Errors
    /// The first one of reading a height, once; a flight made until then is not to be used.
    pub fn check(&self) -> Result<(), LayoutError> {
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
