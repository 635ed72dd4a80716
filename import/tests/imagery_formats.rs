//! Pictures as files: every way of storing one that is read gives the colours it was made of; what is not read is refused with a word of what to do.
//!
//! The fixtures are made by `data-scripts/make-image-fixtures.py`.

#[path = "../../layout/tests/common/mod.rs"]
mod common;

#[path = "pictures/chroma.rs"]
mod chroma;
#[path = "pictures/jp2_boxes.rs"]
mod jp2_boxes;
#[path = "pictures/jxl.rs"]
mod jxl;
#[path = "pictures/stretch.rs"]
mod stretch;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;

use std::path::{Path, PathBuf};
use terrasoar_import::open_image;
use terrasoar_layout::LayoutError;

const SIZE: [u32; 2] = [72, 56];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/image_fixtures").join(name)
}

/// The colours all fixtures show.
fn colour(x: u32, y: u32) -> [u8; 3] {
    [40 + 2 * x + y, 220 - x - y, 60 + x * y / 40].map(|value| value as u8)
}

fn is_hole(x: u32, y: u32) -> bool {
    x + y < 20
}

/// All texels, read in uneven steps.
fn texels(path: &Path) -> Result<Vec<[u8; 4]>, LayoutError> {
    let image = open_image(path)?;
    // As whoever drapes refuses it.
    if image.info().memory_bytes > 64 << 20 {
        return Err(LayoutError::Usage("it takes more memory than is allowed".into()));
    }
    let mut rows = image.rows()?;
    let [wide, high] = image.info().texels;
    let mut all = Vec::new();
    let mut left = high;
    for step in [1, 7, 64, 3].into_iter().cycle() {
        let step = left.min(step);
        let mut rgba = vec![0; (step * wide * 4) as usize];
        rows.read(&mut rgba)?;
        all.extend_from_slice(rgba.as_chunks::<4>().0);
        left -= step;
        if left == 0 {
            return Ok(all);
        }
    }
    Ok(all)
}

fn each(found: &[[u8; 4]], mut check: impl FnMut(u32, u32, [u8; 4])) {
    assert_eq!(found.len(), (SIZE[0] * SIZE[1]) as usize);
    for (i, texel) in (0..).zip(found) {
        check(i % SIZE[0], i / SIZE[0], *texel);
    }
}

#[test]
fn lossless_pictures_come_back() {
    for name in [
        "rgb-strips.tif",
        "rgb-one-strip.tif",
        "rgb-tiles-deflate-p2.tif",
        "rgb-tiles-big-endian-lzw.tif",
        "rgb-16-big-endian.tif",
        "rgb-16.png",
        "rgb-planes.tif",
        "rgb-tiles.jp2",
        "rgb-gml.jp2",
        "rgb-tiles-webp.tif",
    ] {
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let [r, g, b] = colour(x, y);
            assert_eq!(texel, [r, g, b, 255], "{name} {x} {y}");
        });
    }
    for name in ["grey.tif", "grey-16.tif", "grey.j2k"] {
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let grey = colour(x, y)[0];
            assert_eq!(texel, [grey, grey, grey, 255], "{name} {x} {y}");
        });
    }
    for name in ["rgba-tiles-zstd.tif", "rgb-nodata.tif", "rgba.png", "rgba.webp", "rgba.jp2"] {
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let [r, g, b] = colour(x, y);
            assert_eq!(texel[3], if is_hole(x, y) { 0 } else { 255 }, "{name} {x} {y}");
            assert!(texel[3] == 0 || texel == [r, g, b, 255], "{name} {x} {y}: {texel:?}");
        });
    }
    each(&texels(&fixture("palette.jp2")).unwrap(), |x, y, texel| {
        let place = colour(x, y)[0] / 16;
        assert_eq!(texel, [17 * place, 255 - 17 * place, 5 * place, 255], "{x} {y}");
    });
    // The same picture with marks of restart.
    assert!(texels(&fixture("restart.jpg")).unwrap() == texels(&fixture("baseline.jpg")).unwrap());
}

#[test]
fn jpeg_pictures_come_back_about() {
    for (name, is_grey) in [
        ("jpeg-ycbcr.tif", false),
        ("jpeg-rgb.tif", false),
        ("jpeg-grey.tif", true),
        ("baseline.jpg", false),
        ("progressive.jpg", false),
        ("grey.jpg", true),
        ("rgb.webp", false),
        ("chroma.tif", false),
    ] {
        let (mut sum, mut most) = (0, 0);
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let [r, g, b] = colour(x, y);
            let wanted = if is_grey { [r; 3] } else { [r, g, b] };
            for c in 0..3 {
                let difference = u32::from(texel[c].abs_diff(wanted[c]));
                (sum, most) = (sum + difference, most.max(difference));
            }
            assert_eq!(texel[3], 255);
        });
        // Halved chroma and what fills the tiles at the rim show in single texels, as they do in GDAL.
        let mean = f64::from(sum) / f64::from(3 * SIZE[0] * SIZE[1]);
        assert!(mean < 1.5 && most < 50, "{name}: {mean:.2} on average, {most} at most");
    }
    // The very texel as GDAL 3.6 shows it.
    assert_eq!(texels(&fixture("jpeg-ycbcr.tif")).unwrap()[71], [173, 149, 85, 255]);
}

