//! World files beside elevation data: six numbers, from sample centres to coordinates.

use crate::reader::Said;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Longest text that is looked at; six numbers are some 150 bytes.
const MAX_BYTES: u64 = 1 << 16;

/// The place that a world file gives, if there is one.
///
/// # Errors
/// [`LayoutError::Unsupported`] for a file of that name that says something else.
pub(super) fn place(path: &Path) -> Result<Option<Said<[f64; 6]>>, LayoutError> {
    let own = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let mut extensions = Vec::new();
    // tif -> tfw, tifw; the first and the last letter of any other.
    let letters: Vec<char> = own.chars().collect();
    if let [first, .., last] = letters[..] {
        extensions.push(format!("{first}{last}w"));
        extensions.push(format!("{own}w"));
    }
    extensions.push("wld".into());
    let extensions: Vec<&str> = extensions.iter().map(String::as_str).collect();
    let Some((name, text)) = super::with_extension(path, &extensions, MAX_BYTES)? else { return Ok(None) };
    let refused = || {
        LayoutError::unsupported(
            path,
            format!(
                "the world file {name} beside it is a text of six numbers, and this one is not; mend it, or put it elsewhere"
            ),
        )
        .mended_by(Remedy::Extent)
    };
    // Some writers put a comma for the point.
    let numbers: Vec<f64> = text
        .split_whitespace()
        .map(|word| word.replace(',', ".").parse().ok().filter(|value: &f64| value.is_finite()))
        .collect::<Option<_>>()
        .ok_or_else(refused)?;
    let [a, d, b, e, c, f] = <[f64; 6]>::try_from(numbers).map_err(|_| refused())?;
    if a * e == b * d {
        return Err(refused());
    }
    Ok(Some(Said::new([c, a, b, f, d, e], name)))
}
