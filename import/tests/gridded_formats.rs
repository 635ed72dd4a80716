//! NetCDF, DTED, USGS DEM, Surfer and OpenEXR against arithmetic: the files of `data-scripts/make-netcdf-fixtures.py`, and such made here.

#[path = "import_support/cdf.rs"]
mod cdf;
#[path = "gridded/exr.rs"]
mod exr;
mod import_support;
#[path = "gridded/netcdf_words.rs"]
mod netcdf_words;

use import_support::{Grid, collect};
use std::path::{Path, PathBuf};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/format_fixtures").join(name)
}

fn with(path: &Path, options: &OpenOptions) -> Result<Grid, LayoutError> {
    collect(&*open_with(&[path.to_owned()], options)?)
}

fn opened(name: &str) -> Grid {
    with(&fixture(name), &OpenOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn band(word: &str) -> OpenOptions {
    OpenOptions { band: Some(word.into()), ..OpenOptions::default() }
}

fn refused(path: &Path, options: &OpenOptions) -> String {
    with(path, options)
        .err()
        .map(|error| error.to_string())
        .unwrap_or_else(|| panic!("{} was read", path.display()))
}

/// The height in metres at a place, whichever way the rows run.
fn at(grid: &Grid, x: f64, y: f64) -> f64 {
    let [x0, a, b, y0, d, e] = grid.info.georeference.pixel_to_crs.expect("a place");
    assert_eq!([b, d], [0.0; 2]);
    let (col, row) = ((x - x0) / a, (y - y0) / e);
    assert!(
        (col - col.round()).abs() < 1e-6 && (row - row.round()).abs() < 1e-6,
        "{x}, {y} is no sample: {col}, {row}"
    );
    grid.at(col.round() as u32, row.round() as u32) * grid.info.height_scale + grid.info.height_offset_m
}

const WIDE: u32 = 9;
const HIGH: u32 = 7;

/// Checks every sample of a fixture: half a degree apart from `west` and 40 north on, with `height` of the usual one.
fn is_usual(name: &str, grid: &Grid, west: f64, height: impl Fn(f64) -> f64) {
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [WIDE, HIGH], "{name}");
    for (col, row) in (0..WIDE).flat_map(|col| (0..HIGH).map(move |row| (col, row))) {
        let wanted = height(f64::from(100 + 3 * col + 7 * row));
        let found = at(grid, west + 0.5 * f64::from(col), 40.0 + 0.5 * f64::from(row));
        let is_near = (found - wanted).abs() <= 1e-9 * wanted.abs().max(1.0);
        assert!(
            is_near || (found.is_nan() && wanted.is_nan()),
            "{name}: {found} at {col}, {row}, and not {wanted}"
        );
    }
}

#[test]
fn netcdf_of_every_kind() {
    for name in [
        "classic",
        "offset-64",
        "cdf-5",
        "nc4",
        "nc4-classic",
        "falling-latitude",
        "packed",
        "chunks",
        "columns-first",
        "groups",
    ] {
        is_usual(name, &opened(&format!("{name}.nc")), 10.0, |height| height);
    }
    for name in ["gmt", "gmt-area", "gmt-old", "gmt-old-area"] {
        is_usual(name, &opened(&format!("{name}.nc")), 10.0, |height| height);
    }
    is_usual("era5", &opened("era5.nc"), 10.0, |height| height);
    is_usual("feet", &opened("feet.nc"), 10.0, |height| height * 0.3048);
    is_usual("depth", &opened("depth.nc"), 10.0, |height| height);
    is_usual("east-of-180", &opened("east-of-180.nc"), 350.0, |height| height);
    is_usual("unsigned", &opened("unsigned.nc"), 10.0, |height| height + 40000.0);
    let void = |value: f64| if value == 127.0 || value == 100.0 { f64::NAN } else { value };
    // The value stands at two samples, the text of one of which was replaced.
    let fill = opened("fill.nc");
    assert_eq!(fill.voids(), 2);
    assert!(at(&fill, 10.0, 40.0).is_nan() && void(100.0).is_nan());
    assert_eq!(opened("default-fill.nc").voids(), 1);
}

#[test]
fn netcdf_of_every_type() {
    let types = [
        ("byte", SampleType::I8),
        ("ubyte", SampleType::U8),
        ("ushort", SampleType::U16),
        ("int", SampleType::I32),
        ("uint", SampleType::U32),
        ("int64", SampleType::I64),
        ("uint64", SampleType::U64),
        ("float", SampleType::F32),
        ("double", SampleType::F64),
    ];
    for (name, sample_type) in types {
        let grid = opened(&format!("type-{name}.nc"));
        assert_eq!(grid.info.sample_type, sample_type, "{name}");
        is_usual(name, &grid, 10.0, |height| if name == "byte" { height - 120.0 } else { height });
    }
}

#[test]
fn netcdf_of_several_grids_and_layers_asks() {
    let layers = fixture("layers.nc");
    let said = refused(&layers, &OpenOptions::default());
    assert!(said.contains("2 layers, z:1 to z:2"), "{said}");
    is_usual("layers", &with(&layers, &band("z:1")).unwrap(), 10.0, |height| height);
    is_usual("layers", &with(&layers, &band("2")).unwrap(), 10.0, |height| 2.0 * height);
    for word in ["z:3", "z:0", "z", "0", "3", "y", "z:", ":1", ""] {
        let said = refused(&layers, &band(word));
        assert!(said.contains("there is z:1 to z:2"), "{said}");
    }
    let grids = fixture("two-grids.nc");
    let said = refused(&grids, &OpenOptions::default());
    assert!(said.contains("first, second"), "{said}");
    is_usual("first", &with(&grids, &band("1")).unwrap(), 10.0, |height| height);
    is_usual("second", &with(&grids, &band("Second")).unwrap(), 10.0, |height| height + 1000.0);
    is_usual("groups", &with(&fixture("groups.nc"), &band("data/elevation")).unwrap(), 10.0, |height| height);
}

#[test]
fn netcdf_in_kilometres_lies_in_metres() {
    let grid = opened("kilometres.nc");
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    assert_eq!([map[0], map[1], map[5].abs()], [-100_000.0, 500.0, 500.0]);
    assert_eq!(at(&grid, -100_000.0 + 500.0, -2_000_000.0 + 2.0 * 500.0), 117.0);
}

#[test]
fn what_cannot_be_flown_over_is_said() {
    let said = refused(&fixture("uneven.nc"), &OpenOptions::default());
    assert!(said.contains("\"lat\" are not evenly apart: number 3 is 41.7, and 41.5 would be"), "{said}");
    let said = refused(&fixture("curvilinear.nc"), &OpenOptions::default());
    assert!(said.contains("listed one by one") && said.contains("gdalwarp -geoloc"), "{said}");
}

#[test]
fn netcdf_cut_short_or_changed_ends_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nc");
    for name in ["classic.nc", "cdf-5.nc", "gmt-old.nc", "nc4.nc", "chunks.nc", "layers.nc"] {
        let bytes = std::fs::read(fixture(name)).unwrap();
        let step = (bytes.len() / 80).max(1);
        let mut refusals = 0;
        for at in (0..bytes.len()).step_by(step) {
            for is_cut in [true, false] {
                let mut bytes = bytes.clone();
                if is_cut {
                    bytes.truncate(at);
                } else {
                    bytes[at] ^= 0xff;
                }
                std::fs::write(&path, &bytes).unwrap();
                if let Err(error) = with(&path, &OpenOptions::default()) {
                    let said = error.to_string();
                    assert!(
                        said.len() > 30 && said.len() < 700 && !said.contains(".rs"),
                        "{name}, {at}: {said}"
                    );
                    refusals += 1;
                }
            }
        }
        assert!(refusals > 50, "{name}: {refusals}");
    }
}

