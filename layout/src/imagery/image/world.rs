//! World files: six numbers beside a picture that say where it lies (ESRI's convention: `.pgw`, `.jgw`, `.wld`).
//!
//! The lines are the step east a column, north a column, east a row, north a row, and the centre of the north-west texel.

use crate::dem::Georeference;
use std::path::Path;

/// Longest world file read.
const MAX_BYTES: u64 = 4096;

/// What the world file of the picture at `path` says, nothing if there is none or it makes no sense.
pub(super) fn georeference(path: &Path, extensions: &[&str]) -> Georeference {
    let numbers = extensions.iter().find_map(|extension| {
        let world = path.with_extension(extension);
        if std::fs::metadata(&world).ok()?.len() > MAX_BYTES {
            return None;
        }
        let text = std::fs::read_to_string(world).ok()?;
        let numbers: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
        <[f64; 6]>::try_from(numbers).ok().filter(|n| n.iter().all(|v| v.is_finite()))
    });
    Georeference {
        pixel_to_crs: numbers.map(|[a, d, b, e, c, f]| [c, a, b, f, d, e]),
        ..Georeference::default()
    }
}
