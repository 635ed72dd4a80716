//! Warps of functions of the place, which every kernel brings back nearly.

use super::*;
use crate::crs::by_text;
use std::sync::Mutex;

/// What was put, with how often.
struct Kept(Mutex<(Vec<f64>, Vec<u32>)>, u32);

impl SampleSink for Kept {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let mut kept = self.0.lock().unwrap();
        for (line, values) in samples.chunks_exact(window.width as usize).enumerate() {
            for (col, value) in values.iter().enumerate() {
                let at = (window.row as usize + line) * self.1 as usize + window.col as usize + col;
                kept.0[at] = *value;
                kept.1[at] += 1;
            }
        }
        Ok(())
    }
}

fn warped(
    system: &str,
    map: [f64; 6],
    samples: [u32; 2],
    across: bool,
    options: &OpenOptions,
    height: impl Fn(f64, f64) -> f64,
) -> (Warp, Vec<f64>) {
    let system = by_text(system).unwrap();
    let warp = Warp::plan(Path::new("a"), &system, Some(map), samples, SampleType::F64, across, options);
    let warp = warp.unwrap().unwrap();
    let count = warp.samples()[0] as usize * warp.samples()[1] as usize;
    let kept = Kept(Mutex::new((vec![f64::NAN; count], vec![0; count])), warp.samples()[0]);
    let old = |sink: &dyn SampleSink| {
        (0..samples[1]).try_for_each(|row| {
            let values: Vec<f64> = (0..samples[0])
                .map(|col| apply(&map, [f64::from(col), f64::from(row)]))
                .map(|[x, y]| height(x, y))
                .collect();
            sink.put(Window { col: 0, row, width: samples[0], height: 1 }, &values)
        })
    };
    warp.stream(&old, &kept).unwrap();
    let (values, times) = kept.0.into_inner().unwrap();
    assert!(times.iter().all(|count| *count == 1));
    (warp, values)
}

#[test]
fn turned_grids_come_north_up() {
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let map = [500_000.0, 10.0 * cos, 10.0 * sin, 5_000_000.0, 10.0 * sin, -10.0 * cos];
    let plane = |x: f64, y: f64| 100.0 + 0.3 * (x - 500_000.0) + 0.7 * (y - 5_000_000.0);
    for (memory_mib, kernel) in
        [(None, Resampling::Bilinear), (Some(0), Resampling::Cubic), (None, Resampling::Lanczos)]
    {
        let options = OpenOptions { memory_mib, resampling: Some(kernel), ..OpenOptions::default() };
        let (warp, values) = warped("EPSG:32632", map, [81, 61], true, &options, plane);
        let wide = warp.samples()[0] as usize;
        let mut seen = 0;
        for (i, value) in values.iter().enumerate().filter(|(_, value)| !value.is_nan()) {
            let [x, y] = apply(&warp.map(), [(i % wide) as f64, (i / wide) as f64]);
            // At the rim a kernel lacks samples on one side.
            let off = (value - plane(x, y)).abs();
            assert!(off < 10.0, "{kernel:?} at {x}, {y}: {off}");
            // Lanczos' weights are near those of a plane, no more.
            seen += u32::from(off < if kernel == Resampling::Lanczos { 0.5 } else { 0.05 });
        }
        // As many as before, and nearly all of them right: the area is the same.
        assert!(seen > 4000, "{kernel:?}: {seen} of {}", 81 * 61);
    }
}

#[test]
fn degrees_become_metres_and_the_seam_of_the_globe_closes() {
    let wave = |lon: f64, lat: f64| 1000.0 + 100.0 * (lon.to_radians().cos() + lat.to_radians().sin());
    let options = OpenOptions {
        reproject: Some("EPSG:3413".into()),
        resolution: Some(100_000.0),
        ..OpenOptions::default()
    };
    // 0 to 360 degrees: the projection gives longitudes from -180 to 180.
    let (warp, values) =
        warped("EPSG:4326", [0.5, 1.0, 0.0, 89.5, 0.0, -1.0], [360, 40], false, &options, wave);
    let polar = Ground::new(&by_text("EPSG:3413").unwrap()).unwrap();
    let wide = warp.samples()[0] as usize;
    let mut seen = 0;
    for (i, value) in values.iter().enumerate() {
        let [lon, lat] = polar
            .world(apply(&warp.map(), [(i % wide) as f64, (i / wide) as f64]))
            .unwrap()
            .map(f64::to_degrees);
        if (51.0..89.4).contains(&lat) {
            assert!((value - wave(lon, lat)).abs() < 0.2, "{lon} {lat}: {value} {}", wave(lon, lat));
            seen += 1;
        }
    }
    assert!(seen > 3000, "{seen}");
}

