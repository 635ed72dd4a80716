//! Two grounds against arithmetic sample by sample: the same samples, other samples, another system, voids, volumes.

mod import_support;

use import_support::read;
use std::path::Path;
use tempfile::{TempDir, tempdir};
use terrasoar_import::difference::{Difference, Summary};
use terrasoar_import::places::{Crs, Frame};
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemInfo, DemSource, MemoryDem, SampleSink, SampleType, Window};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

fn ground(x: u32, y: u32) -> f64 {
    let noise = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35) >> 20;
    if noise == 77 {
        f64::NAN
    } else {
        (500.0 + 40.0 * (f64::from(x) / 31.0).sin() + f64::from(noise) / 512.0).round()
    }
}

/// A terrain of a map and a system.
fn terrain(
    folder: &Path,
    name: &str,
    samples: [u32; 2],
    map: Option<[f64; 6]>,
    epsg: Option<u32>,
    height: impl FnMut(u32, u32) -> f64,
) -> Terrain {
    let mut dem = MemoryDem::from_fn(samples, SampleType::F64, height);
    dem.info_mut().georeference.pixel_to_crs = map;
    dem.info_mut().georeference.epsg = epsg;
    let path = folder.join(name);
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0, 20.0]), &Silent).unwrap();
    Terrain::open(&path).unwrap()
}

fn height(terrain: &Terrain, p: terrasoar_layout::grid::GridPoint) -> f64 {
    let vertex = terrain.checked_vertex(p).unwrap();
    if vertex.class.is_void() { f64::NAN } else { vertex.height_m }
}

/// Compares numbers, the file and the picture with differences that are known, rows from the south.
fn check(
    first: &Terrain,
    second: &Terrain,
    window: &SampleWindow,
    expected: &[f64],
    tolerance: f64,
) -> Summary {
    let difference = Difference::new(first, second, window).unwrap();
    let (summary, reduced) = difference.survey(128, &Silent).unwrap();
    let there: Vec<f64> = expected.iter().copied().filter(|d| !d.is_nan()).collect();
    let near = |a: f64, b: f64| (a - b).abs() <= tolerance * b.abs().max(1.0);
    assert_eq!(summary.compared, there.len() as u64);
    let count = there.len() as f64;
    assert!(near(summary.mean_m, there.iter().sum::<f64>() / count), "{summary:?}");
    assert!(near(summary.rms_m, (there.iter().map(|d| d * d).sum::<f64>() / count).sqrt()), "{summary:?}");
    let area = 10.0 * 20.0 * f64::from(window.step).powi(2);
    let volume = |sign: f64| there.iter().map(|d| (sign * d).max(0.0)).sum::<f64>() * area;
    assert!((summary.fill_m3 - volume(1.0)).abs() <= tolerance * area * count, "{summary:?}");
    assert!((summary.cut_m3 - volume(-1.0)).abs() <= tolerance * area * count, "{summary:?}");
    let (low, high) = there.iter().fold((f64::MAX, f64::MIN), |(low, high), d| (low.min(*d), high.max(*d)));
    for (extreme, wanted) in [(summary.lowest.unwrap(), low), (summary.highest.unwrap(), high)] {
        let [x, y] = [0, 1].map(|axis| (extreme.sample[axis] - window.from[axis]) / window.step);
        let there = expected[(y * window.size[0] + x) as usize];
        assert!(near(extreme.difference_m, wanted) && near(there, wanted), "{extreme:?}, not {wanted}");
    }
    // The file has each of them, rows from the north.
    let folder = tempdir().unwrap();
    let out = folder.path().join("d.tif");
    difference.export(&out, &Silent).unwrap();
    let grid = read(&[out]).unwrap();
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], window.size);
    let mut blocks = vec![f64::NAN; reduced.differences_m.len()];
    for row in 0..window.size[1] {
        for column in 0..window.size[0] {
            let wanted = expected[((window.size[1] - 1 - row) * window.size[0] + column) as usize];
            let found = grid.at(column, row);
            assert!(
                found.is_nan() == wanted.is_nan()
                    && (found.is_nan() || (found - wanted).abs() <= tolerance.max(1e-6)),
                "{column}, {row}: {found}, not {wanted}"
            );
            let block =
                &mut blocks[(row / reduced.samples * reduced.size[0] + column / reduced.samples) as usize];
            if block.is_nan() || block.abs() < wanted.abs() {
                *block = if wanted.is_nan() { *block } else { wanted };
            }
        }
    }
    for (found, wanted) in reduced.differences_m.iter().zip(&blocks) {
        let found = f64::from(*found);
        assert!(
            found.is_nan() == wanted.is_nan()
                && (found.is_nan() || (found - wanted).abs() <= tolerance.max(1e-5))
        );
    }
    summary
}

