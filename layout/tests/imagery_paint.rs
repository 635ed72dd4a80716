//! Paint on draped pictures against a reference made of whole decoded levels: every texel of every level, every copy of every block, and the bytes of all that is not touched.

mod common;

use common::open_bytes;
use common::paint::{Seen, linear, painter_of, srgb, written};
use common::paint_reference::*;
use proptest::prelude::*;
use std::sync::Arc;
use terrasoar_layout::edit::Crater;
use terrasoar_layout::imagery::{Imagery, Paint, Painter, Region, Scorch, TileFormat, TileId};
use terrasoar_layout::verify::verify;

#[test]
fn paint_is_what_the_reference_says_in_every_level_and_copy() {
    for format in FORMATS {
        for has_alpha in [false, true] {
            let Some(bytes) = file(format, smooth(has_alpha), SIZE) else { continue };
            let mut painter = painter_of(bytes.clone());
            let original = Seen::of(&painter);
            let mut before = Seen::of(&painter);
            for paint in paints() {
                let changes = painter.paint(&[paint]).unwrap();
                let after = Seen::of(&painter);
                check(&before, &after, &changes.tiles, &paint);
                assert!(!changes.tiles.is_empty() || has_alpha, "{paint:?}");
                before = after;
            }
            // One batch makes the same.
            let mut whole = painter_of(bytes);
            whole.paint(&paints()).unwrap();
            assert!(Seen::of(&whole) == before, "{format:?}: batches matter");
            painter.paint(&[Paint::Restore(EVERYTHING)]).unwrap();
            assert!(Seen::of(&painter) == original, "{format:?} {has_alpha}: restoring leaves something");
            assert!(painter.section(9000).unwrap().is_none());
        }
    }
}

/// The formula of a fill, and what a scorch may do, texel by texel where nothing is encoded.
#[test]
fn plain_texels_are_painted_by_the_formula() {
    let bytes = file(TileFormat::Rgba8, smooth(true), SIZE).unwrap();
    let mut painter = painter_of(bytes);
    let before = Seen::of(&painter).levels.swap_remove(0);
    painter.paint(&[fill(disc(600.0, 300.0, 100.0), [220, 40, 10], 0.6, 50.0)]).unwrap();
    let filled = Seen::of(&painter).levels.swap_remove(0);
    painter.paint(&[scorch(600.0, 300.0, 40.0)]).unwrap();
    let burnt = Seen::of(&painter).levels.swap_remove(0);
    let (mut darker, mut sums) = (0, [0.0; 2]);
    for (x, y) in (0..531).flat_map(|y| (0..1102).map(move |x| (x, y))) {
        let depth = 100.0 - (f64::from(x) + 0.5 - 600.0).hypot(f64::from(y) + 0.5 - 300.0);
        let (old, new) = (before.at(x, y), filled.at(x, y));
        let weight = 0.6 * (depth / 50.0).clamp(0.0, 1.0);
        let alpha = f64::from(old[3]) / 255.0;
        let sum = alpha * (1.0 - weight) + weight;
        assert!((f64::from(new[3]) - 255.0 * sum).abs() <= 1.0);
        for (c, colour) in [220.0, 40.0, 10.0].into_iter().enumerate() {
            let light = linear(f64::from(old[c])) * alpha * (1.0 - weight) + linear(colour) * weight;
            let wanted = if sum > 0.0 { srgb(light / sum) } else { 0.0 };
            let most = if new[3] < 32 { 255.0 / f64::from(new[3].max(1)) } else { 1.0 };
            let found = f64::from(new[c]);
            assert!(new[3] == 0 || (found - wanted).abs() <= most, "{x} {y}: {found} {wanted}");
        }
        let last = burnt.at(x, y);
        let distance = (f64::from(x) + 0.5 - 600.0).hypot(f64::from(y) + 0.5 - 300.0);
        assert_eq!(last[3], new[3]);
        assert!((0..3).all(|c| last[c] <= new[c]) && (distance < 40.0 || last == new), "{x} {y}");
        darker += u32::from(last != new);
        for (ring, sum) in sums.iter_mut().enumerate() {
            if distance < 40.0 && (distance < 15.0) == (ring == 0) {
                *sum += f64::from(last[0]) / f64::from(new[0].max(1));
            }
        }
    }
    assert!((2000..5100).contains(&darker), "{darker}");
    let [inner, outer] = [sums[0] / 707.0, sums[1] / 4320.0];
    assert!(inner < 0.65 && outer > inner + 0.2, "{inner} {outer}");
}

