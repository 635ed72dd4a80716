//! World files: six numbers beside a picture that say where it lies (ESRI's convention: `.pgw`, `.jgw`, `.wld`).
//!
//! The lines are the step east a column, north a column, east a row, north a row, and the centre of the north-west texel. A file of that name that holds something else
//! is an error, because the person who put it there expects it to be used. Cost: a look at each name.

use crate::input;
use std::io::Read;
use std::path::Path;
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Longest world file read; six numbers are some 150 bytes.
const MAX_BYTES: u64 = 4096;

/// What the world file of the picture at `path` says, nothing if there is none. Of several the first in the order of `extensions` counts.
pub(super) fn georeference(path: &Path, extensions: &[&str]) -> Result<Georeference, LayoutError> {
    for extension in extensions {
        let world = path.with_extension(extension);
        let failed =
            |source| LayoutError::io(&world, "cannot look for the world file beside the picture", source);
        // A name that leads nowhere is no world file.
        if world != path && world.try_exists().map_err(failed)? {
            let [a, d, b, e, c, f] = numbers(&world)?;
            return Ok(Georeference { pixel_to_crs: Some([c, a, b, f, d, e]), ..Georeference::default() });
        }
    }
    Ok(Georeference::default())
}

fn numbers(world: &Path) -> Result<[f64; 6], LayoutError> {
    let refused = || {
        LayoutError::unsupported(
            world,
            "a world file beside a picture is a text of six numbers, and this is none; mend it, or put it elsewhere and state where the picture lies",
        )
        .mended_by(Remedy::Extent)
    };
    let mut bytes = Vec::new();
    input::open(world, "cannot open the world file beside the picture")?
        .take(MAX_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| LayoutError::io(world, "cannot read the world file beside the picture", source))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(refused());
    }
    let text = std::str::from_utf8(&bytes).map_err(|_| refused())?;
    let numbers: Vec<f64> =
        text.split_whitespace().map(str::parse).collect::<Result<_, _>>().map_err(|_| refused())?;
    let numbers = <[f64; 6]>::try_from(numbers).map_err(|_| refused())?;
    if numbers.iter().all(|number| number.is_finite()) { Ok(numbers) } else { Err(refused()) }
}
