//! JPEG XL, as files and as chunks of TIFF: every kind gives the colours it was made of, turned as it says; what is not read is refused in words.
//!
//! The fixtures are made by `data-scripts/make-jpegxl-fixtures.py`.

use super::{SIZE, colour, each, fixture, is_hole, texels};
use std::path::Path;
use terrasoar_import::{PictureOptions, Stretch, open_image, open_images};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

fn shown(path: &Path, options: &PictureOptions) -> Result<Vec<[u8; 4]>, LayoutError> {
    let images = open_images(&[path.to_owned()], None, options)?;
    let [wide, high] = images[0].info().texels;
    let mut rgba = vec![0; (wide * high * 4) as usize];
    images[0].rows()?.read(&mut rgba)?;
    Ok(rgba.as_chunks::<4>().0.to_vec())
}

fn stretched(black: f64, white: f64) -> PictureOptions {
    PictureOptions { stretch: Some(Stretch::Values(black, white)), ..PictureOptions::default() }
}

#[test]
fn lossless_pictures_come_back() {
    for name in ["rgb.jxl", "rgb-boxes.jxl", "jpegxl-rgb.tif"] {
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let [r, g, b] = colour(x, y);
            assert_eq!(texel, [r, g, b, 255], "{name} {x} {y}");
        });
    }
    for name in ["rgba.jxl", "jpegxl-rgba.tif"] {
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let [r, g, b] = colour(x, y);
            assert_eq!(texel[3], if is_hole(x, y) { 0 } else { 255 }, "{name} {x} {y}");
            assert!(texel[3] == 0 || texel == [r, g, b, 255], "{name} {x} {y}: {texel:?}");
        });
    }
    for name in ["grey-16.jxl", "jpegxl-grey-16.tif"] {
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let grey = colour(x, y)[0];
            assert_eq!(texel, [grey, grey, grey, 255], "{name} {x} {y}");
        });
        // And as numbers.
        each(&shown(&fixture(name), &stretched(0.0, 65_535.0)).unwrap(), |x, y, texel| {
            assert_eq!(texel[0], colour(x, y)[0], "{name} {x} {y}");
        });
        assert!(open_image(&fixture(name)).unwrap().info().notes[0].contains("16 bits"), "{name}");
    }
}

#[test]
fn reals_are_shown_between_black_and_white() {
    for (name, black, white) in [("real.jxl", -10.0, 53.75), ("jpegxl-planes-real.tif", -100.0, 1940.0)] {
        let Err(refused) = open_image(&fixture(name)) else { panic!("{name} was read") };
        assert_eq!(refused.remedy(), Some(Remedy::Stretch), "{refused}");
        each(&shown(&fixture(name), &stretched(black, white)).unwrap(), |x, y, texel| {
            let [r, g, b] = if name == "real.jxl" { [colour(x, y)[0]; 3] } else { colour(x, y) };
            assert_eq!(texel, [r, g, b, 255], "{name} {x} {y}");
        });
    }
}

#[test]
fn lossy_pictures_come_back_about() {
    for name in ["lossy.jxl", "squeezed.jxl"] {
        let mut most = 0;
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            (0..3).for_each(|i| most = most.max(texel[i].abs_diff(colour(x, y)[i])));
            assert_eq!(texel[3], 255);
        });
        assert!(most <= 16, "{name}: {most}");
    }
}

/// A quarter turn to the right, of the stream of a JPEG that goes on in the file.
#[test]
fn a_picture_is_turned_as_its_stream_says() {
    let image = open_image(&fixture("turned.jxl")).unwrap();
    assert_eq!(image.info().texels, [SIZE[1], SIZE[0]]);
    let turned = texels(&fixture("turned.jxl")).unwrap();
    let mut most = 0;
    each(&texels(&fixture("baseline.jpg")).unwrap(), |x, y, texel| {
        let at = x * SIZE[1] + SIZE[1] - 1 - y;
        (0..4).for_each(|i| most = most.max(texel[i].abs_diff(turned[at as usize][i])));
    });
    assert!(most <= 3, "{most}");
}

#[test]
fn files_beside_say_where_it_lies_and_what_is_no_data() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jxl");
    std::fs::copy(fixture("rgb.jxl"), &path).unwrap();
    std::fs::write(folder.path().join("a.jlw"), "2\n0\n0\n-2\n1001\n4999\n").unwrap();
    std::fs::write(folder.path().join("a.prj"), "EPSG:32632").unwrap();
    let found = open_image(&path).unwrap().info().georeference.clone();
    assert_eq!((found.pixel_to_crs, found.epsg), (Some([1001.0, 2.0, 0.0, 4999.0, 0.0, -2.0]), Some(32_632)));
    let place = open_image(&fixture("jpegxl-rgb.tif")).unwrap().info().georeference.pixel_to_crs;
    assert_eq!(place, Some([1001.0, 2.0, 0.0, 4999.0, 0.0, -2.0]));
}

#[test]
fn what_is_not_read_is_refused_with_a_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jxl");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        texels(&path).expect_err("an error").to_string()
    };
    let sound = std::fs::read(fixture("rgb-boxes.jxl")).unwrap();
    let bare = std::fs::read(fixture("rgb.jxl")).unwrap();
    for cut in [20, 60, 200, sound.len() - 40] {
        let words = refused(&sound[..cut]);
        assert!(words.contains("cut short") && words.contains("fetch"), "{cut}: {words}");
    }
    assert!(refused(&bare[..bare.len() / 2]).contains("cut short"));
    assert!(refused(&[&bare[..40], &[0x55; 4000][..]].concat()).contains("fetch"));
}