#[test]
fn restoring_a_part_leaves_the_rest_and_goes_back_exactly() {
    for format in FORMATS {
        let Some(bytes) = file(format, smooth(true), SIZE) else { continue };
        let mut painter = painter_of(bytes);
        let original = Seen::of(&painter);
        painter
            .paint(&[fill(disc(520.0, 500.0, 60.0), [250, 250, 0], 1.0, 0.0), scorch(900.0, 80.0, 30.0)])
            .unwrap();
        let painted = Seen::of(&painter);
        let half = Region::Rect { from_m: [0.0, 0.0], to_m: [520.0, 531.0] };
        painter.paint(&[Paint::Restore(half)]).unwrap();
        let after = Seen::of(&painter);
        for id in original.shape.ids() {
            for (place, block, was, is) in Seen::blocks(&original, &after, id) {
                // A coarser block that reaches over the border is a mixture.
                let size = 4 << id.level;
                if (block[0] + 1) * size <= 520 {
                    assert_eq!(was, is, "{format:?} {id:?} {place:?}");
                }
                if block[0] * size > 520 {
                    let painted = painted.block(id, place);
                    assert_eq!(painted, is, "{format:?} {id:?} {place:?}");
                }
            }
        }
        painter.paint(&[Paint::Restore(disc(560.0, 500.0, 80.0))]).unwrap();
        painter.paint(&[Paint::Restore(disc(900.0, 80.0, 31.0))]).unwrap();
        let back = Seen::of(&painter);
        for id in original.shape.ids() {
            for (place, block, was, is) in Seen::blocks(&original, &back, id) {
                assert_eq!(was, is, "{format:?} {id:?} {place:?} {block:?}");
            }
        }
        assert!(back == original, "{format:?}");
        assert!(painter.section(9000).unwrap().is_none());
    }
}

#[test]
fn a_section_holds_what_was_painted_and_may_be_painted_on() {
    for format in FORMATS {
        let Some(bytes) = file(format, smooth(true), SIZE) else { continue };
        let mut painter = painter_of(bytes.clone());
        let original = Seen::of(&painter);
        let as_built = open_bytes(bytes.clone()).unwrap().header().imagery.unwrap();
        // A tile that was absent appears.
        let absent = TileId { level: 0, x: 0, y: 0 };
        let mut tile = Vec::new();
        assert!(!painter.read_tile(absent, &mut tile).unwrap());
        painter.paint(&[fill(disc(200.0, 300.0, 20.0), [50, 60, 70], 1.0, 0.0)]).unwrap();
        let first_page = bytes.len().div_ceil(4096) as u32;
        let painted = painter.painted();
        let section = painter.section(first_page).unwrap().unwrap();
        let file = written(bytes, &section);
        painter.committed(section);
        assert!(painter.is_committed() && painter.section(first_page).unwrap().is_none());
        let seen = Seen::of(&painter);
        let terrain = Arc::new(open_bytes(file.clone()).unwrap());
        let report = verify(&terrain, &|_| {}).unwrap();
        assert!(report.is_sound(), "{format:?}: {:?}", report.problems);
        let imagery = Imagery::open(&terrain).unwrap().unwrap();
        assert!(imagery.has_tile(absent));
        for id in painted {
            let Some(average) = imagery.average(id) else { continue };
            let mean = seen.mean(id);
            assert!(
                (0..4).all(
                    |c| (f64::from(average[c]) - mean[c]).abs() <= if mean[3] < 32.0 { 2.0 } else { 1.0 }
                ),
                "{id:?} {average:?} {mean:?}"
            );
        }
        // What is before all paint is known after opening it anew.
        let current = terrain.header().imagery.unwrap();
        let mut again =
            Painter::open_at(Arc::clone(&terrain), current, as_built, terrain.header().file_bytes).unwrap();
        assert!(Seen::of(&again) == seen, "{format:?}");
        again.paint(&[scorch(210.0, 310.0, 15.0)]).unwrap();
        let taken_back = again.roll_back();
        assert!(!taken_back.tiles.is_empty() && Seen::of(&again) == seen && again.is_committed());
        again.paint(&[scorch(210.0, 310.0, 15.0), Paint::Restore(disc(200.0, 300.0, 40.0))]).unwrap();
        assert!(Seen::of(&again) == original, "{format:?}");
        let next = (file.len() / 4096) as u32;
        let section = again.section(next).unwrap().unwrap();
        let back = open_bytes(written(file.clone(), &section)).unwrap();
        let restored = Imagery::open(&back).unwrap().unwrap();
        assert!(!restored.has_tile(absent));
        assert_eq!(
            restored.stored_tiles(),
            Imagery::open(&open_bytes(file).unwrap()).unwrap().unwrap().stored_tiles() - 1
        );
        assert!(verify(&back, &|_| {}).unwrap().is_sound());
        again.committed(section);
        // Undo: the tiles that differ between the two states.
        let state = again.state_at(current, terrain.header().file_bytes).unwrap().unwrap();
        let undone = again.turn_to(state);
        assert!(undone.tiles.contains(&absent) && Seen::of(&again) == seen);
    }
}

