//! An edited terrain against a build from the edited heights: every record of every page is the same.

mod common;

use common::{MemoryDem, build_bytes, open_bytes};
use proptest::prelude::*;
use std::sync::Arc;
use terrasoar_layout::build::{BuildOptions, rebuild};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Changes, Crest, Edit, Editor, HeightWindow, Limit, Line, SampleRect};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::bytes::Page;
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::file::header::ErrorKind;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// A terrain in memory and its bytes.
struct Bench {
    bytes: Vec<u8>,
    editor: Editor,
}

impl Bench {
    fn new(dem: &MemoryDem, options: &BuildOptions) -> Self {
        let bytes = build_bytes(dem, options).unwrap();
        let editor = Editor::new(Arc::new(open_bytes(bytes.clone()).unwrap()));
        Self { bytes, editor }
    }

    fn terrain(&self) -> &Terrain {
        self.editor.terrain()
    }

    fn page(&self, logical: u64) -> Box<Page> {
        match self.editor.edited_page(logical) {
            Some(page) => Box::new(*page),
            None => self.terrain().checked_page(logical).unwrap(),
        }
    }

    /// A build from the heights as they are now.
    fn rebuilt(&self) -> Terrain {
        // Edited pages in their old places, which nobody checks.
        let mut bytes = self.bytes.clone();
        for logical in self.editor.edited_pages() {
            let page = self.editor.edited_page(logical).unwrap();
            let at = self.terrain().entry(logical).unwrap().page as usize * 4096;
            bytes[at..at + 4096].copy_from_slice(page);
        }
        // Exact records may have got a larger error top, which a build is to know.
        let edited = open_bytes(bytes).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.iqt");
        rebuild(&SystemDisk, &edited, &path, None, 512, &Silent).unwrap();
        open_bytes(std::fs::read(path).unwrap()).unwrap()
    }

    fn check(&self) {
        let rebuilt = self.rebuilt();
        let grid = *self.terrain().grid();
        let n = grid.side_steps();
        let per_page = self.terrain().header().records_per_page();
        let bytes = self.terrain().header().record_kind.bytes();
        // The finest is what others follow from: for whoever has to mend it.
        let mut finest: Option<(u32, String)> = None;
        for logical in 0..self.terrain().page_count() {
            let (ours, theirs) = (self.page(logical), rebuilt.checked_page(logical).unwrap());
            if ours == theirs {
                continue;
            }
            for i in
                (0..per_page as usize).filter(|i| ours[i * bytes..][..bytes] != theirs[i * bytes..][..bytes])
            {
                let p =
                    terrasoar_layout::grid::order::point_of(grid.k(), logical * per_page + i as u64).unwrap();
                let level = grid.level(p);
                let said = format!(
                    "({}, {}) of {n}, level {level}: {:?} instead of {:?}",
                    p.x(),
                    p.y(),
                    &ours[i * bytes..][..bytes],
                    &theirs[i * bytes..][..bytes]
                );
                if finest.as_ref().is_none_or(|(known, _)| level < *known) {
                    finest = Some((level, said));
                }
            }
        }
        assert!(finest.is_none(), "{}", finest.unwrap_or_default().1);
    }
}

