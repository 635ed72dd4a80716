//! Pictures of every type of numbers, by bands and stretched, texel by texel against `gdal_translate -b -scale`, and percentiles against a sorted list.

use super::made::{self, Band};
use super::tools;
use std::path::{Path, PathBuf};
use terrasoar_import::{PictureOptions, Stretch, open_images};

const SIZE: [usize; 2] = [53, 37];
/// Bands of the files.
const BANDS: usize = 5;

/// The bytes of a picture, RGBA, and its notes.
pub(crate) fn shown(
    paths: &[PathBuf],
    options: &PictureOptions,
) -> Result<(Vec<Vec<u8>>, Vec<String>), String> {
    let images = open_images(paths, None, options).map_err(|error| format!("refused: {error}"))?;
    let mut all = Vec::new();
    for image in &images {
        let texels = image.info().texels.map(|side| side as usize);
        let mut rgba = vec![0; texels[0] * texels[1] * 4];
        let mut rows = image.rows().map_err(|error| error.to_string())?;
        // Rows a few at a time, as a program asks for them.
        for band in rgba.chunks_mut(texels[0] * 4 * 5) {
            rows.read(band).map_err(|error| error.to_string())?;
        }
        all.push(rgba);
    }
    let notes = images.iter().flat_map(|image| image.info().notes.clone()).collect();
    Ok((all, notes))
}

/// A number of a band, within what its type holds.
fn value(kind: &str, band: usize, at: usize) -> f64 {
    let noise = ((at * 2_654_435_761 + band * 40_503) >> 7) % 1000;
    let whole = (noise + 37 * band) as f64;
    match kind {
        "Byte" => (whole / 5.0).floor(),
        "UInt16" => whole * 40.0,
        "NBITS=12" => whole * 3.0,
        "Int16" => whole * 20.0 - 9000.0,
        "UInt32" => whole * 4000.0,
        "Int32" => whole * 3000.0 - 1e6,
        _ => whole * 0.013 - 4.7,
    }
}

fn bytes(kind: &str, value: f64) -> Vec<u8> {
    match kind {
        "Byte" => vec![value as u8],
        "UInt16" | "NBITS=12" => (value as u16).to_le_bytes().to_vec(),
        "Int16" => (value as i16).to_le_bytes().to_vec(),
        "UInt32" => (value as u32).to_le_bytes().to_vec(),
        "Int32" => (value as i32).to_le_bytes().to_vec(),
        "Float32" => (value as f32).to_le_bytes().to_vec(),
        _ => value.to_le_bytes().to_vec(),
    }
}

/// A file of a driver.
fn name(driver: &str) -> &'static str {
    if driver == "GTiff" { "p.tif" } else { "p.jp2" }
}

/// A file of five bands of a type, made by GDAL.
fn make(folder: &Path, driver: &str, kind: &str, creation: &[&str]) -> Result<PathBuf, String> {
    let gdal = if kind == "NBITS=12" { "UInt16" } else { kind };
    let band = |band| Band {
        said: String::new(),
        numbers: (0..SIZE[0] * SIZE[1]).flat_map(|at| bytes(kind, value(kind, band, at))).collect(),
    };
    let bands: Vec<Band> = (0..BANDS).map(band).collect();
    let mut arguments = vec!["-of", driver];
    if kind == "NBITS=12" {
        arguments.extend(["-co", kind]);
    }
    creation.iter().for_each(|option| arguments.extend(["-co", option]));
    made::make(folder, SIZE, (gdal, bytes(kind, 0.0).len()), &bands, (name(driver), &arguments))
}

/// Bytes of the bands as GDAL scales them, RGBA.
fn scaled(folder: &Path, driver: &str, bands: &[u32], [low, high]: [f64; 2]) -> Result<Vec<u8>, String> {
    let numbers: Vec<String> = bands.iter().map(u32::to_string).collect();
    let (low, high) = (low.to_string(), high.to_string());
    let mut arguments = vec!["-q", "-of", "ENVI", "-co", "INTERLEAVE=BIP", "-ot", "Byte"];
    numbers.iter().for_each(|band| arguments.extend(["-b", band]));
    arguments.extend(["-scale", &low, &high, "0", "255", name(driver), "scaled.img"]);
    tools::try_run(folder, "gdal_translate", &arguments, true)?;
    let bytes = std::fs::read(folder.join("scaled.img")).map_err(|error| error.to_string())?;
    let texel = |texel: &[u8]| [texel[0], texel[texel.len() / 2], texel[texel.len() - 1], 255];
    Ok(bytes.chunks_exact(bands.len()).flat_map(texel).collect())
}

