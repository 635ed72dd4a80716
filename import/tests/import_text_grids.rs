//! Esri ASCII grids and XYZ grids: every spelling of one ground gives that ground, and what is wrong is said.

mod import_support;

use import_support::{Grid, Random, read, refusal};
use std::path::PathBuf;
use tempfile::{TempDir, tempdir};

fn file(name: &str, text: impl AsRef<[u8]>) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn grid(name: &str, text: impl AsRef<[u8]>) -> Grid {
    let (_folder, path) = file(name, text);
    read(&[path]).unwrap_or_else(|error| panic!("{error}"))
}

fn said(name: &str, text: impl AsRef<[u8]>) -> String {
    let (_folder, path) = file(name, text);
    refusal(&[path])
}

const PLACE: [f64; 6] = [105.0, 10.0, 0.0, 215.0, 0.0, -10.0];

#[test]
fn one_ground_in_every_spelling_of_an_ascii_grid() {
    let corner = "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\n";
    let texts = [
        format!("{corner}NODATA_value -9999\n1.5 2 3\n4 -9999 6.25\n"),
        format!("{corner}nodata_VALUE -9999.0\r\n1.5 2 3\r\n4 -9999 6.25\r\n"),
        format!("\u{feff}{corner}1.5\n2\n3\n4\n   nan\n\n6.25"),
        format!("{corner}1.5 2 3 4 NaN 6.25"),
        "NROWS 2\nNCOLS 3\nXLLCENTER 105\nYLLCENTER 205\nDX 10\nDY 10\nNODATA -9999\n1.5 2 3\n4 -9999 6.25".into(),
        "nodata_value -9999\ncellsize 10,0\nncols 3\nnrows 2\nxllcorner 100,0\nyllcorner 200,0\n1,5 2,0 3 4 -9999,0 6,25".into(),
        format!("{corner}NODATA_value -3.4028234663852886e+38\n1.5 2 3 4 -3.40282346638529e+38 6.25"),
        format!("{corner}NODATA_value -1.79769313486232e+308\n1.5 2 3 4 -1.79769313486232e+308 6.25"),
        format!("{corner}NODATA_value 1e20\n1.5 2 3 4 1.0E+20 6.25\x1a"),
        format!("{corner}1.5\t2\t3\n4\t-1.#IND\t6.25\n"),
    ];
    for text in texts {
        let grid = grid("a.asc", &text);
        let shown = text.replace('\n', "|");
        assert_eq!(format!("{:?}", grid.samples), "[1.5, 2.0, 3.0, 4.0, NaN, 6.25]", "{shown}");
        assert_eq!(grid.info.georeference.pixel_to_crs, Some(PLACE), "{shown}");
        assert_eq!(grid.info.format, "Esri ASCII grid");
    }
    // Known by its content.
    let text = "ncols 2\nnrows 2\n1 2 3 4";
    assert_eq!(grid("no-extension", text).samples, [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(grid("a.asc", text).info.georeference.pixel_to_crs, None);
    let unequal = grid("a.asc", "ncols 2\nnrows 3\nxllcorner 0\nyllcorner 0\ndx 2\ndy 4\n1 2 3 4 5 6");
    assert_eq!(unequal.info.georeference.pixel_to_crs, Some([1.0, 2.0, 0.0, 10.0, 0.0, -4.0]));
}

#[test]
fn rows_may_lie_over_lines_as_they_like() {
    let mut random = Random(3);
    let numbers: Vec<String> = (0..50 * 40).map(|i| format!("{}", i * 3)).collect();
    for _ in 0..20 {
        let mut text = "ncols 50\nnrows 40\n".to_owned();
        for number in &numbers {
            text.push_str(number);
            text.push_str([" ", "\n", "\r\n", "\t", "  ", " \n "][random.below(6) as usize]);
        }
        let grid = grid("a.asc", &text);
        assert!(grid.samples.iter().enumerate().all(|(i, sample)| *sample == 3.0 * i as f64));
    }
}

#[test]
fn wrong_ascii_grids_are_told() {
    let head = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n";
    for (text, wanted) in [
        (format!("{head}1 2 3 4 5"), "do not fit"),
        (format!("{head}10 20 30 40 50"), "row 1, column 2: the file ends after 5"),
        (format!("{head}1 2 3 4 5 6 7"), "more numbers follow than the 3 x 2"),
        (format!("{head}1 2 x 4 5 6"), "row 0, column 2: x is no height"),
        (format!("{head}1 2 1e999 4 5 6"), "row 0, column 2: 1e999 is no height"),
        (format!("{head}1,2,3,4,5,6 7 8"), "1,2,3,4,5,6 is no height"),
        ("ncols 3\nnrows 4000000000\n1 2 3".into(), "do not fit"),
        ("ncols 4294967295\nnrows 4294967295\n1 2 3".into(), "do not fit"),
        ("ncols 3\ncellsize 1\n1 2 3".into(), "expected"),
    ] {
        let said = said("a.asc", &text);
        assert!(said.contains(wanted), "{text:?}: {said}");
    }
}

/// Points of a ground 5 wide and 4 high, height by place; `None` is a gap.
fn ground() -> Vec<[Option<f64>; 3]> {
    let points = (0..4).flat_map(|up| (0..5).map(move |across| (across, up)));
    points
        .map(|(across, up)| {
            let height = 100.0 + 3.0 * f64::from(across) + 7.25 * f64::from(up);
            let is_gap = (across, up) == (2, 1) || (across, up) == (4, 3);
            [
                Some(600.0 + 25.0 * f64::from(across)),
                Some(4000.0 + 20.0 * f64::from(up)),
                (!is_gap).then_some(height),
            ]
        })
        .collect()
}

fn is_ground(grid: &Grid, shown: &str) {
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [5, 4], "{shown}");
    let place = grid.info.georeference.pixel_to_crs.unwrap();
    for (got, wanted) in place.iter().zip([600.0, 25.0, 0.0, 4060.0, 0.0, -20.0]) {
        assert!((got - wanted).abs() < 1e-9, "{shown}: {place:?}");
    }
    for [x, y, height] in ground() {
        let (col, row) = ((x.unwrap() - 600.0) / 25.0, (4060.0 - y.unwrap()) / 20.0);
        let got = grid.at(col as u32, row as u32);
        assert_eq!(got.is_nan(), height.is_none(), "{shown}: {col} {row}");
        assert!(height.is_none_or(|height| got == height), "{shown}: {col} {row}: {got}");
    }
}

#[test]
fn xyz_grids_in_every_order_and_spelling() {
    let mut orders: Vec<(String, Vec<[Option<f64>; 3]>)> = Vec::new();
    for x_is_fast in [true, false] {
        for [west_first, south_first] in [[true, true], [true, false], [false, true], [false, false]] {
            let mut points = ground();
            points.sort_by(|a, b| {
                let x = a[0].partial_cmp(&b[0]).unwrap();
                let y = a[1].partial_cmp(&b[1]).unwrap();
                let (x, y) =
                    (if west_first { x } else { x.reverse() }, if south_first { y } else { y.reverse() });
                if x_is_fast { y.then(x) } else { x.then(y) }
            });
            orders.push((format!("x fast {x_is_fast}, west {west_first}, south {south_first}"), points));
        }
    }
    let mut shuffled = ground();
    let mut random = Random(11);
    (1..shuffled.len()).for_each(|i| shuffled.swap(i, random.below(i as u64 + 1) as usize));
    orders.push(("shuffled".into(), shuffled));
    for (order, points) in &orders {
        for (spelling, separator, comma, head) in [
            ("plain", " ", false, ""),
            ("tabs and a header", "\t", false, "X\tY\tZ\n"),
            ("commas", ",", false, "x,y,elevation\n"),
            ("semicolons and decimal commas", ";", true, "East;North;Hoehe\n"),
            ("decimal commas", "  ", true, "# made by a test\n\n"),
        ] {
            let mut text = head.to_owned();
            for point in points.iter().filter(|point| point[2].is_some()) {
                let words = point.map(|number| format!("{}", number.unwrap()));
                let line = words.join(separator);
                text.push_str(&if comma { line.replace('.', ",") } else { line });
                text.push_str("\r\n");
            }
            is_ground(&grid("a.xyz", &text), &format!("{order}, {spelling}"));
        }
    }
    // Columns by name; a height that is none; a point that is there twice.
    let mut text = "lat,lon,h\n".to_owned();
    for [x, y, height] in ground() {
        text.push_str(&format!("{},{},{}\n", y.unwrap(), x.unwrap(), height.unwrap_or(f64::NAN)));
    }
    text.push_str("4000,600,100\n");
    is_ground(&grid("a.csv", &text), "by name");
    assert!(said("a.csv", text + "4000,600,101\n").contains("two heights, 100 and 101"));
}

#[test]
fn a_row_that_is_missing_is_void_and_degrees_have_few_digits() {
    let line =
        |up: u32| (0..3).map(|across| format!("{across} {up} {}\n", 10 * up + across)).collect::<String>();
    let grid_of_rows = grid("a.xyz", [0, 1, 4].map(line).concat());
    assert_eq!(grid_of_rows.info.samples_high, 5);
    assert_eq!(grid_of_rows.voids(), 6);
    assert_eq!(grid_of_rows.at(2, 0), 42.0);
    // A third of a thousandth of a degree with five decimals.
    let text: String = (0..30)
        .flat_map(|y| {
            (0..30).map(move |x| {
                format!("{:.5} {:.5} {}\n", f64::from(x) / 1200.0, f64::from(y) / 1200.0, x + y)
            })
        })
        .collect();
    let degrees = grid("a.xyz", text);
    assert_eq!((degrees.info.samples_wide, degrees.voids()), (30, 0));
    let step = degrees.info.georeference.pixel_to_crs.unwrap()[1];
    assert!((step * 1200.0 - 1.0).abs() < 1e-3, "{step}");
}

#[test]
fn what_is_no_xyz_grid_is_told() {
    let mut random = Random(5);
    let scattered: String =
        (0..500).map(|i| format!("{} {} {i}\n", random.below(100_000), random.below(100_000))).collect();
    let turned: String = (0..400)
        .map(|i| {
            let (a, b) = (f64::from(i % 20), f64::from(i / 20));
            format!("{:.3} {:.3} {i}\n", 0.866 * a - 0.5 * b, 0.5 * a + 0.866 * b)
        })
        .collect();
    let line: String = (0..50).map(|i| format!("{i} 7 {i}\n")).collect();
    let plain: String = (0..9).map(|i| format!("{} {} {i}\n", i % 3, i / 3)).collect();
    for (text, wanted) in [
        (scattered, "no grid that runs east and north"),
        (turned, "no grid that runs east and north"),
        (line, "in a line"),
        (format!("{plain}hello\n"), "point 10: \"hello\" has no three numbers"),
        (format!("{plain}1 2\n"), "no three numbers"),
        (format!("{plain}1 nan 5\n"), "no three numbers"),
        (format!("{plain}1 1 1e300\n"), "no three numbers"),
        ("nothing of this kind\n".into(), "format is unknown"),
    ] {
        let said = said("a.xyz", &text);
        assert!(said.contains(wanted), "{said}");
    }
}