#[test]
fn dted_with_voids_and_negative_heights() {
    let grid = opened("s33w007.dt0");
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [121, 121]);
    assert_eq!((grid.info.georeference.epsg, grid.info.format.as_str()), (Some(4326), "DTED level 0"));
    for (col, row) in [(0, 0), (120, 0), (0, 120), (120, 120), (17, 3), (3, 90)] {
        let void = (col + row) % 11 == 5;
        let found = at(&grid, -7.0 + f64::from(col) / 120.0, -33.0 + f64::from(row) / 120.0);
        assert!(
            if void { found.is_nan() } else { found == f64::from(3 * col - 7 * row) },
            "{found} at {col}, {row}"
        );
    }
}

/// A cell of `columns` by `rows`, three arc-seconds by one apart, whose lines are kept where told.
fn cell(columns: u16, rows: u16, is_there: impl Fn(u16) -> bool, labels: usize, is_summed: bool) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        (0..labels).flat_map(|label| format!("{:<80}", ["VOL1", "HDR1"][label % 2]).into_bytes()).collect();
    let head = format!("UHL10063000W0503000N00300010NA  U  {:12}{columns:04}{rows:04}0", "");
    bytes.extend(format!("{head:<80}").bytes());
    bytes.extend([b' '; 648 + 2700]);
    for column in (0..columns).filter(|column| is_there(*column)) {
        let mut record = vec![0xaa, 0, 0, 0];
        record.extend(column.to_be_bytes());
        record.extend([0, 0]);
        for row in 0..rows {
            let height = 3 * i32::from(column) - 7 * i32::from(row);
            let word = height.unsigned_abs() as u16 | if height < 0 { 0x8000 } else { 0 };
            record.extend(word.to_be_bytes());
        }
        let sum: u32 = record.iter().map(|byte| u32::from(*byte)).sum();
        record.extend((if is_summed { sum } else { 0 }).to_be_bytes());
        bytes.extend(record);
    }
    bytes
}