/// What a commit took may fail to be written while paint goes on.
#[test]
fn paint_goes_on_while_a_section_is_written() {
    let bytes = file(TileFormat::Bc1, smooth(false), SIZE).unwrap();
    let first_page = bytes.len().div_ceil(4096) as u32;
    let mut painter = painter_of(bytes.clone());
    painter.paint(&[scorch(500.0, 300.0, 30.0)]).unwrap();
    let first = Seen::of(&painter);
    let section = painter.section(first_page).unwrap().unwrap();
    painter.paint(&[scorch(510.0, 310.0, 30.0)]).unwrap();
    let second = Seen::of(&painter);
    painter.roll_back();
    assert!(Seen::of(&painter) == first && !painter.is_committed());
    painter.paint(&[scorch(510.0, 310.0, 30.0)]).unwrap();
    // The first failed: the next has both.
    drop(section);
    let section = painter.section(first_page).unwrap().unwrap();
    let both = painter_of(written(bytes, &section));
    assert!(Seen::of(&both) == second);
    painter.paint(&[scorch(90.0, 90.0, 30.0)]).unwrap();
    painter.committed(section);
    assert!(!painter.is_committed(), "the third is in no section yet");
}

#[test]
fn a_damaged_tile_is_named_and_nothing_changes() {
    let mut bytes = file(TileFormat::Bc1, smooth(false), SIZE).unwrap();
    let terrain = open_bytes(bytes.clone()).unwrap();
    let section = terrain.header().imagery.unwrap().offset as usize;
    // The directory's fifth entry: tile 1, 1 of level 0.
    let at = section + 4096 + 4 * 16;
    let page = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    bytes[page * 4096 + 77] ^= 1;
    let mut painter = painter_of(bytes);
    let fine = fill(disc(100.0, 100.0, 9.0), [1, 2, 3], 1.0, 0.0);
    painter.paint(&[fine]).unwrap();
    let read = |painter: &Painter| {
        painter
            .shape()
            .ids()
            .filter(|id| *id != TileId { level: 0, x: 1, y: 1 })
            .map(|id| {
                let mut tile = Vec::new();
                painter.read_tile(id, &mut tile).unwrap();
                tile
            })
            .collect::<Vec<_>>()
    };
    let before = read(&painter);
    let bad = scorch(504.0, 504.0, 20.0);
    for _ in 0..2 {
        let error = painter.paint(&[scorch(300.0, 90.0, 30.0), bad]).unwrap_err().to_string();
        assert!(error.contains("tile 1, 1 of level 0") && error.contains("checksum"), "{error}");
        assert!(painter.prepare(&[bad]).is_err());
        assert!(read(&painter) == before);
    }
    painter.paint(&[scorch(300.0, 90.0, 30.0)]).unwrap();
    assert!(painter.paint(&[fine, scorch(0.0, 0.0, f64::NAN)]).unwrap_err().to_string().contains("radius"));
}

