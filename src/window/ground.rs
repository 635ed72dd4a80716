//! The heights of a terrain as flying and picking want them: read from the mapped records, bilinear between samples.
//!
//! Nothing is checked page by page, as refinement does not either; a place outside the data or at a void has no height. Cost: four records.

use terrasoar::flight::generate::Ground;
use terrasoar_layout::grid::{Grid, GridPoint};
use terrasoar_layout::terrain::{AnyRecords, Terrain};
use terrasoar_layout::with_records;

/// Heights of a terrain.
#[derive(Debug)]
pub(crate) struct MappedGround<'a> {
    records: AnyRecords<'a>,
    grid: Grid,
    height_range_m: [f64; 2],
}

impl<'a> MappedGround<'a> {
    /// None if the terrain's source lends no bytes.
    pub(crate) fn new(terrain: &'a Terrain) -> Option<Self> {
        let height_range_m = terrain.header().height_range_m;
        Some(Self { records: terrain.records()?, grid: *terrain.grid(), height_range_m })
    }

    /// Metres from sample to sample, east and north.
    pub(crate) fn spacing_m(&self) -> [f64; 2] {
        self.grid.spacing_m()
    }

    fn sample_m(&self, x: u32, y: u32) -> Option<f64> {
        let vertex = with_records!(&self.records, records => records.vertex_at(GridPoint::new(x, y)));
        (!vertex.class.is_void()).then_some(vertex.height_m)
    }
}

impl Ground for MappedGround<'_> {
    fn extent_m(&self) -> [f64; 2] {
        self.grid.extent_m()
    }

    fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
        let [dx, dy] = self.grid.spacing_m();
        let (gx, gy) = (east_m / dx, north_m / dy);
        let [last_x, last_y] = self.grid.samples().map(|n| n - 1);
        if !((0.0..=f64::from(last_x)).contains(&gx) && (0.0..=f64::from(last_y)).contains(&gy)) {
            return None;
        }
        // At the last sample the cell before it is as good.
        let (x, y) = ((gx as u32).min(last_x - 1), (gy as u32).min(last_y - 1));
        let (fx, fy) = (gx - f64::from(x), gy - f64::from(y));
        let south = self.sample_m(x, y)? * (1.0 - fx) + self.sample_m(x + 1, y)? * fx;
        let north = self.sample_m(x, y + 1)? * (1.0 - fx) + self.sample_m(x + 1, y + 1)? * fx;
        Some(south * (1.0 - fy) + north * fy)
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.height_range_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::build::{BuildOptions, Silent, build};
    use terrasoar_layout::import;

    #[test]
    fn it_is_the_terrains_own_height() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("puget.iqt");
        let input = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/puget_sound_1025.png");
        let dem = import::open(&[input.into()]).unwrap();
        let options = BuildOptions { spacing_m: Some([160.0; 2]), z_scale: 0.1, ..Default::default() };
        build(&*dem, &path, &options, &Silent).unwrap();
        let terrain = Terrain::open(&path).unwrap();
        let ground = MappedGround::new(&terrain).unwrap();
        let side_m = 1024.0 * 160.0;
        for i in 0..500 {
            let at = [0.618 * f64::from(i) % 1.0, 0.414 * f64::from(i) % 1.0].map(|part| part * side_m);
            let (own, checked) = (ground.height_m(at[0], at[1]), terrain.height_m(at[0], at[1]).unwrap());
            assert!((own.unwrap() - checked.unwrap()).abs() < 1e-6, "{at:?}: {own:?} {checked:?}");
        }
        assert!(ground.height_m(side_m, side_m).is_some());
        assert_eq!(ground.height_m(-1.0, 5.0), None);
        assert_eq!(ground.height_m(5.0, side_m + 1.0), None);
    }
}