fn folder() -> TempDir {
    tempdir().unwrap()
}

#[test]
fn the_same_samples_are_compared_one_by_one() {
    let folder = folder();
    let changed = |x: u32, y: u32| match (x, y) {
        (100..150, 50..90) => ground(x, y) + 3.5,
        (700, 400) => ground(x, y) - 12.0,
        (300..310, 300..310) => f64::NAN,
        // What single precision does not hold is no difference.
        (200..250, 100..200) => ground(x, y) + 1e-6,
        _ => ground(x, y),
    };
    let first = terrain(folder.path(), "a.iqt", [900, 700], None, None, ground);
    let second = terrain(folder.path(), "b.iqt", [900, 700], None, None, changed);
    for (sides, step) in
        [([0.0, 0.0, 899.0, 699.0], 1), ([90.0, 40.0, 720.0, 430.0], 1), ([0.0, 0.0, 899.0, 699.0], 4)]
    {
        let window = SampleWindow::within(first.grid(), sides, step).unwrap();
        let expected: Vec<f64> = (0..window.size[1])
            .flat_map(|row| (0..window.size[0]).map(move |column| (column, row)))
            .map(|(column, row)| {
                let p = window.point(column, row);
                let d = changed(p.x(), p.y()) - ground(p.x(), p.y());
                if d.abs() < 1e-5 { 0.0 } else { d }
            })
            .collect();
        let summary = check(&first, &second, &window, &expected, 1e-9);
        assert_eq!(summary.changed, expected.iter().filter(|d| !d.is_nan() && **d != 0.0).count() as u64);
        if step == 1 {
            let only = (300..310)
                .flat_map(|x| (300..310).map(move |y| (x, y)))
                .filter(|(x, y)| !ground(*x, *y).is_nan());
            assert_eq!(summary.alone, [only.count() as u64, 0]);
        }
    }
    let same = check(&first, &first, &SampleWindow::of(first.grid()), &vec_of(&first), 0.0);
    assert_eq!((same.changed, same.rms_m, same.cut_m3, same.fill_m3), (0, 0.0, 0.0, 0.0));
}

/// No difference of a terrain from itself.
fn vec_of(terrain: &Terrain) -> Vec<f64> {
    let window = SampleWindow::of(terrain.grid());
    let points = (0..window.size[1]).flat_map(|row| (0..window.size[0]).map(move |column| (column, row)));
    points
        .map(|(column, row)| if ground(column, row).is_nan() { f64::NAN } else { f64::from(window.step - 1) })
        .collect()
}

/// A plane is a plane between its samples too.
#[test]
fn other_samples_are_interpolated_where_they_are() {
    let folder = folder();
    let plane = |e: f64, n: f64| 100.0 + 0.01 * (e - 500_000.0) - 0.02 * (n - 5_000_000.0);
    // 10 x 20 m from (500000, 5000000) north-west, and 8 x 9 m from inside of it, half of it beyond.
    let map_a = [500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -20.0];
    let map_b = [500_203.0, 8.0, 0.0, 4_999_701.0, 0.0, -9.0];
    let at = |m: [f64; 6], high: u32, x: u32, y: u32| {
        let row = f64::from(high - 1 - y);
        [m[0] + m[1] * f64::from(x), m[3] + m[5] * row]
    };
    let first = terrain(folder.path(), "a.iqt", [60, 50], Some(map_a), Some(32632), |x, y| {
        let [e, n] = at(map_a, 50, x, y);
        plane(e, n)
    });
    let second = terrain(folder.path(), "b.iqt", [90, 120], Some(map_b), Some(32632), |x, y| {
        let [e, n] = at(map_b, 120, x, y);
        plane(e, n) + 2.0
    });
    let window = SampleWindow::of(first.grid());
    let expected: Vec<f64> = (0..50)
        .flat_map(|y| (0..60).map(move |x| (x, y)))
        .map(|(x, y)| {
            let [e, n] = at(map_a, 50, x, y);
            let (low, high) = (at(map_b, 120, 0, 0), at(map_b, 120, 89, 119));
            let is_in = (low[0]..=high[0]).contains(&e) && (low[1]..=high[1]).contains(&n);
            if is_in { 2.0 } else { f64::NAN }
        })
        .collect();
    assert!(Difference::new(&first, &second, &window).unwrap().is_interpolated());
    check(&first, &second, &window, &expected, 1e-7);
}

