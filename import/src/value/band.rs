//! A band by its number or name, as a person gives it.

use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// The band, counted from 0, that `word` means among `bands`: a number counted from 1, or one of `names`, capitals or not.
///
/// # Errors
/// [`LayoutError::Usage`] for one that is not there, naming those that are.
pub(crate) fn band(path: &Path, word: &str, bands: usize, names: &[&str]) -> Result<usize, LayoutError> {
    let word = word.trim();
    let exact = names.iter().position(|name| *name == word && !word.is_empty());
    let alike = || names.iter().position(|name| name.eq_ignore_ascii_case(word) && !word.is_empty());
    let number = || word.parse::<usize>().ok().filter(|number| (1..=bands).contains(number)).map(|n| n - 1);
    exact.or_else(alike).or_else(number).ok_or_else(|| {
        let known: Vec<String> = (1..=bands)
            .take(20)
            .map(|number| match names.get(number - 1) {
                Some(name) if !name.is_empty() => format!("{number} \"{}\"", harmless(name, 40)),
                _ => number.to_string(),
            })
            .collect();
        LayoutError::Usage(format!(
            "{}: there is no band \"{}\"; there {} {}",
            path.display(),
            harmless(word, 40),
            if bands == 1 { "is" } else { "are" },
            known.join(", ")
        ))
        .mended_by(Remedy::Band)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_before_numbers() {
        let of = |word| band(Path::new("a.tif"), word, 3, &["elevation", "2", ""]).ok();
        assert_eq!(
            [of("Elevation"), of("1"), of("2"), of("3"), of("4"), of("0"), of("")],
            [Some(0), Some(0), Some(1), Some(2), None, None, None]
        );
        let said = band(Path::new("a.tif"), "depth", 2, &["elevation"]).unwrap_err().to_string();
        assert_eq!(said, "a.tif: there is no band \"depth\"; there are 1 \"elevation\", 2");
    }
}