/// The fourth band of the files is alpha, taken for black. GDAL writes JPEG as Adobe's programs do, the other way round: the bands as they are are what is left of the light.
#[test]
fn inks_are_shown_as_light() {
    for (name, near) in [("cmyk.tif", 0), ("cmyk.jpg", 40)] {
        each(&texels(&fixture(name)).unwrap(), |x, y, texel| {
            let is_turned = name == "cmyk.jpg";
            let is_light = is_hole(x, y) != is_turned;
            let left = |band: u8| u32::from(if is_turned { band } else { 255 - band });
            let light = colour(x, y).map(|band| if is_light { left(band) } else { 0 });
            let off = (0..3).map(|i| u32::from(texel[i]).abs_diff(light[i])).max();
            assert!(texel[3] == 255 && off <= Some(near), "{name} {x} {y}: {texel:?}, not {light:?}");
        });
        assert!(open_image(&fixture(name)).unwrap().info().notes.iter().any(|note| note.contains("CMYK")));
    }
}

#[test]
fn places_and_notes_are_read() {
    assert_eq!(open_image(&fixture("rgb-gml.jp2")).unwrap().info().georeference.epsg, Some(32632));
    for name in
        ["rgb-strips.tif", "jpeg-ycbcr.tif", "rgba.png", "rgb-tiles.jp2", "rgb-gml.jp2", "rgb-tiles-webp.tif"]
    {
        let image = open_image(&fixture(name)).unwrap();
        let map = image.info().georeference.pixel_to_crs;
        assert_eq!(map, Some([1001.0, 2.0, 0.0, 4999.0, 0.0, -2.0]), "{name}");
        assert!(image.info().notes.is_empty(), "{name}");
    }
    for name in ["grey-16.tif", "rgb-16-big-endian.tif", "rgb-16.png"] {
        let image = open_image(&fixture(name)).unwrap();
        assert!(image.info().notes[0].contains("16 bits"), "{name}");
    }
}

#[test]
fn what_is_not_read_is_refused_with_a_way_out() {
    let refused = |path: &Path, words: [&str; 2]| {
        let error = open_image(path).err().expect("an error").to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{words:?}: {error}");
    };
    refused(&fixture("missing.tif"), ["cannot read the image", "missing"]);
    refused(Path::new(env!("CARGO_MANIFEST_DIR")), ["directory", "name the images"]);
    refused(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("../layout/FORMAT.md"),
        ["no PNG, JPEG, JPEG XL, WebP, JPEG 2000 or TIFF", "gdal_translate"],
    );
    let folder = tempfile::tempdir().unwrap();
    for (brand, name) in [("avif", "AVIF"), ("avis", "AVIF"), ("heic", "HEIF"), ("mif1", "HEIF")] {
        let path = folder.path().join(brand);
        std::fs::write(&path, format!("\0\0\0\x20ftyp{brand}\0\0\0\0mif1miaf")).unwrap();
        refused(&path, [name, "magick INPUT output.png"]);
        let heights = terrasoar_import::open_file(&path).err().expect("an error").to_string();
        assert!(heights.contains(name) && heights.contains("has no heights"), "{heights}");
    }
    let floats = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/float32-strips.tif");
    refused(&floats, ["float32", "black"]);
}

/// Cut anywhere, or with any byte changed: an answer, never a panic.
#[test]
fn damaged_pictures_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let (mut errors, mut tries) = (0, 0);
    for name in [
        "rgb-tiles-deflate-p2.tif",
        "rgba-tiles-zstd.tif",
        "rgb-one-strip.tif",
        "jpeg-ycbcr.tif",
        "rgba.png",
        "baseline.jpg",
        "progressive.jpg",
        "rgba.webp",
        "rgb.webp",
        "rgb-tiles.jp2",
        "grey.j2k",
        "rgba.jp2",
        "palette.jp2",
        "restart.jpg",
        "rgb-tiles-webp.tif",
        "rgb-planes.tif",
        "rgba.jxl",
        "rgb-boxes.jxl",
        "lossy.jxl",
        "jpegxl-rgb.tif",
        "jpegxl-rgba.tif",
    ] {
        let bytes = std::fs::read(fixture(name)).unwrap();
        let path = folder.path().join("x");
        let step = (bytes.len() / if name.contains("jxl") { 40 } else { 150 }).max(1);
        for at in (0..bytes.len()).step_by(step) {
            let mut flipped = bytes.clone();
            flipped[at] ^= 0x5a;
            for damaged in [&flipped[..], &bytes[..at]] {
                std::fs::write(&path, damaged).unwrap();
                tries += 1;
                errors += u32::from(texels(&path).is_err());
            }
        }
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(texels(&path).is_err(), "half of {name}");
    }
    assert!(errors > tries / 3, "{errors} of {tries}");
}

