//! What netCDF's attributes say of coordinates and numbers, in files made here, against arithmetic.

use super::cdf::{Axis, Values, words, write, write_bare};
use super::{Grid, at, refused, with};
use std::path::{Path, PathBuf};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::dem::Warning;

/// A grid of 9 by 7 samples, 3 a column and 7 a row on, at these coordinates.
fn made(folder: &Path, x: (&str, &[f64], &str), y: (&str, &[f64], &str)) -> PathBuf {
    let path = folder.join("a.nc");
    let z = Values::Floats((0..7).flat_map(|row| (0..9).map(move |col| height(col, row) as f32)).collect());
    write(&path, [&axis(x), &axis(y)], (&z, &[]), &[]);
    path
}

fn axis<'a>((name, numbers, unit): (&'a str, &[f64], &str)) -> Axis<'a> {
    let attributes = if unit.is_empty() { vec![] } else { vec![("units", words(unit))] };
    Axis { name, numbers: numbers.to_vec(), attributes }
}

fn height(col: u32, row: u32) -> f64 {
    f64::from(100 + 3 * col + 7 * row)
}

fn steps(count: u32, from: f64, step: f64) -> Vec<f64> {
    (0..count).map(|at| from + step * f64::from(at)).collect()
}

fn told(path: &Path) -> Vec<Warning> {
    open_with(&[path.to_owned()], &OpenOptions::default()).unwrap().warnings()
}

