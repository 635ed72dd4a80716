//! Small files at the ends of the largest grid there is: what lies between them is passed over in few windows, and each sample is there once.

use crate::ground::{at, inside};
use std::path::PathBuf;
use std::sync::Mutex;
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// Samples a side.
const SIDE: u32 = 1_048_577;
const STEP_M: f64 = 0.25;
const WEST_M: f64 = 400_000.0;
const SOUTH_M: f64 = 5_000_000.0;

#[derive(Default)]
struct Counting(Mutex<Counts>);

#[derive(Default)]
struct Counts {
    windows: u64,
    samples: u64,
    heights: u64,
}

impl SampleSink for Counting {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let mut counts = self.0.lock().unwrap();
        counts.windows += 1;
        counts.samples += samples.len() as u64;
        assert_eq!(samples.len(), window.width as usize * window.height as usize);
        counts.heights += samples.iter().map(|v| u64::from(!v.is_nan())).sum::<u64>();
        Ok(())
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        let mut counts = self.0.lock().unwrap();
        counts.windows += 1;
        counts.samples += u64::from(window.width) * u64::from(window.height);
        Ok(())
    }
}

/// Streams a mosaic and builds a terrain of it; heights at places, in samples from the south-west one.
fn check(files: &[PathBuf], heights: u64, places: &[([u32; 2], Option<f64>)]) {
    let folder = tempdir().unwrap();
    let options = OpenOptions { scratch: Some(folder.path().to_owned()), ..OpenOptions::default() };
    let dem = open_with(files, &options).unwrap();
    assert_eq!([dem.info().samples_wide, dem.info().samples_high], [SIDE; 2]);
    let counting = Counting::default();
    dem.stream(&counting).unwrap();
    let counts = counting.0.into_inner().unwrap();
    assert_eq!(counts.samples, u64::from(SIDE) * u64::from(SIDE));
    assert!(counts.heights >= heights && counts.windows < 5000, "{} {}", counts.heights, counts.windows);
    let path = folder.path().join("vast.iqt");
    build(&*dem, &path, &BuildOptions::default(), &Silent).unwrap();
    let terrain = Terrain::open(&path).unwrap();
    let spacing_m = terrain.grid().spacing_m();
    for ([x, y], height_m) in places {
        let [east_m, north_m] = [f64::from(*x) * spacing_m[0], f64::from(*y) * spacing_m[1]];
        assert_eq!(terrain.height_m(east_m, north_m).unwrap(), *height_m, "{x}, {y}");
    }
}

#[test]
fn what_lies_between_files_far_apart_is_passed_over() {
    let folder = tempdir().unwrap();
    let last = f64::from(SIDE - 100) * STEP_M;
    let height =
        |x: f64, y: f64| ((x - WEST_M) / STEP_M).floor() % 1000.0 + ((y - SOUTH_M) / STEP_M).floor() % 500.0;
    let corner = |name: &str, west: f64, south: f64| {
        let patch = at(WEST_M + west, SOUTH_M + south + 100.0 * STEP_M, STEP_M);
        patch.write(inside(folder.path(), name), "EPSG:32632", height)
    };
    let mut files = vec![corner("a.asc", 0.0, 0.0), corner("b.asc", last, last)];
    let of = |x: u32, y: u32| Some(f64::from(x % 1000 + y % 500));
    let end = SIDE - 1;
    let mut places = vec![
        ([0, 0], of(0, 0)),
        ([99, 98], of(99, 98)),
        ([100, 99], None),
        ([end, end], of(end, end)),
        ([end - 99, end - 3], of(end - 99, end - 3)),
        ([end - 100, end], None),
        ([700_000, 300_000], None),
    ];
    check(&files, 20_000, &places);

    // The same as a virtual raster.
    let vrt = folder.path().join("vast.vrt");
    let source = |name: &str, x: u32, y: u32| {
        format!(
            "<SimpleSource><SourceFilename relativeToVRT=\"1\">{name}</SourceFilename><SourceBand>1</SourceBand>\
             <SrcRect xOff=\"0\" yOff=\"0\" xSize=\"100\" ySize=\"100\"/><DstRect xOff=\"{x}\" yOff=\"{y}\" xSize=\"100\" ySize=\"100\"/></SimpleSource>"
        )
    };
    let text = format!(
        "<VRTDataset rasterXSize=\"{SIDE}\" rasterYSize=\"{SIDE}\"><SRS>EPSG:32632</SRS><GeoTransform>{WEST_M}, {STEP_M}, 0, {}, 0, -{STEP_M}</GeoTransform>\
         <VRTRasterBand dataType=\"Int16\" band=\"1\"><NoDataValue>-9999</NoDataValue>{}{}</VRTRasterBand></VRTDataset>",
        SOUTH_M + f64::from(SIDE) * STEP_M,
        source("a.asc", 0, SIDE - 100),
        source("b.asc", SIDE - 100, 0)
    );
    std::fs::write(&vrt, text).unwrap();
    check(&[vrt], 20_000, &places);

    // And a third, in degrees, which is brought over.
    files.push(at(9.0, 46.0, 1e-5).write(inside(folder.path(), "c.asc"), "EPSG:4326", |_, _| 77.0));
    // 9 degrees east is the zone's middle, 500 km; along it 45.9995 degrees north lie 5,093,992 m from the equator.
    let degrees = [(500_038.0 - WEST_M) / STEP_M, (5_093_992.0 - SOUTH_M) / STEP_M];
    places.push((degrees.map(|v| v as u32), Some(77.0)));
    check(&files, 20_000 + 10_000, &places);
}
