//! PNG in seven passes, with transparency, and of colours that heights are packed into; told by arithmetic.

#[path = "import_support/adam7.rs"]
mod adam7;
mod import_support;

use adam7::interlaced_png;
use import_support::{Grid, collect, data, read, refusal};
use std::path::Path;
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, open_with};

fn with(path: &Path, options: OpenOptions) -> Result<Grid, terrasoar_layout::LayoutError> {
    collect(&*open_with(&[path.to_owned()], &options)?)
}

#[test]
fn interlaced_png_of_every_size_and_kind() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.png");
    for sides in [[2usize, 2], [3, 2], [2, 5], [5, 5], [8, 8], [9, 17], [33, 20], [100, 3]] {
        let value = |i: usize| (i % sides[0]) * 3 + (i / sides[0]) * 7 + 1;
        let all = sides[0] * sides[1];
        for (color, depth) in [(0, 8), (0, 16), (4, 8), (4, 16)] {
            let pixels: Vec<Vec<u8>> = (0..all)
                .map(|i| {
                    let value = value(i) as u16;
                    let mut pixel =
                        if depth == 8 { vec![value as u8] } else { (value * 100).to_be_bytes().to_vec() };
                    if color == 4 {
                        pixel.extend(vec![if i == 1 { 0 } else { 255 }; usize::from(depth / 8)]);
                    }
                    pixel
                })
                .collect();
            std::fs::write(&path, interlaced_png(sides, color, depth, &pixels)).unwrap();
            let grid = read(std::slice::from_ref(&path)).unwrap_or_else(|error| panic!("{error}"));
            for i in 0..all {
                let got = grid.at((i % sides[0]) as u32, (i / sides[0]) as u32);
                let wanted = if depth == 8 { (value(i) % 256) as f64 } else { (value(i) * 100) as f64 };
                assert!(
                    got == wanted || (color == 4 && i == 1 && got.is_nan()),
                    "{sides:?} {color} {depth}: {i}: {got}"
                );
            }
        }
    }
}

/// Red, green and blue of a height as a packing has them.
fn packed(height: f64, packing: &str) -> [u8; 3] {
    let number = if packing == "mapbox" { (height + 10_000.0) * 10.0 } else { (height + 32_768.0) * 256.0 };
    let number = number.round() as u32;
    [(number >> 16) as u8, (number >> 8) as u8, number as u8]
}

#[test]
fn colour_packed_png_told_and_found() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.png");
    let (wide, high) = (60usize, 50usize);
    let ground = |i: usize| 200.0 + 13.5 * (i % wide) as f64 + 7.5 * (i / wide) as f64;
    for packing in ["mapbox", "terrarium"] {
        for (color, interlaced) in [(2, false), (6, false), (2, true), (6, true)] {
            let pixels: Vec<Vec<u8>> = (0..wide * high)
                .map(|i| {
                    let mut pixel = packed(ground(i), packing).to_vec();
                    if color == 6 {
                        pixel.push(u8::from(i != 77) * 255);
                    }
                    pixel
                })
                .collect();
            let bytes = if interlaced {
                interlaced_png([wide, high], color, 8, &pixels)
            } else {
                let mut info = png::Info::with_size(wide as u32, high as u32);
                info.color_type = if color == 2 { png::ColorType::Rgb } else { png::ColorType::Rgba };
                let mut file = Vec::new();
                let mut writer = png::Encoder::with_info(&mut file, info).unwrap().write_header().unwrap();
                writer.write_image_data(&pixels.concat()).unwrap();
                writer.finish().unwrap();
                file
            };
            std::fs::write(&path, bytes).unwrap();
            let named = OpenOptions { decode: Some(packing.into()), ..OpenOptions::default() };
            for options in [OpenOptions::default(), named] {
                let grid = with(&path, options)
                    .unwrap_or_else(|error| panic!("{packing} {color} {interlaced}: {error}"));
                for i in 0..wide * high {
                    let raw = grid.at((i % wide) as u32, (i / wide) as u32);
                    let got = raw * grid.info.height_scale + grid.info.height_offset_m;
                    let is_void = color == 6 && i == 77;
                    assert!(
                        if is_void { got.is_nan() } else { (got - ground(i)).abs() < 1e-9 },
                        "{packing}: {i}: {got}"
                    );
                }
            }
        }
    }
    // The last file is Terrarium's, and no other packing's without a word.
    let factors = OpenOptions { decode: Some("1,0,0,-5".into()), ..OpenOptions::default() };
    assert_eq!(with(&path, factors).unwrap().at(0, 0), f64::from(packed(200.0, "terrarium")[0]) - 5.0);
    let wrong = OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() };
    assert!(with(&path, wrong).unwrap().at(0, 0) > 500_000.0);
    // Pictures, dark ones too, are none.
    for (red, green, blue) in [(60, 90, 40), (1, 20, 10), (128, 128, 128), (0, 0, 0), (2, 1, 200)] {
        let pixels: Vec<Vec<u8>> =
            (0..wide * high).map(|i| vec![red, green + (i % 7) as u8, blue + (i % 40) as u8]).collect();
        std::fs::write(&path, interlaced_png([wide, high], 2, 8, &pixels)).unwrap();
        let said = refusal(std::slice::from_ref(&path));
        assert!(said.contains("state how (mapbox, terrarium or factors)"), "{said}");
    }
    // What begins as heights and goes on as a picture is not read to the end.
    let mut pixels: Vec<Vec<u8>> = (0..wide * high).map(|i| packed(ground(i), "mapbox").to_vec()).collect();
    let mut many = Vec::new();
    (0..1500).for_each(|_| many.extend(pixels.clone()));
    pixels.iter_mut().for_each(|pixel| pixel[0] = 9);
    many.extend(pixels);
    let mut info = png::Info::with_size(wide as u32, (1501 * high) as u32);
    info.color_type = png::ColorType::Rgb;
    let mut file = Vec::new();
    let mut writer = png::Encoder::with_info(&mut file, info).unwrap().write_header().unwrap();
    writer.write_image_data(&many.concat()).unwrap();
    writer.finish().unwrap();
    std::fs::write(&path, file).unwrap();
    let said = refusal(std::slice::from_ref(&path));
    assert!(said.contains("row 75000 has colours that are no heights"), "{said}");
    let grey = OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() };
    assert!(
        with(&data("puget_sound_1025.png"), grey).err().unwrap().to_string().contains("this PNG is grey")
    );
}