fn read(path: &Path) -> Grid {
    with(path, &OpenOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn angles_count_from_the_side_that_their_unit_names() {
    let folder = tempfile::tempdir().unwrap();
    let east = ["degrees_east", "degree_E", "degreesE", "degrees"];
    let west = ["degrees_west", "degree_west", "degrees_W", "degree_W", "degreesW", "degreeW"];
    let north = ["degrees_north", "degree_N", "degreesN", "degrees"];
    let south = ["degrees_south", "degree_south", "degrees_S", "degree_S", "degreesS", "degreeS"];
    let of = |names: &[&'static str], sign: f64| names.iter().map(|name| (*name, sign)).collect::<Vec<_>>();
    let across = [of(&east, 1.0), of(&west, -1.0)].concat();
    let down = [of(&north, 1.0), of(&south, -1.0)].concat();
    for (x_unit, x_sign) in &across {
        for (y_unit, y_sign) in &down {
            // Once by names that say which way they lie, once by units alone.
            for names in [["lon", "lat"], ["a", "b"]] {
                if names[0] == "a" && [x_unit, y_unit].contains(&&"degrees") {
                    continue;
                }
                let (x, y) = (steps(9, 10.0, 0.5), steps(7, 40.0, 0.5));
                let path = made(folder.path(), (names[0], &x, x_unit), (names[1], &y, y_unit));
                let grid = read(&path);
                assert_eq!(grid.info.georeference.unit, terrasoar_layout::dem::HorizontalUnit::Degree);
                for (col, row) in [(0, 0), (8, 0), (0, 6), (8, 6), (3, 2)] {
                    let found = at(&grid, x_sign * x[col as usize], y_sign * y[row as usize]);
                    assert_eq!(found, height(col, row), "{x_unit}, {y_unit}: {col}, {row}");
                }
            }
        }
    }
}

#[test]
fn angles_in_other_units_become_degrees() {
    let folder = tempfile::tempdir().unwrap();
    for (unit, per_degree) in [
        ("radians", 1f64.to_radians()),
        ("radian", 1f64.to_radians()),
        ("rad", 1f64.to_radians()),
        ("arc_minutes", 60.0),
        ("arcmin", 60.0),
        ("arc_second", 3600.0),
        ("gon", 1.0 / 0.9),
        ("0.001 degrees", 1000.0),
    ] {
        let of = |degrees: Vec<f64>| degrees.iter().map(|value| value * per_degree).collect::<Vec<_>>();
        let (x, y) = (of(steps(9, 10.0, 0.5)), of(steps(7, 40.0, 0.5)));
        let path = made(folder.path(), ("longitude", &x, unit), ("latitude", &y, unit));
        let grid = read(&path);
        for (col, row) in [(0, 0), (8, 6), (3, 2)] {
            let found = at(&grid, 10.0 + 0.5 * f64::from(col), 40.0 + 0.5 * f64::from(row));
            assert_eq!(found, height(col, row), "{unit}");
        }
    }
    let (x, y) = (steps(9, 10.0, 0.5), steps(7, 40.0, 0.5));
    let strange = made(folder.path(), ("lon", &x, "furlongs"), ("lat", &y, "degrees_north"));
    let said = refused(&strange, &OpenOptions::default());
    assert!(said.contains("\"furlongs\"") && said.contains("ncatted -a units,lon"), "{said}");
}

#[test]
fn lengths_of_two_units_meet_and_strangers_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let (x, y) = (steps(9, 600.0, 0.5), steps(7, 5_000_000.0, 500.0));
    let grid = read(&made(folder.path(), ("x", &x, "km"), ("y", &y, "m")));
    assert_eq!(at(&grid, 600.5, 5000.5), height(1, 1));
    let (x, y) = (steps(9, 600_000.0, 500.0), steps(7, 5_000_000.0, 500.0));
    let path = made(folder.path(), ("x", &x, "furlongs"), ("y", &y, "furlongs"));
    let said: Vec<String> = told(&path).iter().map(|warning| warning.words.clone()).collect();
    assert!(
        said.iter().any(|words| words.contains("\"furlongs\" of variable \"x\" is not known")),
        "{said:?}"
    );
    let path = made(folder.path(), ("x", &x, "m"), ("y", &steps(7, 40.0, 0.5), "degrees_north"));
    let said: Vec<String> = told(&path).iter().map(|warning| warning.words.clone()).collect();
    assert!(said.iter().any(|words| words.contains("is in degrees and the other one is not")), "{said:?}");
}

/// A grid of whole numbers of 16 bits, 0 to 62, and what its attributes make of it: the numbers that are data.
fn data(folder: &Path, about: &[(&str, Values)], z: Values) -> (Vec<f64>, Vec<String>) {
    let path = folder.join("v.nc");
    let (x, y) = (steps(9, 10.0, 0.5), steps(7, 46.0, -0.5));
    write(&path, [&axis(("lon", &x, "degrees_east")), &axis(("lat", &y, "degrees_north"))], (&z, about), &[]);
    let grid = read(&path);
    let found = grid.samples.iter().copied().filter(|value| !value.is_nan()).collect();
    (found, told(&path).into_iter().map(|warning| warning.words).collect())
}

#[test]
fn only_what_is_valid_is_data() {
    let folder = tempfile::tempdir().unwrap();
    let shorts = || Values::Shorts((0..63).collect());
    let whole = |from: i32, to: i32| (from..=to).map(f64::from).collect::<Vec<_>>();
    let packed =
        || [("scale_factor", Values::Doubles(vec![0.5])), ("add_offset", Values::Doubles(vec![100.0]))];
    let range = |low: i16, high: i16| ("valid_range", Values::Shorts(vec![low, high]));
    let of = |about: &[(&str, Values)]| data(folder.path(), about, shorts()).0;
    assert_eq!(of(&[range(10, 20)]), whole(10, 20));
    assert_eq!(of(&[("valid_min", Values::Shorts(vec![50]))]), whole(50, 62));
    assert_eq!(of(&[("valid_max", Values::Floats(vec![7.5]))]), whole(0, 7));
    let both = [("valid_min", Values::Shorts(vec![5])), ("valid_max", Values::Shorts(vec![6]))];
    assert_eq!(of(&both), whole(5, 6));
    // In packed numbers, whatever they become.
    assert_eq!(of(&[&packed()[..], &[range(10, 20)]].concat()), whole(10, 20));
    let missing = ("missing_value", Values::Shorts(vec![11, 13]));
    assert_eq!(of(&[range(10, 14), missing]), [10.0, 12.0, 14.0]);
    // Numbers without a sign, in a file whose type has one.
    let unsigned = [("_Unsigned", words("true")), ("valid_range", Values::Bytes(vec![10, -6]))];
    let bytes = Values::Bytes((0..63).map(|at| (at * 4) as u8 as i8).collect());
    let (found, _) = data(folder.path(), &unsigned, bytes);
    assert_eq!(found, (3..=62).map(|at| f64::from(at * 4)).collect::<Vec<_>>());
    // What cannot be meant is left out and said.
    for (about, word) in [
        (range(20, 10), "valid_range"),
        (("valid_range", Values::Shorts(vec![3])), "valid_range"),
        (("valid_min", words("low")), "valid_min"),
        (("scale_factor", words("half")), "scale_factor"),
        (("scale_factor", Values::Doubles(vec![0.0])), "the scale 0 (attribute scale_factor"),
    ] {
        let (found, said) = data(folder.path(), &[about], shorts());
        assert_eq!(found, whole(0, 62), "{word}");
        assert!(said.iter().any(|said| said.contains(word)), "{word}: {said:?}");
    }
    let reals = ("valid_range", Values::Doubles(vec![10.0, 20.0]));
    let (found, said) = data(folder.path(), &[&packed()[..], &[reals]].concat(), shorts());
    assert!(found == whole(10, 20) && said.iter().any(|said| said.contains("taken as packed")), "{said:?}");
}

/// Grids without coordinates: the mapping may state their place, and else nothing says which side the rows begin on.
#[test]
fn grids_without_coordinates_have_the_place_of_their_mapping_or_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nc");
    let z = Values::Floats((0..7).flat_map(|row| (0..9).map(move |col| height(col, row) as f32)).collect());
    let write_with = |more: &[(&str, &[(&str, Values)])]| {
        write_bare(&path, [9, 7], (&z, &[("grid_mapping", words("crs"))]), more);
    };
    write_with(&[("crs", &[("GeoTransform", words("500 10 0 900 0 -10 "))])]);
    let grid = read(&path);
    assert_eq!(grid.info.georeference.pixel_to_crs, Some([505.0, 10.0, 0.0, 895.0, 0.0, -10.0]));
    assert_eq!(at(&grid, 505.0, 895.0), height(0, 0));
    assert_eq!(at(&grid, 585.0, 835.0), height(8, 6));
    assert!(told(&path).iter().all(|warning| !warning.words.contains("first row")));
    write_with(&[("crs", &[("GeoTransform", words("500 10 0 900 0 0"))])]);
    assert_eq!(read(&path).info.georeference.pixel_to_crs, None);
    let told = told(&path);
    assert!(
        told.iter().any(|warning| warning.words.contains("on which side its first row lies")),
        "{told:?}"
    );
}

/// A bathymetry (BAG) is HDF5 with rows from the south and its place in a text: read as netCDF it lay upside down.
#[test]
fn bathymetric_attributed_grids_are_refused() {
    let said = refused(
        &super::fixture("utm.bag"),
        &OpenOptions { band: Some("BAG_root/elevation".into()), ..OpenOptions::default() },
    );
    assert!(said.contains("Bathymetric Attributed Grid") && said.contains("gdal_translate"), "{said}");
}