/// The second terrain in another system: each sample's place by its projection.
#[test]
fn other_systems_are_reached() {
    let folder = folder();
    let map_a = [500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -20.0];
    let first = terrain(folder.path(), "a.iqt", [60, 50], Some(map_a), Some(32632), ground);
    let map_b = [8.998, 0.0001, 0.0, 45.153, 0.0, -0.0001];
    let second = terrain(folder.path(), "b.iqt", [120, 140], Some(map_b), Some(4326), |x, y| {
        f64::from(x) + 2.0 * f64::from(y)
    });
    let window = SampleWindow::of(first.grid());
    let frame = Frame::of(first.header(), &Crs::named("EPSG:4326").unwrap()).unwrap();
    let mut covered = 0;
    let expected: Vec<f64> = (0..50)
        .flat_map(|y| (0..60).map(move |x| (x, y)))
        .map(|(x, y)| {
            let [lon, lat] = frame.coordinates([f64::from(x) * 10.0, f64::from(y) * 20.0]).unwrap();
            let (u, v) = ((lon - 8.998) / 0.0001, 139.0 - (45.153 - lat) / 0.0001);
            let there = (0.0..=119.0).contains(&u) && (0.0..=139.0).contains(&v);
            covered += u32::from(there);
            let here = height(&first, window.point(x, y));
            if there { u + 2.0 * v - here } else { f64::NAN }
        })
        .collect();
    assert!(covered > 1000, "{covered}");
    check(&first, &second, &window, &expected, 1e-4);
}

#[test]
fn what_cannot_be_brought_together_is_refused() {
    let folder = folder();
    let map = [500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -20.0];
    let placed = terrain(folder.path(), "placed.iqt", [60, 50], Some(map), Some(32632), ground);
    let unplaced = terrain(folder.path(), "unplaced.iqt", [61, 50], None, None, ground);
    let nameless = terrain(folder.path(), "nameless.iqt", [61, 50], Some(map), None, ground);
    let refused = |a: &Terrain, b: &Terrain| match Difference::new(a, b, &SampleWindow::of(a.grid())) {
        Ok(_) => panic!("{:?} and {:?} were compared", a.path(), b.path()),
        Err(error) => error.to_string(),
    };
    for (a, b, file, words) in [
        (&placed, &unplaced, "unplaced.iqt", "where on the ground"),
        (&unplaced, &placed, "unplaced.iqt", "where on the ground"),
        (&placed, &nameless, "nameless.iqt", "its reference system"),
        (&nameless, &placed, "nameless.iqt", "its reference system"),
    ] {
        let said = refused(a, b);
        assert!(said.contains(file) && said.contains(words), "{said}");
    }
    let outside = SampleWindow { from: [50, 0], size: [20, 20], step: 1 };
    assert!(Difference::new(&placed, &placed, &outside).is_err());
}

/// Squares of ground in a square of voids, said to be void as a whole.
struct Isles {
    info: DemInfo,
    /// Columns and rows from the north-west where they begin.
    at: Vec<[u32; 2]>,
    raised: f64,
}

/// Samples a side of an isle.
const ISLE: u32 = 90;

