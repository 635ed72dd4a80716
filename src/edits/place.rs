//! The sample on which a stamp comes by its own georeference. A stamp is put on the ground sample on sample, so its samples must lie on the terrain's; if they do not, the way to bring them there is told.

use std::path::Path;
use terrasoar_layout::LayoutError;
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::portable::hypot;

/// Of a step, how far a sample may lie beside one of the terrain's and be taken to lie on it: half-pixel conventions differ by 0.5, rounded coordinates by far less than this.
const BESIDE: f64 = 0.01;

/// Where a terrain's samples lie in its reference system.
#[derive(Debug)]
pub(super) struct Place {
    /// As [`Header::sample_to_crs`]; `None` if it is not known.
    sample_to_crs: Option<[f64; 6]>,
    epsg: Option<u32>,
    /// Name of the reference system; empty if unknown.
    crs_name: String,
}

impl Place {
    pub(super) fn of(header: &Header) -> Self {
        Self { sample_to_crs: header.sample_to_crs, epsg: header.epsg, crs_name: header.crs_name.clone() }
    }

    /// The terrain's sample, columns east and rows north, on which the south-west sample of a stamp of `samples` comes.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] that says why there is none.
    pub(super) fn of_stamp(
        &self,
        path: &Path,
        stamp: &Georeference,
        samples: [u32; 2],
    ) -> Result<[i64; 2], LayoutError> {
        let refused = |why: String| LayoutError::Usage(format!("{}: {why}", path.display()));
        let Some(ground) = self.sample_to_crs else {
            return Err(refused("the terrain has no coordinates that its own could be compared with; say where it goes with `sample COLUMN,ROW`".into()));
        };
        let Some(m) = stamp.pixel_to_crs else {
            return Err(refused(
                "it does not say where it lies; say where it goes with `sample COLUMN,ROW`".into(),
            ));
        };
        if let (Some(theirs), Some(ours)) = (stamp.epsg, self.epsg)
            && theirs != ours
        {
            return Err(refused(format!(
                "it is in EPSG:{theirs} and the terrain in EPSG:{ours}; bring it into the terrain's first: gdalwarp -t_srs EPSG:{ours} {} OUT.tif",
                path.display()
            )));
        }
        // Zones of one kind of map have alike coordinates: a name that differs is another system, unless codes agree. A file without a name says nothing against it.
        let is_named = !stamp.crs_name.is_empty() && !self.crs_name.is_empty();
        if (stamp.epsg.is_none() || self.epsg.is_none()) && is_named && stamp.crs_name != self.crs_name {
            return Err(refused(format!(
                "it is in {}, and the terrain in {}, which may be another system; bring it into the terrain's first (gdalwarp -t_srs), or say where it goes with `sample COLUMN,ROW`",
                stamp.crs_name, self.crs_name
            )));
        }
        let [s0, s1, s2, s3, s4, s5] = ground;
        let determinant = s1 * s5 - s2 * s4;
        // Coordinates as samples of the terrain.
        let way = |x: f64, y: f64| [(x * s5 - y * s2) / determinant, (y * s1 - x * s4) / determinant];
        let last = f64::from(samples[1]) - 1.0;
        let [column, row] = way(m[0] + m[2] * last - s0, m[3] + m[5] * last - s3);
        // Its steps east and north.
        let ([ex, ey], [nx, ny]) = (way(m[1], m[4]), way(-m[2], -m[5]));
        let [wide, high] = samples.map(f64::from);
        let drift = [(ex - 1.0) * wide, ey * wide, nx * high, (ny - 1.0) * high];
        let beside = [column - column.round(), row - row.round()];
        // A not-a-number is nowhere.
        let is_on =
            drift.iter().chain(&beside).all(|by| by.abs() <= BESIDE) && column.abs() < 1e9 && row.abs() < 1e9;
        if is_on {
            return Ok([column.round() as i64, row.round() as i64]);
        }
        let mut why = format!(
            "its samples do not lie on the terrain's: they are {:.4} x {:.4} of the terrain's steps apart, and the south-west one lies at column {column:.3}, row {row:.3}",
            hypot(ex, ey),
            hypot(nx, ny)
        );
        if s2 == 0.0 && s4 == 0.0 && column.is_finite() && row.is_finite() {
            let [west, south] = [column, row].map(|at| at.floor() - 0.5);
            let [east, north] = [column + ex * wide, row + ny * high].map(|at| at.ceil() + 0.5);
            let [x0, y0, x1, y1] = [s0 + west * s1, s3 + south * s5, s0 + east * s1, s3 + north * s5];
            why += &format!(
                "; bring them there: gdalwarp -r bilinear -tr {} {} -te {x0} {y0} {x1} {y1} {} OUT.tif",
                s1.abs(),
                s5.abs(),
                path.display()
            );
        }
        Err(refused(why))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples 30 m apart; the south-west one at 400000, 3300000.
    fn place() -> Place {
        Place {
            sample_to_crs: Some([400_000.0, 30.0, 0.0, 3_300_000.0, 0.0, 30.0]),
            epsg: Some(32644),
            crs_name: "WGS 84 / UTM zone 44N".into(),
        }
    }

    /// A north-up raster of 5 x 4 samples.
    fn raster(west: f64, south: f64, step: f64) -> Georeference {
        let pixel_to_crs = Some([west, step, 0.0, south + 3.0 * step, 0.0, -step]);
        Georeference { epsg: Some(32644), pixel_to_crs, ..Georeference::default() }
    }

    fn at(stamp: &Georeference) -> Result<[i64; 2], String> {
        place().of_stamp(Path::new("dam.tif"), stamp, [5, 4]).map_err(|error| error.to_string())
    }

    #[test]
    fn a_stamp_lies_where_it_says_on_the_terrains_samples() {
        assert_eq!(at(&raster(400_300.0, 3_300_060.0, 30.0)).unwrap(), [10, 2]);
        assert_eq!(at(&raster(399_970.1, 3_299_880.1, 30.0)).unwrap(), [-1, -4]);
        let unnamed = Georeference { epsg: None, ..raster(400_300.0, 3_300_060.0, 30.0) };
        assert_eq!(at(&unnamed).unwrap(), [10, 2]);
        // A turned grid, and a stamp on it: steps of (18, 24) east and (-24, 18) north.
        let turned = Place {
            sample_to_crs: Some([10.0, 18.0, -24.0, 20.0, 24.0, 18.0]),
            epsg: None,
            crs_name: String::new(),
        };
        let north_west = [10.0 + 7.0 * 18.0 - 24.0 * 5.0, 20.0 + 7.0 * 24.0 + 18.0 * 5.0];
        let pixel_to_crs = Some([north_west[0], 18.0, 24.0, north_west[1], 24.0, -18.0]);
        let stamp = Georeference { pixel_to_crs, ..Georeference::default() };
        assert_eq!(turned.of_stamp(Path::new("x"), &stamp, [5, 4]).unwrap(), [7, 2]);
    }

    #[test]
    fn a_stamp_beside_the_terrains_samples_is_refused_with_the_way_there() {
        let half = at(&raster(400_315.0, 3_300_060.0, 30.0)).unwrap_err();
        let way = "gdalwarp -r bilinear -tr 30 30 -te 400285 3300045 400495 3300195 dam.tif OUT.tif";
        assert!(half.contains("column 10.500, row 2.000") && half.contains(way), "{half}");
        let finer = at(&raster(400_300.0, 3_300_060.0, 10.0)).unwrap_err();
        assert!(finer.contains("0.3333 x 0.3333 of the terrain's steps apart"), "{finer}");
        let other = Georeference { epsg: Some(4326), ..raster(81.0, 29.0, 0.1) };
        assert!(at(&other).unwrap_err().contains("gdalwarp -t_srs EPSG:32644 dam.tif"));
        // The same numbers in the zone beside it, which only its name tells.
        let zone = Georeference {
            epsg: None,
            crs_name: "My zone 43".into(),
            ..raster(400_300.0, 3_300_060.0, 30.0)
        };
        let said = at(&zone).unwrap_err();
        assert!(said.contains("My zone 43") && said.contains("UTM zone 44N"), "{said}");
        let nowhere = Georeference { pixel_to_crs: None, ..raster(0.0, 0.0, 1.0) };
        assert!(at(&nowhere).unwrap_err().contains("does not say where it lies"));
        let unplaced = Place { sample_to_crs: None, ..place() };
        let error =
            unplaced.of_stamp(Path::new("x"), &raster(0.0, 0.0, 1.0), [5, 4]).unwrap_err().to_string();
        assert!(error.contains("the terrain has no coordinates"), "{error}");
        for step in [0.0, f64::NAN, 1e300] {
            assert!(at(&raster(0.0, 0.0, step)).is_err());
        }
    }
}
