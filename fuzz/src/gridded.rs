//! Elevation data in containers and records of their own: netCDF, GRIB, OpenEXR, DTED, USGS DEM, and TIFF stored in rarer ways.

use crate::import::read;
use crate::seeds::{self, Inputs};
use terrasoar_import::OpenOptions;

/// Fixtures whose names end so.
fn fixtures(extension: &str) -> Inputs {
    seeds::folder("import/tests/format_fixtures", &[extension])
}

/// NetCDF, classic and over HDF5.
pub(crate) mod netcdf {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        fixtures("nc")
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.nc", data)], &OpenOptions::default());
        // Layers and variables beside the first.
        let second = OpenOptions { band: Some("2".into()), ..OpenOptions::default() };
        read(&[("dem.nc", data)], &second);
    }
}

/// OpenEXR pictures.
pub(crate) mod openexr {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        fixtures("exr")
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.exr", data)], &OpenOptions::default());
        // Others than the only one.
        let last = OpenOptions { band: Some("terrain.Z".into()), ..OpenOptions::default() };
        read(&[("dem.exr", data)], &last);
    }
}

/// GRIB of edition 2.
pub(crate) mod grib {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let all = seeds::folder("import/tests/grib_fixtures", &["grib2", "grib"]);
        // One of each packing, map and choice; orders of samples are a byte.
        all.into_iter().filter(|(name, bytes)| !name.contains("order-") && bytes.len() < 1500).collect()
    }

    pub(crate) fn body(data: &[u8]) {
        let little = OpenOptions { memory_mib: Some(64), ..OpenOptions::default() };
        read(&[("dem.grib2", data)], &little);
        // Fields beside the first.
        read(&[("dem.grib2", data)], &OpenOptions { band: Some("2".into()), ..little });
    }
}

/// DTED cells.
pub(crate) mod dted {
    use super::*;

    /// A cell of `columns` by `rows` behind `labels`, without the lines told.
    fn cell(columns: u16, rows: u16, labels: usize, left_out: &[u16]) -> Vec<u8> {
        let mut bytes: Vec<u8> = [b"VOL1", b"HDR1"]
            .iter()
            .take(labels)
            .flat_map(|label| [&label[..], &[b' '; 76]].concat())
            .collect();
        let head = format!("UHL10063000W0503000N00300010NA  U  {:12}{columns:04}{rows:04}0", "");
        bytes.extend(format!("{head:<80}").bytes());
        bytes.extend([b' '; 648 + 2700]);
        for column in (0..columns).filter(|column| !left_out.contains(column)) {
            let mut record = vec![0xaa, 0, 0, 0];
            record.extend(column.to_be_bytes());
            record.extend([0, 0]);
            record.extend((0..rows).flat_map(|row| ((column * 3 + row) | ((row % 5) << 15)).to_be_bytes()));
            let sum: u32 = record.iter().map(|byte| u32::from(*byte)).sum();
            record.extend(sum.to_be_bytes());
            bytes.extend(record);
        }
        bytes
    }

    pub(crate) fn seeds() -> Inputs {
        let cells = [
            ("plain", cell(20, 15, 0, &[])),
            ("labels", cell(4, 3, 2, &[])),
            ("lines left out", cell(20, 15, 0, &[3, 9])),
            ("tall", cell(3, 60, 1, &[])),
        ];
        cells.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect()
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.dt1", data)], &OpenOptions::default());
    }
}

/// USGS DEM sheets.
pub(crate) mod usgs_dem {
    use super::*;

    /// A sheet of `columns` by `rows` whose A record is of `head` bytes.
    fn sheet(columns: usize, rows: usize, head: usize, system: usize) -> Vec<u8> {
        let mut record = vec![b' '; head];
        let mut put = |from: usize, length: usize, text: String| {
            record[from..from + length].copy_from_slice(format!("{text:>length$}").as_bytes());
        };
        for (from, value) in [
            (144, 3),
            (150, 1),
            (156, system),
            (162, 10),
            (528, 2),
            (534, 1),
            (540, 4),
            (852, 1),
            (858, columns),
        ] {
            put(from, 6, value.to_string());
        }
        for (at, (x, y)) in [(0, 0), (0, 1), (1, 1), (1, 0)].into_iter().enumerate() {
            put(546 + 48 * at, 24, format!("{}.0D+00", 560_000 + 30 * (columns - 1) * x));
            put(570 + 48 * at, 24, format!("{}.0D+00", 4_750_020 + 30 * (rows - 1) * y));
        }
        for (from, text) in [(816, "3.0E+01"), (828, "3.0E+01"), (840, "1.0E+00")] {
            put(from, 12, text.into());
        }
        for column in 0..columns {
            let places = [
                format!("{}.0D+00", 560_000 + 30 * column),
                "4750020.0D+00".into(),
                "0.0D+00".into(),
                "0.0D+00".into(),
                "9.0D+02".into(),
            ];
            let places: String = places.iter().map(|place| format!("{place:>24}")).collect();
            let heights: String = (0..rows)
                .map(|row| format!("{:6}", if row == 3 { -32767 } else { (100 + column + row) as i32 }))
                .collect();
            record.extend(format!("{:6}{:6}{rows:6}{:6}{places}{heights}\n", 1, column + 1, 1).bytes());
        }
        record
    }

    pub(crate) fn seeds() -> Inputs {
        let sheets = [
            ("new", sheet(9, 7, 1024, 1)),
            ("old", sheet(5, 5, 864, 1)),
            ("undocumented", sheet(4, 12, 893, 2)),
            ("degrees", sheet(6, 6, 1024, 0)),
        ];
        sheets.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect()
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.dem", data)], &OpenOptions::default());
    }
}