/// Of a globe with a few samples here and there, its seam among them, every window that one reaches may hold something, and most of the others are known to hold nothing.
#[test]
fn windows_around_the_globe_hold_what_reaches_them() {
    use crate::cells::Cells;
    const OLD: [u32; 2] = [3600, 1800];
    const SIDE: u32 = 16;
    for (system, least) in [("EPSG:3857", 80), ("EPSG:3413", 50)] {
        let options = OpenOptions {
            reproject: Some(system.into()),
            resolution: Some(120_000.0),
            resampling: Some(Resampling::Cubic),
            ..OpenOptions::default()
        };
        let map = [-179.95, 0.1, 0.0, 89.95, 0.0, -0.1];
        let known = by_text("EPSG:4326").unwrap();
        let warp = Warp::plan(Path::new("a"), &known, Some(map), OLD, SampleType::F32, false, &options);
        let warp = warp.unwrap().unwrap();
        let resampler = &warp.resampler;
        assert!(resampler.kernel.wraps);
        let reach = resampler.kernel.reach();
        let [wide, high] = warp.samples().map(|side| side / SIDE);
        let windows = (0..high).flat_map(|row| (0..wide).map(move |col| [col * SIDE, row * SIDE]));
        let windows: Vec<(Window, Vec<[f64; 2]>)> = windows
            .map(|[col, row]| Window { col, row, width: SIDE, height: SIDE })
            .map(|window| (window, resampler.places(window)))
            .collect();
        let spots = [[0, 900], [3599, 300], [3590, 1500], [10, 1200], [1800, 20], [700, 905], [5, 1790]];
        for [x, y] in terrasoar_layout::testing::one_in(2, spots) {
            let mut cells = Cells::of(4);
            cells.add([x, y], [x + 1, y + 1]);
            let is_reached = |place: &[f64; 2]| {
                let apart = (place[0] - f64::from(x)).rem_euclid(f64::from(OLD[0]));
                apart.min(f64::from(OLD[0]) - apart) <= reach[0]
                    && (place[1] - f64::from(y)).abs() <= reach[1]
            };
            let of_nothing = windows.iter().filter(|(window, places)| {
                let may_touch = resampler.may_touch(*window, &cells);
                assert!(may_touch || !places.iter().any(is_reached), "{system} {x} {y}: {window:?}");
                !may_touch
            });
            let of_nothing = of_nothing.count();
            assert!(100 * of_nothing > least * windows.len(), "{system} {x} {y}: {of_nothing}");
        }
    }
}

/// An equal-area map of the globe has rows of which a part lies beyond the poles: what they hold is in doubt, and they alone are made beside what the samples reach.
#[test]
fn few_rows_are_made_where_the_globe_ends() {
    /// Samples that were made, and of how many in all.
    struct Counting(Mutex<[u64; 2]>);
    impl SampleSink for Counting {
        fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
            self.put_void(window)?;
            self.0.lock().unwrap()[0] += samples.len() as u64;
            Ok(())
        }

        fn put_void(&self, window: Window) -> Result<(), LayoutError> {
            self.0.lock().unwrap()[1] += u64::from(window.width) * u64::from(window.height);
            Ok(())
        }
    }
    const OLD: [u32; 2] = [21_600, 10_800];
    let step = 1.0 / 60.0;
    let map = [-180.0 + step / 2.0, step, 0.0, 90.0 - step / 2.0, 0.0, -step];
    let options = OpenOptions { reproject: Some("EPSG:6933".into()), ..OpenOptions::default() };
    let known = by_text("EPSG:4326").unwrap();
    let warp = Warp::plan(Path::new("a"), &known, Some(map), OLD, SampleType::F32, false, &options);
    let warp = warp.unwrap().unwrap();
    let counting = Counting(Mutex::default());
    let old = |sink: &dyn SampleSink| {
        sink.put(Window { col: 9000, row: 4000, width: 64, height: 64 }, &[7.0; 64 * 64])
    };
    warp.stream(&old, &counting).unwrap();
    let [made, all] = counting.0.into_inner().unwrap();
    let [wide, high] = warp.samples().map(u64::from);
    assert_eq!(all, wide * high);
    // Two rows of blocks, and the cell of old samples with those around it.
    let rows = 2 * u64::from(BLOCK[1]) * wide;
    assert!(made <= rows + 9 * u64::from(CELL).pow(2), "{made} of {all}, of which {rows} at the poles");
}

#[test]
fn utm_is_the_zone_of_the_centre_and_auto_goes_beyond() {
    let named = |text: &str, x: f64, y: f64, samples: [u32; 2]| {
        let system = by_text("EPSG:4326").unwrap();
        let options = OpenOptions { reproject: Some(text.into()), ..OpenOptions::default() };
        let map = [x, 0.01, 0.0, y, 0.0, -0.01];
        let warp = Warp::plan(Path::new("a"), &system, Some(map), samples, SampleType::I16, false, &options)
            .unwrap();
        warp.unwrap().system().unwrap().name.clone()
    };
    assert_eq!(named("utm", 8.0, 46.0, [100; 2]), "WGS 84 / UTM zone 32N");
    assert_eq!(named("auto", 178.0, -20.0, [100; 2]), "WGS 84 / UTM zone 60S");
    assert_eq!(named("auto", 185.0, -20.0, [100; 2]), "WGS 84 / UTM zone 1S");
    assert_eq!(named("auto", 8.0, 89.0, [100; 2]), "WGS 84 / UPS North (N,E)");
    assert_eq!(named("auto", 0.0, 46.0, [2000, 100]), "PROJ laea");
}