/// Luma and chroma of every step, packed and not, in strips and tiles, against the formulas of TIFF.
#[test]
fn luma_and_chroma_become_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for case in chroma::all() {
        let bytes = chroma::file(case);
        std::fs::write(&path, &bytes).unwrap();
        let texels = texels(&path).unwrap_or_else(|error| panic!("{case:?}: {error}"));
        for (at, texel) in (0..).zip(&texels) {
            let (col, row) = (at % chroma::SIZE[0], at / chroma::SIZE[0]);
            let wanted = chroma::colours(case, chroma::codes(case, col, row));
            let is_near = (0..3).all(|i| (f64::from(texel[i]) - wanted[i]).abs() <= 0.51);
            assert!(is_near && texel[3] == 255, "{case:?} {col} {row}: {texel:?}, not {wanted:?}");
        }
        // Cut and changed.
        for at in (0..bytes.len()).step_by(97) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x5a;
            for damaged in [&changed[..], &bytes[..at]] {
                std::fs::write(&path, damaged).unwrap();
                let _ = self::texels(&path);
            }
        }
    }
}

/// A picture of two texels of 8 bits a channel: what its extra samples are, and what GDAL says of its bands.
fn two_texels(channels: u16, extra: &[u16], roles: &[&str], data: &[u8]) -> Vec<[u8; 4]> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let items = roles.iter().enumerate().map(|(band, role)| {
        format!("<Item name=\"COLORINTERP\" sample=\"{band}\" role=\"colorinterp\">{role}</Item>\n")
    });
    let is_grey = extra.len() + 1 == usize::from(channels);
    let mut tags = vec![
        tiff::shorts(256, &[2]),
        tiff::shorts(257, &[1]),
        tiff::shorts(258, &vec![8; usize::from(channels)]),
        tiff::shorts(259, &[1]),
        tiff::shorts(262, &[if is_grey { 1 } else { 2 }]),
        tiff::longs(273, &[tiff::DATA_AT]),
        tiff::shorts(277, &[channels]),
        tiff::shorts(278, &[1]),
        tiff::longs(279, &[data.len() as u32]),
    ];
    if !extra.is_empty() {
        tags.push(tiff::shorts(338, extra));
    }
    if !roles.is_empty() {
        tags.push(tiff::text(
            42112,
            &format!("<GDALMetadata>\n{}</GDALMetadata>", items.collect::<String>()),
        ));
    }
    std::fs::write(&path, tiff::tiff(false, tags, data)).unwrap();
    texels(&path).unwrap()
}

#[test]
fn bands_are_what_gdal_calls_them() {
    let bgr = two_texels(3, &[0, 0], &["Blue", "Green", "Red"], &[1, 2, 3, 4, 5, 6]);
    assert_eq!(bgr, [[3, 2, 1, 255], [6, 5, 4, 255]]);
    let argb = two_texels(4, &[0, 0, 0], &["Alpha", "Red", "Green", "Blue"], &[0, 2, 3, 4, 128, 5, 6, 7]);
    assert_eq!(argb, [[2, 3, 4, 0], [5, 6, 7, 128]]);
    let rgba = two_texels(4, &[0], &["Red", "Green", "Blue", "Alpha"], &[1, 2, 3, 0, 4, 5, 6, 255]);
    assert_eq!(rgba, [[1, 2, 3, 0], [4, 5, 6, 255]]);
    // Names that are no colours, or of bands that are not there, change nothing.
    for roles in [&["Red", "Green", "Undefined"][..], &["Undefined", "Red", "Green", "Blue"]] {
        assert_eq!(two_texels(3, &[0, 0], roles, &[1, 2, 3, 4, 5, 6]), [[1, 2, 3, 255], [4, 5, 6, 255]]);
    }
}

#[test]
fn colours_multiplied_by_alpha_are_divided() {
    let data = [50, 25, 0, 100, 200, 100, 7, 255];
    assert_eq!(two_texels(4, &[1], &[], &data), [[128, 64, 0, 100], [200, 100, 7, 255]]);
    assert_eq!(two_texels(4, &[2], &[], &data), [[50, 25, 0, 100], [200, 100, 7, 255]]);
    // A colour above alpha was not multiplied, whatever the file says.
    assert_eq!(two_texels(4, &[1], &[], &[150, 25, 0, 100, 9, 9, 9, 0]), [[150, 25, 0, 100], [9, 9, 9, 0]]);
}
