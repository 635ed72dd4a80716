//! Which file counts where several overlap, on one grid and on unlike ones; units; seams.

use crate::ground::{Patch, at, inside};
use crate::import_support::{Grid, collect};
use std::path::PathBuf;
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, Priority, Resampling, open_with};
use terrasoar_layout::dem::SampleType;

pub(crate) fn read(paths: &[PathBuf], options: &OpenOptions) -> Grid {
    collect(&*open_with(paths, options).unwrap_or_else(|error| panic!("{error}"))).unwrap()
}

fn by(priority: Priority) -> OpenOptions {
    OpenOptions { priority, ..OpenOptions::default() }
}

/// The height at map coordinates of a sample's centre.
pub(crate) fn height(grid: &Grid, x: f64, y: f64) -> f64 {
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    let [col, row] = [(x - map[0]) / map[1], (y - map[3]) / map[5]];
    assert!((col - col.round()).abs() < 1e-6 && (row - row.round()).abs() < 1e-6, "{col} {row}");
    grid.at(col.round() as u32, row.round() as u32)
}

const UTM: &str = "EPSG:32632";

#[test]
fn on_one_grid_the_priority_decides_and_voids_never_count() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    // a lies from x 0 to 1000, b from 500 to 1500, both 1000 high; b has a hole; "0-c.asc" comes first by name.
    let a = at(0.0, 1000.0, 10.0).write(file("a.asc"), UTM, |x, _| 100.0 + x / 10.0);
    let b = at(500.0, 1000.0, 10.0).write(file("b.asc"), UTM, |x, y| {
        if (700.0..800.0).contains(&x) && y > 500.0 { f64::NAN } else { 150.0 }
    });
    let c = at(500.0, 1000.0, 10.0).write(file("0-c.asc"), UTM, |_, _| 120.0);
    let cases = [
        (Priority::First, [&a, &b, &c], [155.5, 175.5, 150.0]),
        (Priority::Last, [&a, &b, &c], [120.0, 120.0, 120.0]),
        (Priority::Last, [&c, &a, &b], [150.0, 175.5, 150.0]),
        (Priority::Highest, [&b, &a, &c], [155.5, 175.5, 150.0]),
        (Priority::Finest, [&b, &a, &c], [120.0, 120.0, 120.0]),
    ];
    for (priority, files, wanted) in cases {
        let files = files.map(Clone::clone);
        let grid = read(&files, &by(priority));
        assert_eq!([grid.info.samples_wide, grid.info.samples_high], [150, 100]);
        // Over all three; over the hole of b; beyond a.
        let found = [(555.0, 105.0), (755.0, 905.0), (1205.0, 505.0)].map(|(x, y)| height(&grid, x, y));
        assert_eq!(found, wanted, "{priority:?}");
        assert_eq!(grid.voids(), 0);
    }
    // The hole of b is filled by what lies below, whatever counts.
    for priority in [Priority::First, Priority::Last, Priority::Finest, Priority::Highest] {
        let grid = read(&[b.clone(), a.clone()], &by(priority));
        assert_eq!(height(&grid, 755.0, 755.0), 175.5, "{priority:?}");
        assert_eq!(height(&grid, 5.0, 5.0), 100.5, "{priority:?}");
    }
}

/// A file that is named twice counts where it is on top: by its first mention, or by its last.
#[test]
fn of_a_file_named_twice_the_mention_counts_that_is_on_top() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let a = at(0.0, 1000.0, 10.0).write(file("a.asc"), UTM, |_, _| 1.0);
    let b = at(0.0, 1000.0, 10.0).write(file("b.asc"), UTM, |_, _| 2.0);
    for (priority, files, wanted) in [
        (Priority::Last, [&a, &b, &a], 1.0),
        (Priority::Last, [&b, &a, &b], 2.0),
        (Priority::Last, [&a, &a, &b], 2.0),
        (Priority::First, [&a, &b, &a], 1.0),
        (Priority::First, [&b, &a, &b], 2.0),
    ] {
        let grid = read(&files.map(Clone::clone), &by(priority));
        assert!(grid.samples.iter().all(|height| *height == wanted), "{priority:?} {files:?}");
    }
}