#[test]
fn what_lies_beside_the_picture_changes_nothing() {
    let mut painter = painter_of(file(TileFormat::Bc1, smooth(false), SIZE).unwrap());
    let crater = Crater { centre_m: [-50.0, -50.0], direction_deg: 0.0, radius_m: 20.0, depth_m: 5.0 };
    let changes =
        painter.paint(&[Paint::scorch_of(&crater), fill(disc(2000.0, 5.0, 800.0), [9; 3], 1.0, 0.0)]);
    assert_eq!(changes.unwrap(), Default::default());
    assert!(painter.is_committed());
}

fn any_region() -> impl Strategy<Value = Region> {
    let disc =
        (-30.0..1130.0, -30.0..560.0, 0.2..90.0).prop_map(|(east, north, radius)| disc(east, north, radius));
    let rect = (-30.0..1100.0, -30.0..530.0, 0.2..150.0, 0.2..150.0).prop_map(|(east, north, wide, high)| {
        Region::Rect { from_m: [east, north], to_m: [east + wide, north + high] }
    });
    prop_oneof![disc, rect]
}

fn any_paint() -> impl Strategy<Value = Paint> {
    let scorched = (-30.0..1130.0, -30.0..560.0, 0.5..60.0, 0.0..360.0, 0.1..1.0).prop_map(
        |(east, north, radius_m, direction_deg, strength)| {
            Paint::Scorch(Scorch { centre_m: [east, north], radius_m, direction_deg, strength })
        },
    );
    let filled = (any_region(), any::<[u8; 3]>(), 0.0..=1.0, 0.0..30.0)
        .prop_map(|(region, colour, opacity, falloff)| fill(region, colour, opacity, falloff));
    prop_oneof![3 => scorched, 3 => filled, 1 => any_region().prop_map(Paint::Restore)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Any sequence: copies agree, what a restore leaves is right, all of it goes back.
    #[test]
    fn any_paints_agree_in_all_tiles_and_go_back(
        paints in proptest::collection::vec(any_paint(), 1..6),
        has_alpha in any::<bool>(),
        format in 0..3usize,
    ) {
        let Some(bytes) = file(FORMATS[format], smooth(has_alpha), SIZE) else { return Ok(()) };
        let mut painter = painter_of(bytes);
        let original = Seen::of(&painter);
        let mut before = Seen::of(&painter);
        for paint in &paints {
            let changes = painter.paint(&[*paint]).unwrap();
            let after = Seen::of(&painter);
            if !matches!(paint, Paint::Restore(_)) {
                check(&before, &after, &changes.tiles, paint);
            }
            for rect in &changes.rects {
                let size = before.shape.level_texels(rect.level);
                prop_assert!((0..2).all(|axis| rect.from[axis] <= rect.to[axis] && rect.to[axis] < size[axis]));
            }
            for level in 0..before.shape.levels {
                let canvases = [&before, &after].map(|seen| &seen.levels[level as usize]);
                for (x, y) in (0..canvases[0].high).flat_map(|y| (0..canvases[0].wide).map(move |x| (x, y))) {
                    let is_in = |r: &terrasoar_layout::imagery::TexelRect| r.level == level
                        && (r.from[0]..=r.to[0]).contains(&(x as u32)) && (r.from[1]..=r.to[1]).contains(&(y as u32));
                    if canvases[0].at(x, y) != canvases[1].at(x, y) && !changes.rects.iter().any(is_in) {
                        prop_assert!(false, "level {} texel {} {} changed outside of what was told", level, x, y);
                    }
                }
            }
            before = after;
        }
        painter.paint(&[Paint::Restore(EVERYTHING)]).unwrap();
        prop_assert!(Seen::of(&painter) == original);
        prop_assert!(painter.section(9000).unwrap().is_none());
    }
}
