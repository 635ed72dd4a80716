//! What GDAL keeps beside a file (`.aux.xml`) against what the file says itself: which of both counts depends on the format. Places and numbers are those of gdalinfo 3.6.

mod import_support;

use import_support::{Grid, collect, fixtures, read};
use std::path::{Path, PathBuf};
use terrasoar_import::{OpenOptions, open_image, open_with};

const PLACE: &str = "<GeoTransform>700000, 20, 0, 6100000, 0, -20</GeoTransform><SRS>EPSG:32634</SRS>";
const BAND: &str = "<PAMRasterBand band=\"1\"><NoDataValue>3</NoDataValue><Offset>1000</Offset><Scale>2</Scale><UnitType>cm</UnitType></PAMRasterBand>";

/// Writes both, and reads the file.
fn beside(folder: &Path, name: &str, bytes: &[u8], said: &str) -> Grid {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    std::fs::write(folder.join(format!("{name}.aux.xml")), format!("<PAMDataset>{said}</PAMDataset>"))
        .unwrap();
    read(&[path]).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn height(grid: &Grid, col: u32, row: u32) -> f64 {
    grid.at(col, row) * grid.info.height_scale + grid.info.height_offset_m
}

fn place(grid: &Grid) -> [f64; 6] {
    grid.info.georeference.pixel_to_crs.unwrap()
}

#[test]
fn a_tiff_is_corrected_in_its_place_and_not_in_its_scale() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(fixtures().join("height-scale-offset.tif")).unwrap();
    let own = read(&[fixtures().join("height-scale-offset.tif")]).unwrap();
    assert_ne!(own.info.height_scale, 1.0);
    let found = beside(folder.path(), "a.tif", &bytes, &format!("{PLACE}{BAND}"));
    assert_eq!(place(&found), [700_010.0, 20.0, 0.0, 6_099_990.0, 0.0, -20.0]);
    assert_eq!(found.info.georeference.epsg, Some(32634));
    // The unit, which it leaves open, is told beside it.
    assert!((found.info.height_scale - 0.01 * own.info.height_scale).abs() < 1e-12);
    assert!((found.info.height_offset_m - 0.01 * own.info.height_offset_m).abs() < 1e-9);
}

#[test]
fn a_text_grid_has_its_own_place_and_voids() {
    let folder = tempfile::tempdir().unwrap();
    let text =
        "ncols 3\nnrows 2\nxllcorner 500000\nyllcorner 6000000\ncellsize 10\nNODATA_value 1\n1 2 3\n4 5 6\n";
    let found = beside(folder.path(), "a.asc", text.as_bytes(), &format!("{PLACE}{BAND}"));
    assert_eq!(place(&found), [500_005.0, 10.0, 0.0, 6_000_015.0, 0.0, -10.0]);
    // What it leaves open is told beside it.
    assert_eq!(found.info.georeference.epsg, Some(32634));
    assert!(found.at(0, 0).is_nan());
    assert!((height(&found, 2, 0) - 10.06).abs() < 1e-9, "{}", height(&found, 2, 0));
    let open = text.replace("NODATA_value 1\n", "");
    let found = beside(folder.path(), "b.asc", open.as_bytes(), BAND);
    assert!(found.at(2, 0).is_nan() && !found.at(0, 0).is_nan());
}

/// A grid of Surfer begins in the south. A place beside it is that of the rows as GDAL has them, from the north.
#[test]
fn a_place_beside_a_surfer_grid_does_not_turn_it_upside_down() {
    let folder = tempfile::tempdir().unwrap();
    let text = "DSAA\n3 2\n0 20\n0 10\n1 6\n1 2 3\n4 5 6\n";
    let found = beside(folder.path(), "a.grd", text.as_bytes(), PLACE);
    let [x, dx, _, y, _, dy] = place(&found);
    assert_eq!([x, dx], [700_010.0, 20.0]);
    // By gdallocationinfo: 4 at 700010 6099990, and 1 south of it.
    let at = |north: f64| height(&found, 0, ((north - y) / dy).round() as u32);
    assert_eq!([at(6_099_990.0), at(6_099_970.0)], [4.0, 1.0]);
}

/// GDAL does not look beside a virtual raster.
#[test]
fn a_virtual_raster_says_all_itself() {
    let folder = tempfile::tempdir().unwrap();
    let data = fixtures().join("int16-strips.tif");
    let own = read(std::slice::from_ref(&data)).unwrap();
    let [x, dx, _, y, _, dy] = place(&own);
    let (wide, high) = (own.info.samples_wide, own.info.samples_high);
    let text = format!(
        "<VRTDataset rasterXSize=\"{wide}\" rasterYSize=\"{high}\"><GeoTransform>{},{dx},0,{},0,{dy}</GeoTransform><VRTRasterBand dataType=\"Int16\" band=\"1\">\
         <SimpleSource><SourceFilename>{}</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>",
        x - 0.5 * dx,
        y - 0.5 * dy,
        data.display()
    );
    let found = beside(folder.path(), "a.vrt", text.as_bytes(), &format!("{PLACE}{BAND}"));
    assert_eq!(place(&found), place(&own));
    assert_eq!([found.info.height_scale, found.info.height_offset_m], [1.0, 0.0]);
}

/// A world file counts first beside a PNG, and GDAL's own file beside other pictures.
#[test]
fn world_files_count_before_it_beside_a_png_alone() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |name: &str, bytes: &[u8]| -> f64 {
        let path: PathBuf = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        std::fs::write(path.with_extension("wld"), "10\n0\n0\n-10\n500005\n5999995\n").unwrap();
        std::fs::write(
            folder.path().join(format!("{name}.aux.xml")),
            format!("<PAMDataset>{PLACE}</PAMDataset>"),
        )
        .unwrap();
        open_image(&path).unwrap().info().georeference.pixel_to_crs.unwrap()[0]
    };
    let images = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/image_fixtures");
    let first = |ending: &str| {
        let mut all: Vec<PathBuf> =
            std::fs::read_dir(&images).unwrap().map(|entry| entry.unwrap().path()).collect();
        all.sort();
        let found = all.into_iter().find(|path| path.extension().is_some_and(|found| found == ending));
        std::fs::read(found.unwrap_or_else(|| panic!("no {ending}"))).unwrap()
    };
    let png = std::fs::read(import_support::data("puget_sound_1025.png")).unwrap();
    assert_eq!(picture("a.png", &png), 500_005.0);
    assert_eq!(picture("b.jpg", &first("jpg")), 700_010.0);
}

/// Options say so too.
#[test]
fn what_is_stated_counts_before_both() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.asc");
    std::fs::write(&path, "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 10\n1 2\n3 4\n").unwrap();
    std::fs::write(folder.path().join("a.asc.aux.xml"), format!("<PAMDataset>{PLACE}{BAND}</PAMDataset>"))
        .unwrap();
    let options = OpenOptions { crs: Some("EPSG:32633".into()), ..OpenOptions::default() };
    let found = collect(&*open_with(&[path], &options).unwrap()).unwrap();
    assert_eq!(found.info.georeference.epsg, Some(32633));
}