/// Of files with the same steps the first by name counts, also where another one between them lies half a step off.
#[test]
fn of_files_alike_the_first_by_name_counts_across_grids() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let a = Patch { samples: [30, 100], west: 0.0, north: 1000.0, step: 10.0 };
    let a = a.write(file("a.asc"), UTM, |_, _| 1.0);
    let m = Patch { samples: [60, 99], west: 5.0, north: 1005.0, step: 10.0 };
    let m = m.write(file("m.asc"), UTM, |_, _| 2.0);
    let z = at(0.0, 1000.0, 10.0).write(file("z.asc"), UTM, |_, _| 3.0);
    for files in [[&a, &m, &z], [&z, &a, &m]] {
        let grid = read(&files.map(Clone::clone), &by(Priority::Finest));
        let found = [105.0, 205.0, 405.0, 805.0].map(|x| height(&grid, x, 505.0));
        assert_eq!(found, [1.0, 1.0, 2.0, 3.0], "{files:?}");
    }
}

/// Tiles of `.hgt` that could be read as one grid are a mosaic where something is asked for that only mosaics do.
#[test]
fn tiles_are_blended_and_thinned_as_other_files_are() {
    let folder = tempdir().unwrap();
    let tile = |name: &str, height: i16| {
        let path = inside(folder.path(), name);
        crate::import_support::write_hgt(&path, 61, |_, _| height);
        path
    };
    let tiles = [tile("N10E010.hgt", 100), tile("N10E011.hgt", 200)];
    let plain = read(&tiles, &OpenOptions::default());
    assert_eq!((plain.info.samples_wide, plain.at(59, 30), plain.at(60, 30)), (121, 100.0, 200.0));
    // Both have the border's samples; beside it each is blended with nothing.
    let soft = read(&tiles, &OpenOptions { feather_m: Some(20_000.0), ..OpenOptions::default() });
    assert_eq!((soft.info.samples_wide, soft.at(59, 30), soft.at(61, 30)), (121, 100.0, 200.0));
    assert!((140.0..150.0).contains(&soft.at(60, 30)), "{}", soft.at(60, 30));
    let thin = read(&tiles, &OpenOptions { resolution: Some(20_000.0), ..OpenOptions::default() });
    let step = thin.info.georeference.pixel_to_crs.unwrap()[1];
    assert!((step * 111_319.49 - 20_000.0).abs() < 1.0, "{step}");
    for wrong in [
        OpenOptions { feather_m: Some(20_000.0), ..OpenOptions::default() },
        OpenOptions { resolution: Some(20_000.0), ..OpenOptions::default() },
    ] {
        let refused = open_with(&tiles[..1], &wrong).err().unwrap().to_string();
        assert!(refused.contains("several files"), "{refused}");
    }
}