impl DemSource for Isles {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let [wide, high] = [self.info.samples_wide, self.info.samples_high];
        let void = |col: u32, row: u32, width: u32, height: u32| match width > 0 && height > 0 {
            true => sink.put_void(Window { col, row, width, height }),
            false => Ok(()),
        };
        let mut top = 0;
        for [col, row] in self.at.iter().copied() {
            void(0, top, wide, row - top)?;
            void(0, row, col, ISLE)?;
            void(col + ISLE, row, wide - col - ISLE, ISLE)?;
            let height = |x: u32, y: u32| f64::from((x * 7 + y * 13) % 200) + self.raised;
            let samples: Vec<f64> =
                (0..ISLE * ISLE).map(|i| height(col + i % ISLE, row + i / ISLE)).collect();
            sink.put(Window { col, row, width: ISLE, height: ISLE }, &samples)?;
            top = row + ISLE;
        }
        void(0, top, wide, high - top)
    }
}

/// Islands far apart in the largest square: what is void in both is passed over, and the numbers are those of the islands.
#[test]
fn oceans_are_passed_over() {
    const SIDE: u32 = 1_048_577;
    let folder = folder();
    let isles = |name: &str, samples: [u32; 2], corner: [f64; 2], at: &[[u32; 2]], raised: f64| {
        let mut info = MemoryDem::from_fn([2, 2], SampleType::I16, |_, _| 0.0).info().clone();
        [info.samples_wide, info.samples_high] = samples;
        // 10 m a sample, from the south-west one.
        info.georeference.pixel_to_crs =
            Some([corner[0], 10.0, 0.0, corner[1] + 10.0 * f64::from(samples[1] - 1), 0.0, -10.0]);
        info.georeference.epsg = Some(32633);
        let path = folder.path().join(name);
        let options = BuildOptions::default().spacing_m([10.0, 10.0]);
        build(&Isles { info, at: at.to_vec(), raised }, &path, &options, &Silent).unwrap();
        Terrain::open(&path).unwrap()
    };
    let at = [[0, 0], [700_000, 300_000], [SIDE - ISLE, SIDE - ISLE]];
    let first = isles("a.iqt", [SIDE; 2], [0.0; 2], &at, 0.0);
    let whole = SampleWindow::of(first.grid());
    let each = u64::from(ISLE * ISLE);

    // The same samples, an island of which one has and one has not.
    let other = [at[0], [123_456, 234_567], at[1], at[2]];
    let second = isles("b.iqt", [SIDE; 2], [0.0; 2], &other, 2.0);
    let (summary, reduced) = Difference::new(&first, &second, &whole).unwrap().survey(2048, &Silent).unwrap();
    assert_eq!([summary.compared, summary.changed], [3 * each; 2]);
    assert_eq!(summary.alone, [0, each]);
    assert!((summary.fill_m3 - 2.0 * 100.0 * 3.0 * each as f64).abs() < 1.0 && summary.cut_m3 == 0.0);
    let shown = reduced.differences_m.iter().filter(|value| !value.is_nan()).count();
    assert!((3..=12).contains(&shown), "{shown}");

    // Part of one island, on samples of its own: the corner of the second isle, half a sample off.
    let corner_m = [7_000_000.0 + 5.0, f64::from(SIDE - 1 - 300_000 - 89) * 10.0 + 5.0];
    let second = isles("c.iqt", [ISLE; 2], corner_m, &[[0, 0]], 0.0);
    let (summary, _) = Difference::new(&first, &second, &whole).unwrap().survey(2048, &Silent).unwrap();
    let near = SampleWindow { from: [699_900, SIDE - 1 - 300_200], size: [400; 2], step: 1 };
    let (wanted, _) = Difference::new(&first, &second, &near).unwrap().survey(2048, &Silent).unwrap();
    assert_eq!(summary.compared, 89 * 89);
    assert_eq!(summary.alone, [3 * each - summary.compared, 0]);
    assert_eq!(
        (wanted.compared, wanted.cut_m3, wanted.fill_m3),
        (summary.compared, summary.cut_m3, summary.fill_m3)
    );
    assert_eq!([wanted.lowest, wanted.highest], [summary.lowest, summary.highest]);
}