#[test]
fn dted_with_labels_missing_lines_and_wrong_sums() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.dt1");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        with(&path, &OpenOptions::default())
    };
    for labels in 0..3 {
        let grid = read(&cell(30, 20, |_| true, labels, true)).unwrap();
        let west = -(6.0 + 30.0 / 60.0);
        assert_eq!(
            at(&grid, west + 29.0 * 30.0 / 36_000.0, 50.5 + 19.0 * 10.0 / 36_000.0),
            f64::from(3 * 29 - 7 * 19)
        );
    }
    let grid = read(&cell(30, 20, |column| column != 4 && column != 17, 0, true)).unwrap();
    assert_eq!(grid.voids(), 40);
    let mut bytes = cell(30, 20, |_| true, 0, true);
    let last = bytes.len() - 6;
    bytes[last] ^= 1;
    assert!(read(&bytes).err().unwrap().to_string().contains("line of longitude 29: its checksum is wrong"));
    assert_eq!(read(&cell(30, 20, |_| true, 0, false)).unwrap().voids(), 0);
    for cut in [10, 100, 3427, 3428, 3500, bytes.len() - 1, bytes.len() - 52] {
        let said = read(&bytes[..cut]).err().unwrap().to_string();
        assert!(said.contains("fetch it again"), "{cut}: {said}");
    }
}

#[test]
fn usgs_sheets() {
    for (name, scale) in [("utm.dem", 1.0), ("utm-tenths.dem", 0.1)] {
        let grid = opened(name);
        assert_eq!([grid.info.samples_wide, grid.info.samples_high], [40, 30], "{name}");
        assert_eq!((grid.info.georeference.epsg, grid.info.height_scale), (Some(26710), scale), "{name}");
        for (col, row) in [(0, 0), (39, 0), (0, 29), (39, 29), (17, 3), (3, 21)] {
            let void = (col + row) % 11 == 5;
            let found = at(&grid, 560_000.0 + 30.0 * f64::from(col), 4_750_000.0 + 30.0 * f64::from(row));
            // GDAL writes whole heights as they are, whatever it says of their resolution.
            let wanted = scale * f64::from(3 * col - 7 * row);
            assert!(
                if void { found.is_nan() } else { (found - wanted).abs() < 1e-9 },
                "{name}: {found} at {col}, {row}"
            );
        }
    }
}

/// A sheet with an A record of 864 bytes, in feet and degrees, whose profiles begin at several heights.
fn old_sheet() -> Vec<u8> {
    let mut head = vec![b' '; 864];
    let mut put = |from: usize, length: usize, text: &str| {
        head[from..from + length].copy_from_slice(format!("{text:>length$}").as_bytes())
    };
    put(144, 6, "3");
    put(150, 6, "1");
    put(156, 6, "0");
    put(162, 6, "0");
    put(528, 6, "3");
    put(534, 6, "1");
    put(540, 6, "4");
    let corners = [(-432_000, 144_000), (-432_000, 144_012), (-431_988, 144_012), (-431_988, 144_000)];
    for (at, (x, y)) in corners.iter().enumerate() {
        put(546 + 48 * at, 24, &format!("{:.1}D+00", *x as f64));
        put(570 + 48 * at, 24, &format!("{:.1}D+00", *y as f64));
    }
    for (from, text) in [(816, "0.3000E+01"), (828, "0.3000E+01"), (840, "0.1000E+01")] {
        put(from, 12, text);
    }
    put(852, 6, "1");
    put(858, 6, "5");
    for column in 0..5 {
        let (first, count) = if column == 2 { (1, 3) } else { (0, 5) };
        let mut record = format!(
            "{:6}{:6}{count:6}{:6}{:24}{:24}{:24}{:24}{:24}",
            1,
            column + 1,
            1,
            format!("{}.0D+00", -432_000 + 3 * column),
            format!("{}.0D+00", 144_000 + 3 * first),
            "0.0D+00",
            "0.0D+00",
            "0.9D+03"
        );
        for row in first..first + count {
            record +=
                &format!("{:6}", if (column, row) == (4, 4) { -32767 } else { 1000 + 10 * column + row });
        }
        head.extend(format!("{record:<1024}").bytes());
    }
    head
}

