//! A terrain file as what flights are laid over.

use terrasoar::flight::generate::Ground;
use terrasoar_layout::terrain::Terrain;

pub struct OverTerrain<'a>(pub &'a Terrain);

impl Ground for OverTerrain<'_> {
    fn extent_m(&self) -> [f64; 2] {
        self.0.grid().extent_m()
    }

    fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
        self.0.height_m(east_m, north_m).ok().flatten()
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.0.header().height_range_m
    }
}