/// Ground with slopes, plains and steps, in whole units of 0 to 1,000.
fn height(seed: u64, x: u32, y: u32) -> f64 {
    let mut h = seed ^ (u64::from(x) << 32 | u64::from(y)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ h >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let rough = (h >> 40) % 40;
    let (fx, fy) = (f64::from(x), f64::from(y));
    let hill = 400.0 + 250.0 * ((fx * 0.11).sin() + (fy * 0.07).cos());
    let plain = seed.is_multiple_of(3) && (x / 16 + y / 16).is_multiple_of(3);
    if plain { 300.0 } else { (hill + rough as f64).floor().clamp(0.0, 1000.0) }
}

fn dem(samples: [u32; 2], seed: u64, voids: bool, fractions: bool) -> MemoryDem {
    let kind = if fractions { SampleType::F64 } else { SampleType::I16 };
    MemoryDem::from_fn(samples, kind, move |x, y| {
        // The ends of the range lie in corners that edits of this test leave alone.
        match (x, y) {
            (0, 0) => return 0.0,
            (1, 0) => return 1000.0,
            _ => {}
        }
        let hole = (x / 5 + y / 7).is_multiple_of(6) && (x * 7 + y * 3) % 11 < 8;
        if voids && hole {
            return f64::NAN;
        }
        height(seed, x, y) + if fractions { f64::from(x * 31 % 17) / 19.0 } else { 0.0 }
    })
}

/// A rectangle in hundredths of the terrain, and what to do there.
#[derive(Debug, Clone, Copy)]
struct Stroke {
    corner: [u32; 2],
    size: [u32; 2],
    kind: u8,
    seed: u64,
}

fn strokes() -> impl Strategy<Value = Vec<Stroke>> {
    let stroke = ([0u32..=100, 0u32..=100], [1u32..40, 1u32..40], 0u8..7, any::<u64>())
        .prop_map(|(corner, size, kind, seed)| Stroke { corner, size, kind, seed });
    prop::collection::vec(stroke, 1..8)
}

fn apply(bench: &mut Bench, stroke: Stroke) -> Changes {
    let [wide, high] = bench.terrain().grid().samples();
    let west = (stroke.corner[0] * (wide - 1) / 100).max(2).min(wide - 1);
    let south = (stroke.corner[1] * (high - 1) / 100).max(1).min(high - 1);
    let rect = SampleRect {
        west,
        south,
        east: (west + stroke.size[0] - 1).min(wide - 1),
        north: (south + stroke.size[1] - 1).min(high - 1),
    };
    if stroke.kind > 3 {
        return bench.editor.apply(&[shaped(bench.terrain(), rect, stroke)]).unwrap();
    }
    let mut window = bench.editor.heights(rect).unwrap();
    for y in rect.south..=rect.north {
        for x in rect.west..=rect.east {
            let at = window.index(x, y);
            let old = window.heights_m()[at];
            window.heights_m_mut()[at] = match stroke.kind {
                0 => 500.0,
                1 => height(stroke.seed, x, y),
                2 => (old + 37.25).clamp(0.0, 1000.0),
                _ if (x ^ y) & 3 == 0 => (old - 120.5).clamp(0.0, 1000.0),
                _ => f64::NAN,
            };
        }
    }
    bench.editor.set_heights(&window).unwrap()
}

/// A dam, a road or a floor over the rectangle, within the heights that the file holds. It may reach beyond the rectangle, not to the corner that is left alone.
fn shaped(terrain: &Terrain, rect: SampleRect, stroke: Stroke) -> Edit {
    let [dx, dy] = terrain.grid().spacing_m();
    let at = |x: u32, y: u32| [f64::from(x) * dx, f64::from(y) * dy];
    let height_m = (stroke.seed % 1000) as f64;
    let limit = match stroke.kind {
        4 => Some(Limit::AtLeast),
        5 => None,
        _ => return Edit::Limit { area: Area::Rect(rect), height_m, limit: Limit::AtMost },
    };
    let path_m = vec![at(rect.west, rect.south), at(rect.east, rect.south), at(rect.west + 1, rect.north)];
    let crest = Crest::Level { height_m, limit, sides_m: 0.9 * dy };
    Edit::Line(Line { path_m, crest, width_m: 0.05 * dy, slope: 1.0 })
}

fn options(record: Option<RecordKind>, error: ErrorKind, spacing: [f64; 2]) -> BuildOptions {
    BuildOptions::default().record(record).error(error).spacing_m(spacing)
}

fn records() -> impl Strategy<Value = RecordKind> {
    prop_oneof![2 => Just(RecordKind::Compact), 1 => Just(RecordKind::Fine), 1 => Just(RecordKind::Exact8)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn edited_records_are_a_rebuilds(
        wide in 5u32..90, high in 5u32..90, seed in any::<u64>(), voids in any::<bool>(), bounded in prop::bool::weighted(0.8),
        record in records(), fractions in any::<bool>(), strokes in strokes(),
    ) {
        let error = if bounded { ErrorKind::Bounded } else { ErrorKind::Step };
        let record = Some(record);
        let dem = dem([wide, high], seed, voids, fractions);
        let mut bench = Bench::new(&dem, &options(record, error, [10.3, 7.7]));
        for stroke in strokes {
            apply(&mut bench, stroke);
            bench.check();
        }
        // Taking all back gives the file's bytes.
        bench.editor.roll_back();
        for logical in 0..bench.terrain().page_count() {
            prop_assert!(bench.page(logical) == bench.terrain().checked_page(logical).unwrap());
        }
    }
}

/// What changed is told: each vertex whose record is another, and only those.
#[test]
fn changes_are_what_changed() {
    let mut bench = Bench::new(&dem([130, 97], 5, true, false), &BuildOptions::default());
    let grid = *bench.terrain().grid();
    let n = grid.side_steps();
    let all: Vec<GridPoint> = (0..=n).flat_map(|y| (0..=n).map(move |x| GridPoint::new(x, y))).collect();
    for (i, corner) in [[20, 30], [100, 100], [60, 61], [0, 99]].into_iter().enumerate() {
        let stroke = Stroke { corner, size: [17, 9], kind: i as u8, seed: 8 };
        let before: Vec<_> = all.iter().map(|p| bench.editor.vertex(*p).unwrap()).collect();
        let changes = apply(&mut bench, stroke);
        let mut expected = Vec::new();
        for (p, old) in all.iter().zip(before) {
            if bench.editor.vertex(*p).unwrap() != old {
                expected.push(*p);
            }
        }
        let mut told = changes.vertices.clone();
        told.sort_by_key(|p| (p.y(), p.x()));
        assert_eq!(told, expected);
        assert!(changes.pages.is_sorted() && changes.vertices.is_empty() == changes.pages.is_empty());
    }
}

/// Ground too steep for the file's records is refused in the middle of the work; neither the ground nor what comes after it shows any of that.
#[test]
fn a_batch_that_fails_halfway_leaves_no_trace() {
    let smooth = MemoryDem::from_fn([70, 61], SampleType::I16, |x, y| f64::from(6 * x + 7 * y + x * y % 5));
    let mut bench = Bench::new(&smooth, &options(None, ErrorKind::Bounded, [0.3, 0.3]));
    let set = |bench: &mut Bench, west: u32, south: u32, heights_m: [f64; 4]| {
        let rect = SampleRect { west, south, east: west + 1, north: south + 1 };
        bench.editor.set_heights(&HeightWindow::new(rect, heights_m.to_vec()).unwrap())
    };
    let mut refused = 0;
    for i in 0..12 {
        match set(&mut bench, 5 + 4 * i, 3 + 4 * i, [0.0, 800.0, 0.0, 800.0]) {
            Err(LayoutError::OutOfRange { problem, .. }) => {
                assert!(problem.contains("steeper"), "{problem}");
                refused += 1;
            }
            other => drop(other.unwrap()),
        }
        let changes = set(&mut bench, 60, 1 + i, [370.0 + f64::from(9 * i); 4]).unwrap();
        let mut told = changes.vertices.clone();
        told.sort_unstable();
        told.dedup();
        assert_eq!(told.len(), changes.vertices.len());
        bench.check();
    }
    assert!(refused > 5, "{refused}");
}

/// What does not fit is refused whole.
#[test]
fn heights_beyond_the_range_are_refused_and_nothing_changes() {
    let mut bench = Bench::new(&dem([65, 65], 3, false, false), &BuildOptions::default().head_room(false));
    for height_m in [-1.0, 1001.0, 1e12, f64::INFINITY] {
        let rect = SampleRect { west: 9, south: 9, east: 12, north: 12 };
        let mut heights_m = vec![400.0; rect.count()];
        heights_m[7] = height_m;
        let window = HeightWindow::new(rect, heights_m).unwrap();
        let error = bench.editor.set_heights(&window).unwrap_err();
        assert!(matches!(error, LayoutError::OutOfRange { .. }), "{error}");
    }
    let outside = SampleRect { west: 60, south: 0, east: 65, north: 3 };
    let window = HeightWindow::new(outside, vec![1.0; outside.count()]).unwrap();
    assert!(matches!(bench.editor.set_heights(&window).unwrap_err(), LayoutError::Usage(_)));
    assert_eq!(bench.editor.uncommitted(), Vec::<u64>::new());
    for logical in 0..bench.terrain().page_count() {
        assert!(bench.page(logical) == bench.terrain().checked_page(logical).unwrap());
    }
}

/// Deep valleys and high mountains of any ground, of whole steps, of decimetres and of depths: what room there is stands in FORMAT.md's terms only, so the
/// numbers here are those of the manual: a range of 16,384 steps.
#[test]
fn ground_may_be_dug_and_raised_at_first_try() {
    for (z_scale, low) in [(1.0, 0.0), (1.0, -4000.0), (0.1, 2203.0), (-1.0, 150.0), (0.3048, 32_000.0)] {
        let ground =
            MemoryDem::from_fn([65, 61], SampleType::I16, |x, y| low + f64::from((7 * x + 3 * y) % 50));
        let step_m = f64::abs(z_scale);
        // So far apart that the slopes stay below those that radii are made for, which are another limit.
        let spacing_m = [4000.0 * step_m; 2];
        let mut bench = Bench::new(&ground, &BuildOptions::default().z_scale(z_scale).spacing_m(spacing_m));
        let [lowest_m, highest_m] = bench.terrain().header().height_range_m;
        for (i, height_m) in
            [lowest_m - 8000.0 * step_m, highest_m + 8000.0 * step_m, lowest_m, lowest_m - 8150.0 * step_m]
                .into_iter()
                .enumerate()
        {
            let west = 5 + 12 * i as u32;
            let rect = SampleRect { west, south: 20, east: west + 2, north: 22 };
            bench
                .editor
                .set_heights(&HeightWindow::new(rect, vec![height_m; rect.count()]).unwrap())
                .unwrap();
            bench.check();
        }
        let rect = SampleRect { west: 5, south: 20, east: 6, north: 21 };
        let too_deep = HeightWindow::new(rect, vec![lowest_m - 9000.0 * step_m; 4]).unwrap();
        let Err(LayoutError::OutOfRange { problem, .. }) = bench.editor.set_heights(&too_deep) else {
            panic!("{z_scale}: deeper than records hold, and not refused");
        };
        assert!(problem.contains("records hold"), "{problem}");
    }
}