/// A finer file in the middle of a coarser one, in another system, in feet: the plane that both show is continuous.
#[test]
fn unlike_steps_systems_and_units_show_one_plane() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let plane = |x: f64, y: f64| 1000.0 + (x - 500_000.0) / 10.0 + (y - 5_000_000.0) / 20.0;
    let coarse = Patch { samples: [120, 120], west: 500_000.0, north: 5_003_600.0, step: 30.0 };
    let coarse = coarse.write(file("coarse.asc"), UTM, plane);
    let fine = at(501_000.0, 5_002_000.0, 10.0);
    let feet = fine.write(file("fine.asc"), "EPSG:32632+6360", |x, y| plane(x, y) / (1200.0 / 3937.0));
    let grid = read(&[coarse.clone(), feet], &by(Priority::Finest));
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    assert_eq!([map[1], map[5]], [10.0, -10.0]);
    let mut seen = 0;
    for row in 3..grid.info.samples_high - 3 {
        for col in 3..grid.info.samples_wide - 3 {
            let wanted = plane(map[0] + map[1] * f64::from(col), map[3] + map[5] * f64::from(row));
            assert!((grid.at(col, row) - wanted).abs() < 2e-3, "{col} {row}: {} {wanted}", grid.at(col, row));
            seen += 1;
        }
    }
    assert!(seen > 100_000 && grid.info.sample_type == SampleType::F32 && grid.info.height_scale == 1.0);
    let said = &grid.info.about.origins;
    assert!(said.iter().any(|(_, words)| words.contains("metre") && words.contains("foot")), "{said:?}");
    // A degree grid of the same plane, seen from the UTM grid's system.
    let degrees = Patch { samples: [60, 60], west: 9.0, north: 45.17, step: 0.0005 };
    let over = degrees.write(file("degrees.asc"), "EPSG:4326", |_, _| 5000.0);
    let grid = read(&[coarse.clone(), over.clone()], &by(Priority::Highest));
    assert_eq!(grid.info.georeference.epsg, Some(32632));
    let (covered, all) = (grid.samples.iter().filter(|h| **h == 5000.0).count(), grid.samples.len());
    assert!(covered > 3000 && covered < all, "{covered} of {all}");
    // Asked for, another system takes both, resampled once.
    let options =
        OpenOptions { reproject: Some("EPSG:3035".into()), resolution: Some(25.0), ..by(Priority::First) };
    let grid = read(&[coarse, over], &options);
    assert_eq!(grid.info.georeference.epsg, Some(3035));
    assert_eq!(grid.info.georeference.pixel_to_crs.unwrap()[1], 25.0);
}

#[test]
fn integers_stay_integers_and_one_grid_is_not_resampled() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let a = at(0.0, 1000.0, 10.0).write(file("a.asc"), UTM, |x, y| (x + y).round());
    let b = at(1000.0, 1000.0, 10.0).write(file("b.asc"), UTM, |x, y| (x * y / 100.0).round());
    let alone = read(std::slice::from_ref(&a), &OpenOptions::default());
    let both = read(&[a.clone(), b], &OpenOptions::default());
    assert_eq!(both.info.sample_type, alone.info.sample_type);
    for row in 0..100 {
        for col in 0..100 {
            assert_eq!(both.at(col, row), alone.at(col, row));
        }
    }
    // Half a step off, nearest samples of it are numbers of it.
    let c = at(5.0, 995.0, 10.0).write(file("c.asc"), UTM, |_, _| 77.0);
    let options = OpenOptions {
        resampling: Some(Resampling::Nearest),
        priority: Priority::Last,
        ..OpenOptions::default()
    };
    let grid = read(&[a, c], &options);
    assert!(grid.samples.iter().filter(|h| **h == 77.0).count() >= 9801);
}

#[test]
fn seams_are_blended_on_request_and_lone_ground_is_not() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let a = at(0.0, 1000.0, 10.0).write(file("a.asc"), UTM, |_, _| 100.0);
    let b = at(500.0, 1000.0, 10.0).write(file("b.asc"), UTM, |_, _| 200.0);
    let plain = read(&[a.clone(), b.clone()], &by(Priority::First));
    assert_eq!(height(&plain, 995.0, 505.0), 100.0);
    assert_eq!(height(&plain, 1005.0, 505.0), 200.0);
    for priority in [Priority::First, Priority::Last, Priority::Finest] {
        let options = OpenOptions { feather_m: Some(200.0), ..by(priority) };
        let grid = read(&[a.clone(), b.clone()], &options);
        assert_eq!(
            [height(&grid, 255.0, 505.0), height(&grid, 1255.0, 505.0)],
            [100.0, 200.0],
            "{priority:?}"
        );
        // Along the middle no step is larger than the blend allows, from either edge.
        let steps = (0..149).map(|col| (grid.at(col + 1, 50) - grid.at(col, 50)).abs());
        let largest = steps.fold(0.0, f64::max);
        assert!(largest > 1.0 && largest <= 100.0 * 10.0 / 200.0 + 3.0, "{priority:?}: {largest}");
    }
    let wrong = OpenOptions { feather_m: Some(200.0), ..by(Priority::Highest) };
    assert!(open_with(&[a.clone(), b.clone()], &wrong).err().unwrap().to_string().contains("highest"));
    let wide = OpenOptions { feather_m: Some(5000.0), ..by(Priority::First) };
    assert!(open_with(&[a, b], &wide).err().unwrap().to_string().contains("wider than 256 samples"));
}