fn options(bands: &[u32], stretch: Stretch) -> PictureOptions {
    let bands = bands.iter().map(|band| (*band).try_into().unwrap()).collect();
    PictureOptions { bands, stretch: Some(stretch), ..PictureOptions::default() }
}

/// Percentiles of a band by sorting.
fn sorted_limits(kind: &str, band: u32, [low, high]: [f64; 2]) -> [f64; 2] {
    let single = |at: usize| match kind {
        "Float32" | "Float64" => f64::from(value(kind, band as usize - 1, at) as f32),
        _ => value(kind, band as usize - 1, at),
    };
    let mut all: Vec<f64> = (0..SIZE[0] * SIZE[1]).map(single).collect();
    all.sort_by(f64::total_cmp);
    [low, high].map(|percent| all[((percent / 100.0 * all.len() as f64).ceil() as usize).max(1) - 1])
}

fn check(driver: &str, kind: &str, creation: &[&str], bands: &[u32]) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let path = make(folder.path(), driver, kind, creation)?;
    let limits = [value(kind, 0, 0).min(0.0), value(kind, 2, 1) + value(kind, 4, 0).abs()];
    let (ours, _) =
        shown(std::slice::from_ref(&path), &options(bands, Stretch::Values(limits[0], limits[1])))?;
    let theirs = scaled(folder.path(), driver, bands, limits)?;
    if let Some(at) = (0..theirs.len()).find(|at| ours[0][*at] != theirs[*at]) {
        return Err(format!(
            "channel {} of texel {}: {} here, {} of GDAL",
            at % 4,
            at / 4,
            ours[0][at],
            theirs[at]
        ));
    }
    // Each band by its own percentiles.
    let (ours, notes) = shown(&[path], &options(bands, Stretch::Percentiles(3.0, 97.5)))?;
    for (channel, band) in bands.iter().enumerate() {
        let limits = sorted_limits(kind, *band, [3.0, 97.5]);
        let theirs = scaled(folder.path(), driver, &[*band], limits)?;
        if let Some(at) =
            (0..theirs.len() / 4).find(|at| ours[0][4 * at + channel].abs_diff(theirs[4 * at]) > 0)
        {
            return Err(format!(
                "by percentiles {limits:?} of band {band}, texel {at}: {} here, {} of GDAL; {notes:?}",
                ours[0][4 * at + channel],
                theirs[4 * at]
            ));
        }
    }
    Ok(())
}

#[test]
#[ignore = "needs gdal_translate"]
fn numbers_of_every_type_are_stretched_as_gdal_scales_them() {
    let layouts: [&[&str]; 6] = [
        &["INTERLEAVE=PIXEL"],
        &["INTERLEAVE=BAND"],
        &["INTERLEAVE=BAND", "COMPRESS=DEFLATE", "TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=16"],
        &["INTERLEAVE=PIXEL", "COMPRESS=LZW", "PREDICTOR=2", "ENDIANNESS=BIG"],
        &["INTERLEAVE=PIXEL", "COMPRESS=ZSTD", "TILED=YES", "BLOCKXSIZE=32", "BLOCKYSIZE=16"],
        &["INTERLEAVE=BAND", "COMPRESS=DEFLATE", "PREDICTOR=3", "BLOCKYSIZE=37"],
    ];
    let mut wrong = Vec::new();
    let mut count = 0;
    for kind in ["Byte", "UInt16", "NBITS=12", "Int16", "UInt32", "Int32", "Float32", "Float64"] {
        for creation in layouts {
            let has = |word: &str| creation.contains(&word);
            if has("PREDICTOR=3") && !kind.starts_with("Float")
                || has("PREDICTOR=2") && (kind == "NBITS=12" || kind == "Float64")
            {
                continue;
            }
            for bands in [&[4, 3, 2][..], &[5], &[1, 2, 3]] {
                count += 1;
                if let Err(words) = check("GTiff", kind, creation, bands) {
                    wrong.push(format!("{kind} {creation:?} {bands:?}: {words}"));
                }
            }
        }
    }
    for kind in ["Byte", "UInt16", "Int16"] {
        for creation in [
            &["REVERSIBLE=YES", "QUALITY=100"][..],
            &["REVERSIBLE=YES", "QUALITY=100", "BLOCKXSIZE=32", "BLOCKYSIZE=32"],
        ] {
            for bands in [&[4, 3, 2][..], &[5]] {
                count += 1;
                if let Err(words) = check("JP2OpenJPEG", kind, creation, bands) {
                    wrong.push(format!("JPEG 2000 {kind} {creation:?} {bands:?}: {words}"));
                }
            }
        }
    }
    println!("{} of {count} pictures agree", count - wrong.len());
    assert!(wrong.is_empty(), "{} of {count} differ:\n{}", wrong.len(), wrong.join("\n"));
    assert!(count > 100, "{count}");
}
