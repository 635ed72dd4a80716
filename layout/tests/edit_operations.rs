//! What edits do to heights, against brute force: each sample by the definition in EDITS.md, nothing outside the bounds, the same through every window.

use proptest::prelude::*;
use terrasoar_layout::edit::{
    Area, Brush, BrushAction, Crater, Crest, Edit, Falloff, HeightWindow, Limit, Line, MAX_EDIT_SAMPLES,
    SampleRect, Stamp, StampMode,
};
use terrasoar_layout::grid::Grid;

const SAMPLES: [u32; 2] = [23, 17];

fn grid(spacing_m: [f64; 2]) -> Grid {
    Grid::new(SAMPLES, spacing_m).unwrap()
}

fn whole() -> SampleRect {
    SampleRect { west: 0, south: 0, east: SAMPLES[0] - 1, north: SAMPLES[1] - 1 }
}

/// Hills with some voids.
fn ground(seed: u64) -> HeightWindow {
    let heights = (0..u64::from(SAMPLES[0] * SAMPLES[1])).map(|i| {
        let x = (i ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        if x.is_multiple_of(11) { f64::NAN } else { x as f64 / 1e5 - 40.0 }
    });
    HeightWindow::new(whole(), heights.collect()).unwrap()
}

fn cut(window: &HeightWindow, rect: SampleRect) -> HeightWindow {
    let heights = (rect.south..=rect.north)
        .flat_map(|y| (rect.west..=rect.east).map(move |x| (x, y)))
        .map(|(x, y)| window.height_m(x, y));
    HeightWindow::new(rect, heights.collect()).unwrap()
}

fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// The new height of a sample by the definition, written without a look at the code.
fn defined(edit: &Edit, grid: &Grid, old: &HeightWindow, original: &HeightWindow, x: u32, y: u32) -> f64 {
    let height = old.height_m(x, y);
    if height.is_nan() {
        return height;
    }
    let way = |centre: [f64; 2]| {
        let [dx, dy] = grid.spacing_m();
        [f64::from(x) * dx - centre[0], f64::from(y) * dy - centre[1]]
    };
    let inside = |area: &Area| match *area {
        Area::Rect(r) => x >= r.west && x <= r.east && y >= r.south && y <= r.north,
        Area::Extent { sides_m: [w, s, e, n] } => {
            let [x, y] = way([0.0; 2]);
            let [near_x, near_y] = grid.spacing_m().map(|step| 1e-6 * step);
            x >= w - near_x && x <= e + near_x && y >= s - near_y && y <= n + near_y
        }
        Area::Disc { centre_m, radius_m } => way(centre_m)[0].hypot(way(centre_m)[1]) <= radius_m,
    };
    match edit {
        Edit::Crater(c) => {
            let [east, north] = way(c.centre_m);
            let t = east.hypot(north) / c.radius_m;
            let turn = east.atan2(north) - c.direction_deg.to_radians();
            let s = t - 1.0;
            height
                + c.depth_m
                    * match t {
                        t if t <= 1.0 => -(1.0 - t * t),
                        t if t < 2.0 => {
                            s * (1.0 - s).powi(2) * (6.0 + s) / 3.0
                                * (1.0 + 0.8 * turn.cos() * (1.0 - (1.0 - s).powi(2)))
                        }
                        _ => 0.0,
                    }
        }
        Edit::Brush(b) => {
            let t = way(b.centre_m)[0].hypot(way(b.centre_m)[1]) / b.radius_m;
            if t > 1.0 {
                return height;
            }
            let weight = match b.falloff {
                Falloff::Hard => 1.0,
                Falloff::Linear => 1.0 - t,
                Falloff::Smooth => (1.0 - t * t).powi(2),
            };
            match b.action {
                BrushAction::Raise(by) => height + by * weight,
                BrushAction::Lower(by) => height - by * weight,
                BrushAction::Flatten { height_m, strength } => {
                    let near = |u: u32, v: u32| {
                        let [dx, dy] = grid.spacing_m();
                        (f64::from(u) * dx - b.centre_m[0]).powi(2)
                            + (f64::from(v) * dy - b.centre_m[1]).powi(2)
                    };
                    let known = (0..SAMPLES[1])
                        .flat_map(|v| (0..SAMPLES[0]).map(move |u| (u, v)))
                        .filter(|&(u, v)| !old.height_m(u, v).is_nan());
                    let nearest = known.min_by(|a, b| near(a.0, a.1).total_cmp(&near(b.0, b.1)));
                    let target =
                        height_m.unwrap_or_else(|| nearest.map_or(height, |(u, v)| old.height_m(u, v)));
                    height + (target - height) * strength * weight
                }
                BrushAction::Smooth { strength } => {
                    let (mut sum, mut count) = (0.0, 0);
                    for (u, v) in (-1..=1).flat_map(|u| (-1..=1).map(move |v| (u, v))) {
                        let (u, v) = (i64::from(x) + u, i64::from(y) + v);
                        let is_there = (0..i64::from(SAMPLES[0])).contains(&u)
                            && (0..i64::from(SAMPLES[1])).contains(&v);
                        if is_there
                            && (u, v) != (x.into(), y.into())
                            && !old.height_m(u as u32, v as u32).is_nan()
                        {
                            sum += old.height_m(u as u32, v as u32);
                            count += 1;
                        }
                    }
                    let mean = if count > 0 { sum / f64::from(count) } else { height };
                    height + (mean - height) * strength * weight
                }
            }
        }
        Edit::Stamp(stamp) => {
            let (u, v) = (i64::from(x) - stamp.at[0], i64::from(y) - stamp.at[1]);
            let [wide, high] = stamp.samples().map(i64::from);
            if !(0..wide).contains(&u) || !(0..high).contains(&v) {
                return height;
            }
            let there = stamp.heights_m()[(v * wide + u) as usize];
            match stamp.mode {
                _ if there.is_nan() => height,
                StampMode::Set => there,
                StampMode::Add => height + there,
                StampMode::Max => height.max(there),
                StampMode::Min => height.min(there),
            }
        }
        Edit::Set { area, height_m } => {
            if inside(area) {
                *height_m
            } else {
                height
            }
        }
        Edit::Limit { area, height_m, limit } => match limit {
            _ if !inside(area) => height,
            Limit::AtLeast => height.max(*height_m),
            Limit::AtMost => height.min(*height_m),
        },
        Edit::Line(line) => {
            let [px, py] = way([0.0; 2]);
            let pieces = line.path_m.windows(2);
            let distance = pieces.map(|ends| nearest(ends[0], ends[1], [px, py])).fold(f64::MAX, f64::min);
            let fall = line.slope * (distance - line.width_m / 2.0).max(0.0);
            match line.crest {
                Crest::Above(by) if fall < by => height + by - fall,
                Crest::Below(by) if fall < by => height - by + fall,
                Crest::Level { height_m, limit, sides_m } if fall <= sides_m => match limit {
                    Some(Limit::AtLeast) => height.max(height_m - fall),
                    Some(Limit::AtMost) => height.min(height_m + fall),
                    None => height.clamp(height_m - fall, height_m + fall),
                },
                _ => height,
            }
        }
        Edit::Restore(area) => {
            let before = original.height_m(x, y);
            if inside(area) && !before.is_nan() { before } else { height }
        }
    }
}

/// Distance of a place from a piece of a path, by its angles: beside the piece it is that from the straight line (Heron), beyond it that from an end.
fn nearest(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    let between = |u: [f64; 2], v: [f64; 2]| (u[0] - v[0]).hypot(u[1] - v[1]);
    let (ab, ap, bp) = (between(a, b), between(a, p), between(b, p));
    if ab == 0.0 || ap * ap >= bp * bp + ab * ab || bp * bp >= ap * ap + ab * ab {
        return ap.min(bp);
    }
    ((b[0] - a[0]) * (a[1] - p[1]) - (a[0] - p[0]) * (b[1] - a[1])).abs() / ab
}

fn any_line() -> impl Strategy<Value = Edit> {
    let limit = prop::sample::select(vec![None, Some(Limit::AtLeast), Some(Limit::AtMost)]);
    let crest = prop_oneof![
        2 => (-50.0..50.0f64, limit, 0.0..80.0f64)
            .prop_map(|(height_m, limit, sides_m)| Crest::Level { height_m, limit, sides_m }),
        1 => (0.0..50.0f64).prop_map(Crest::Above),
        1 => (0.0..50.0f64).prop_map(Crest::Below),
    ];
    let path = prop::collection::vec(any_place(), 2..6);
    (path, crest, prop_oneof![Just(0.0), 0.0..90.0f64], 0.2..9.0f64)
        .prop_map(|(path_m, crest, width_m, slope)| Edit::Line(Line { path_m, crest, width_m, slope }))
}

fn any_place() -> impl Strategy<Value = [f64; 2]> {
    (-100.0..350.0f64, -100.0..350.0f64).prop_map(|(x, y)| [x, y])
}

fn any_radius() -> impl Strategy<Value = f64> {
    prop_oneof![0.1..20.0f64, 1.0..400.0f64]
}

fn any_area() -> impl Strategy<Value = Area> {
    prop_oneof![
        (0..30u32, 0..30u32, 0..12u32, 0..12u32).prop_map(|(west, south, w, h)| {
            Area::Rect(SampleRect { west, south, east: west + w, north: south + h })
        }),
        (any_place(), any_radius()).prop_map(|(centre_m, radius_m)| Area::Disc { centre_m, radius_m }),
        (any_place(), any_radius())
            .prop_map(|([x, y], r)| Area::Extent { sides_m: [x - r, y - 0.5 * r, x + r, y + r] }),
    ]
}

fn any_stamp() -> impl Strategy<Value = Edit> {
    let modes = vec![StampMode::Set, StampMode::Add, StampMode::Max, StampMode::Min];
    let heights = |samples: [u32; 2]| {
        let one = prop_oneof![4 => -99.0..99.0f64, 1 => Just(f64::NAN)];
        prop::collection::vec(one, (samples[0] * samples[1]) as usize)
    };
    (prop::array::uniform2(1..30u32), prop::array::uniform2(-20..30i64), prop::sample::select(modes))
        .prop_flat_map(move |(samples, at, mode)| {
            heights(samples).prop_map(move |h| Edit::Stamp(Stamp::new(at, samples, h, mode).unwrap()))
        })
}

fn any_edit() -> impl Strategy<Value = Edit> {
    let falloff = prop::sample::select(vec![Falloff::Hard, Falloff::Linear, Falloff::Smooth]);
    let action = prop_oneof![
        (0.0..50.0f64).prop_map(BrushAction::Raise),
        (0.0..50.0f64).prop_map(BrushAction::Lower),
        (prop::option::of(-50.0..50.0f64), 0.0..=1.0f64)
            .prop_map(|(height_m, strength)| BrushAction::Flatten { height_m, strength }),
        (0.0..=1.0f64).prop_map(|strength| BrushAction::Smooth { strength }),
    ];
    prop_oneof![
        2 => (any_place(), -400.0..400.0f64, any_radius(), 0.0..50.0f64).prop_map(
            |(centre_m, direction_deg, radius_m, depth_m)| {
                Edit::Crater(Crater { centre_m, direction_deg, radius_m, depth_m })
            }
        ),
        4 => (action, any_place(), any_radius(), falloff).prop_map(|(action, centre_m, radius_m, falloff)| {
            Edit::Brush(Brush { action, centre_m, radius_m, falloff })
        }),
        1 => any_stamp(),
        1 => (any_area(), -50.0..50.0f64).prop_map(|(area, height_m)| Edit::Set { area, height_m }),
        1 => (any_area(), -50.0..50.0f64, any::<bool>()).prop_map(|(area, height_m, up)| Edit::Limit {
            area,
            height_m,
            limit: if up { Limit::AtLeast } else { Limit::AtMost },
        }),
        3 => any_line(),
        1 => any_area().prop_map(Edit::Restore),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn every_sample_is_as_defined_through_every_window(
        edit in any_edit(),
        spacing_m in prop::array::uniform2(2.0..20.0f64),
        seed in any::<u64>(),
        more in prop::array::uniform4(0..5u32),
    ) {
        let grid = grid(spacing_m);
        edit.check(&grid).unwrap();
        let (old, original) = (ground(seed), ground(seed));
        let original = cut(&original, whole());
        let mut new = old.clone();
        edit.apply(&grid, &mut new, Some(&original));
        let bounds = edit.bounds(&grid);
        for y in 0..SAMPLES[1] {
            for x in 0..SAMPLES[0] {
                let (was, is) = (old.height_m(x, y), new.height_m(x, y));
                let wanted = defined(&edit, &grid, &old, &original, x, y);
                // On the very edge of a hard brush rounding decides.
                prop_assert!(same(is, wanted) || (is - wanted).abs() < 1e-9, "{edit:?} {x},{y}: {was} {is} {wanted}");
                if !bounds.is_some_and(|b| b.contains(x, y)) {
                    prop_assert!(same(was, is), "{x},{y} outside {bounds:?}");
                }
            }
        }
        // The tightest window that is promised, and some larger ones: bit for bit the same.
        let Some(bounds) = bounds else { return Ok(()) };
        let around = bounds.grown(edit.margin(), &grid);
        let wider = SampleRect {
            west: around.west.saturating_sub(more[0]),
            south: around.south.saturating_sub(more[1]),
            east: (around.east + more[2]).min(SAMPLES[0] - 1),
            north: (around.north + more[3]).min(SAMPLES[1] - 1),
        };
        for rect in [around, wider] {
            let mut window = cut(&old, rect);
            edit.apply(&grid, &mut window, Some(&cut(&original, rect)));
            let expected = cut(&new, rect);
            prop_assert!(window.heights_m().iter().zip(expected.heights_m()).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn restoring_brings_back_what_was(edits in prop::collection::vec(any_edit(), 1..4), seed in any::<u64>()) {
        let grid = grid([10.0, 8.0]);
        let old = ground(seed);
        let mut window = old.clone();
        for edit in &edits {
            edit.apply(&grid, &mut window, Some(&old));
        }
        Edit::Restore(Area::Rect(whole())).apply(&grid, &mut window, Some(&old));
        prop_assert!(window.heights_m().iter().zip(old.heights_m()).all(|(a, b)| same(*a, *b)));
    }
}

#[test]
fn numbers_that_are_none_are_refused_by_name() {
    let grid = grid([10.0, 10.0]);
    let crater = Crater { centre_m: [1.0, 2.0], direction_deg: 0.0, radius_m: 5.0, depth_m: 1.0 };
    let brush =
        |action| Edit::Brush(Brush { action, centre_m: [1.0, 2.0], radius_m: 5.0, falloff: Falloff::Smooth });
    let stamp = |at, height| Edit::Stamp(Stamp::new(at, [1, 1], vec![height], StampMode::Set).unwrap());
    let disc = |radius_m| Area::Disc { centre_m: [0.0; 2], radius_m };
    let inside_out = Area::Rect(SampleRect { west: 3, south: 0, east: 2, north: 0 });
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 1e12] {
        let mut refused = vec![
            (Edit::Crater(Crater { radius_m: bad, ..crater }), "crater: the radius is"),
            (Edit::Crater(Crater { depth_m: bad, ..crater }), "crater: the depth is"),
            (brush(BrushAction::Raise(bad)), "raise: the strength is"),
            (brush(BrushAction::Lower(bad)), "lower: the strength is"),
            (brush(BrushAction::Smooth { strength: bad }), "smooth: the strength is"),
            (brush(BrushAction::Flatten { height_m: None, strength: bad }), "flatten: the strength is"),
            (Edit::Restore(disc(bad)), "restore: the radius is"),
            (Edit::Set { area: disc(bad), height_m: 0.0 }, "set: the radius is"),
        ];
        if bad != -1.0 {
            refused.extend([
                (
                    Edit::Crater(Crater { centre_m: [0.0, bad], ..crater }),
                    "crater: the centre's metres north",
                ),
                (Edit::Crater(Crater { direction_deg: bad, ..crater }), "crater: the direction is"),
                (Edit::Set { area: disc(1.0), height_m: bad }, "set: the height is"),
                (
                    brush(BrushAction::Flatten { height_m: Some(bad), strength: 1.0 }),
                    "flatten: the height is",
                ),
            ]);
            if !bad.is_nan() {
                refused.push((stamp([0, 0], bad), "stamp: the height of a sample is"));
            }
        }
        for (edit, says) in refused {
            let error = edit.check(&grid).unwrap_err().to_string();
            assert!(error.starts_with(says) && error.contains("give "), "{error}\nshould say: {says}");
        }
    }
    for (edit, says) in [
        (Edit::Crater(Crater { radius_m: 0.0, ..crater }), "radius is 0"),
        (stamp([0, 1 << 40], 0.0), "row it is placed at"),
        (Edit::Set { area: inside_out, height_m: 0.0 }, "inside out"),
    ] {
        assert!(edit.check(&grid).unwrap_err().to_string().contains(says));
    }
    assert!(
        Stamp::new([0, 0], [2, 2], vec![0.0; 3], StampMode::Set)
            .unwrap_err()
            .to_string()
            .contains("4 heights")
    );
    assert!(Stamp::new([0, 0], [0, 2], vec![], StampMode::Set).is_err());
    // A hole in a stamp is none.
    stamp([0, 0], f64::NAN).check(&grid).unwrap();
}

#[test]
fn an_edit_of_too_many_samples_is_refused() {
    let large = Grid::new([65_537, 65_537], [1.0, 1.0]).unwrap();
    let set = |side: u32| Edit::set(SampleRect { west: 0, south: 0, east: side - 1, north: side - 1 }, 0.0);
    assert_eq!(4096usize.pow(2), MAX_EDIT_SAMPLES);
    set(4096).check(&large).unwrap();
    let error = set(4097).check(&large).unwrap_err().to_string();
    assert!(error.contains("4097 x 4097") && error.contains("16777216"), "{error}");
}

#[test]
fn what_lies_outside_the_data_has_no_bounds() {
    let grid = grid([10.0, 10.0]);
    let crater = |x, y, radius_m| {
        Edit::Crater(Crater { centre_m: [x, y], direction_deg: 0.0, radius_m, depth_m: 1.0 }).bounds(&grid)
    };
    assert_eq!(crater(-50.0, 80.0, 20.0), None);
    assert_eq!(crater(1e9, 1e9, 20.0), None);
    assert_eq!(crater(5.0, 5.0, 1.0), None, "between samples");
    assert_eq!(crater(-30.0, 0.0, 20.0), Some(SampleRect { west: 0, south: 0, east: 1, north: 4 }));
    let whole_stamp = Stamp::of_window(&ground(1));
    assert_eq!(Edit::Stamp(whole_stamp).bounds(&grid), Some(whole()));
}