#[test]
fn files_on_both_sides_of_180_degrees_lie_together() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let west = at(179.0, -17.0, 0.01).write(file("w.asc"), "EPSG:4326", |_, _| 1.0);
    let east = at(-180.0, -17.0, 0.01).write(file("e.asc"), "EPSG:4326", |_, _| 2.0);
    let grid = read(&[west, east], &OpenOptions::default());
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [200, 100]);
    assert_eq!([grid.at(0, 0), grid.at(199, 99)], [1.0, 2.0]);
    assert!((grid.info.georeference.pixel_to_crs.unwrap()[0] - 179.005).abs() < 1e-9);
    // Brought to the map of the web, or on it before: it is cut there as well.
    const HALF: f64 = 20_037_508.342_789_244;
    let map = OpenOptions {
        reproject: Some("EPSG:3857".into()),
        resolution: Some(1000.0),
        ..OpenOptions::default()
    };
    let both = [file("w.asc"), file("e.asc")];
    let brought = read(&both, &map);
    let [wide, high] = [brought.info.samples_wide, brought.info.samples_high];
    assert!((220..=226).contains(&wide) && (112..=120).contains(&high), "{wide} x {high}");
    assert_eq!([brought.at(5, 50), brought.at(wide - 6, 50)], [1.0, 2.0]);
    let web = |name: &str, west: f64, value: f64| {
        at(west, -1_900_000.0, HALF / 20_000.0).write(file(name), "EPSG:3857", |_, _| value)
    };
    // A hundred steps on either side.
    let (left, right) = (web("left.asc", HALF * 0.995, 3.0), web("right.asc", -HALF, 4.0));
    let joined = read(&[right.clone(), left.clone()], &OpenOptions::default());
    assert_eq!([joined.info.samples_wide, joined.info.samples_high], [200, 100]);
    assert_eq!([joined.at(99, 50), joined.at(100, 50)], [3.0, 4.0]);
    // And out of it into a zone that both lie in.
    let zone = OpenOptions { reproject: Some("EPSG:32701".into()), ..OpenOptions::default() };
    let zone = read(&[left, right], &zone);
    assert!(zone.info.samples_wide < 260, "{}", zone.info.samples_wide);
    let count = |value: f64| zone.samples.iter().filter(|sample| **sample == value).count();
    assert!(count(3.0) > 5000 && count(4.0) > 5000, "{} {}", count(3.0), count(4.0));
}

#[test]
fn files_on_both_sides_of_0_degrees_lie_together_where_longitudes_run_to_360() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let east = at(0.0, 45.0, 0.01).write(file("e.asc"), "EPSG:4326", |_, _| 2.0);
    let west = at(359.0, 45.0, 0.01).write(file("w.asc"), "EPSG:4326", |_, _| 1.0);
    for paths in [[&east, &west], [&west, &east]] {
        let grid = read(&paths.map(Clone::clone), &OpenOptions::default());
        assert_eq!([grid.info.samples_wide, grid.info.samples_high], [200, 100]);
        assert_eq!(
            [grid.at(0, 0), grid.at(99, 50), grid.at(100, 50), grid.at(199, 99)],
            [1.0, 1.0, 2.0, 2.0]
        );
        assert!((grid.info.georeference.pixel_to_crs.unwrap()[0] + 0.995).abs() < 1e-9);
    }
}