#[test]
fn an_old_sheet_in_feet_and_arc_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.dem");
    std::fs::write(&path, old_sheet()).unwrap();
    let grid = with(&path, &OpenOptions::default()).unwrap();
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [5, 5]);
    assert_eq!((grid.info.georeference.epsg, grid.info.height_scale), (Some(4267), 0.3048));
    assert_eq!(grid.voids(), 3);
    for (col, row) in [(0, 0), (4, 0), (2, 1), (2, 3), (3, 4)] {
        let found = at(&grid, -120.0 + f64::from(col) / 1200.0, 40.0 + f64::from(row) / 1200.0);
        assert!((found - 0.3048 * f64::from(1000 + 10 * col + row)).abs() < 1e-9, "{found} at {col}, {row}");
    }
    for cut in [100, 200, 600, 863, 900, 1500, 5000] {
        std::fs::write(&path, &old_sheet()[..cut]).unwrap();
        let said = refused(&path, &OpenOptions::default());
        assert!(said.len() < 500, "{said}");
    }
    // A profile of a million heights, a sheet of a million profiles.
    let mut bytes = old_sheet();
    bytes[858..864].copy_from_slice(b"999999");
    std::fs::write(&path, &bytes).unwrap();
    assert!(refused(&path, &OpenOptions::default()).contains("do not go with a file"));
}

/// Surfer grids of 3 x 2 samples in three kinds, of which one is blank and one of the value that a file beside it declares.
#[test]
fn blanks_of_surfer_grids_are_voids_beside_a_declared_nodata() {
    let heights = [1.0f64, 2.0, -9999.0, 4.0, 1.70141e38, 6.0];
    let reals = |numbers: &[f64]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let sides = reals(&[0.0, 2.0, 0.0, 1.0, 1.0, 6.0]);
    let singles: Vec<u8> = heights.iter().flat_map(|height| (*height as f32).to_le_bytes()).collect();
    let binary_7 = |blank: f64| {
        let heights = heights.map(|height| if height > 1e38 { blank } else { height });
        let content = [&[2, 0, 0, 0, 3, 0, 0, 0][..], &reals(&[0.0, 0.0, 1.0, 1.0, 1.0, 6.0, 0.0, blank])];
        let data = [&b"DATA"[..], &48i32.to_le_bytes(), &reals(&heights)].concat();
        [&b"DSRB\x04\0\0\0\x01\0\0\0GRID\x48\0\0\0"[..], &content.concat(), &data].concat()
    };
    let text = heights.map(|height| format!("{height:e}")).join(" ");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.grd");
    let aux =
        "<PAMDataset><PAMRasterBand band=\"1\"><NoDataValue>-9999</NoDataValue></PAMRasterBand></PAMDataset>";
    for bytes in [
        format!("DSAA 3 2 0 2 0 1 1 6 {text}").into_bytes(),
        [&b"DSBB\x03\0\x02\0"[..], &sides, &singles].concat(),
        binary_7(1.70141e38),
        binary_7(-32_767.0),
    ] {
        std::fs::write(&path, bytes).unwrap();
        for (is_beside, nodata) in [(true, vec![]), (false, vec!["-9999".to_owned()]), (false, vec![])] {
            let aux_path = folder.path().join("a.grd.aux.xml");
            let _ = std::fs::remove_file(&aux_path);
            if is_beside {
                std::fs::write(&aux_path, aux).unwrap();
            }
            let is_told = is_beside || !nodata.is_empty();
            let options = OpenOptions { nodata, ..OpenOptions::default() };
            let grid = with(&path, &options).unwrap();
            for (number, height) in heights.iter().enumerate() {
                let found = at(&grid, (number % 3) as f64, (number / 3) as f64);
                let is_void = *height > 1e38 || (is_told && *height == -9999.0);
                assert!(if is_void { found.is_nan() } else { found == *height }, "{number}: {found}");
            }
        }
    }
}
