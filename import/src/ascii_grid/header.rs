//! The head of an Esri ASCII grid: words and their values, in any order and any letters.
//!
//! It ends where a number stands in the place of a word. Everything that the file states in it is checked here, except the number of samples.

use crate::text::{number, shown, words};
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// Most bytes of a head; six or seven short lines.
pub(super) const MOST_BYTES: usize = 1 << 14;

/// Where a side of the grid is counted from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Edge {
    /// The outer edge of the south-western cell.
    Corner(f64),
    /// The middle of the south-western cell.
    Centre(f64),
}

/// What the head says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// Columns and rows.
    pub(super) samples: [u32; 2],
    /// Affine map of sample centres, row 0 in the north; none if the head does not say.
    pub(super) place: Option<[f64; 6]>,
    /// The value that means "no data", as it is written.
    pub(super) nodata: Option<String>,
    /// Byte of the text at which the samples begin.
    pub(super) data_at: usize,
    /// Words that are not known, and were passed over.
    pub(super) unknown: Vec<String>,
}

#[derive(Default)]
struct Found<'t> {
    columns: Option<&'t [u8]>,
    rows: Option<&'t [u8]>,
    west: Option<Edge>,
    south: Option<Edge>,
    step: [Option<f64>; 2],
    nodata: Option<&'t [u8]>,
    unknown: Vec<String>,
}

/// Whether a file that begins so is an Esri ASCII grid: its first word is one that such a head begins with.
pub(crate) fn is_ascii_grid(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let first = words(head).next().unwrap_or_default().to_ascii_lowercase();
    matches!(
        first.as_slice(),
        b"ncols"
            | b"nrows"
            | b"xllcorner"
            | b"yllcorner"
            | b"xllcenter"
            | b"yllcenter"
            | b"cellsize"
            | b"nodata_value"
    )
}

impl Header {
    /// Parses the head at the beginning of `text`, of the file at `path`.
    pub(super) fn parse(path: &Path, text: &[u8]) -> Result<Self, LayoutError> {
        let mut found = Found::default();
        let mut at = if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        loop {
            let (key, after_key) = word_from(text, at);
            // "nan" is a sample, and so is meant what begins with a digit, whatever follows.
            let is_number = number(key).is_some()
                || key.first().is_some_and(|byte| byte.is_ascii_digit() || b"+-.,*".contains(byte));
            if key.is_empty() || (is_number && found.columns.is_some() && found.rows.is_some()) {
                break;
            }
            let (value, after_value) = word_from(text, after_key);
            if is_number || value.is_empty() {
                return Err(damaged(
                    path,
                    format!(
                        "{} stands where a word such as \"ncols\" is expected; mend the head of the file",
                        shown(key)
                    ),
                ));
            }
            found.take(path, key, value)?;
            at = after_value;
        }
        let samples = [side(path, "ncols", found.columns)?, side(path, "nrows", found.rows)?];
        let place = found.place(samples);
        Ok(Self {
            samples,
            place,
            nodata: found.nodata.map(|word| String::from_utf8_lossy(word).replace(',', ".")),
            data_at: at,
            unknown: found.unknown,
        })
    }
}

impl<'t> Found<'t> {
    fn take(&mut self, path: &Path, key: &[u8], value: &'t [u8]) -> Result<(), LayoutError> {
        let measure = || {
            number(value).filter(|value| value.is_finite()).ok_or_else(|| {
                damaged(
                    path,
                    format!("{} {} is no number; mend the head of the file", shown(key), shown(value)),
                )
            })
        };
        let step = || {
            measure().and_then(|step| {
                if step > 0.0 {
                    return Ok(Some(step));
                }
                Err(damaged(
                    path,
                    format!("{} {} is no distance between samples; mend it", shown(key), shown(value)),
                ))
            })
        };
        match key.to_ascii_lowercase().as_slice() {
            b"ncols" => self.columns = Some(value),
            b"nrows" => self.rows = Some(value),
            b"xllcorner" => self.west = Some(Edge::Corner(measure()?)),
            b"xllcenter" | b"xllcentre" => self.west = Some(Edge::Centre(measure()?)),
            b"yllcorner" => self.south = Some(Edge::Corner(measure()?)),
            b"yllcenter" | b"yllcentre" => self.south = Some(Edge::Centre(measure()?)),
            b"cellsize" => self.step = [step()?; 2],
            b"dx" | b"xdim" => self.step[0] = step()?,
            b"dy" | b"ydim" => self.step[1] = step()?,
            b"nodata_value" | b"nodata" => self.nodata = Some(value),
            _ => self.unknown.push(shown(key)),
        }
        Ok(())
    }

    fn place(&self, [_, high]: [u32; 2]) -> Option<[f64; 6]> {
        let (west, south) = (self.west?, self.south?);
        let [dx, dy] = match self.step {
            [None, None] => return None,
            [dx, dy] => [dx.or(dy)?, dy.or(dx)?],
        };
        let centre = |edge: Edge, step: f64| match edge {
            Edge::Corner(at) => at + 0.5 * step,
            Edge::Centre(at) => at,
        };
        let north = centre(south, dy) + f64::from(high - 1) * dy;
        Some([centre(west, dx), dx, 0.0, north, 0.0, -dy])
    }
}

/// The next word from `at`, and the place behind it.
fn word_from(text: &[u8], at: usize) -> (&[u8], usize) {
    let rest = &text[at..];
    let Some(word) = words(rest).next() else { return (&[], text.len()) };
    // A word is a part of the text.
    let begins = rest.iter().position(|byte| !crate::text::is_blank(*byte)).unwrap_or(0);
    (word, at + begins + word.len())
}

fn side(path: &Path, key: &str, word: Option<&[u8]>) -> Result<u32, LayoutError> {
    let Some(word) = word else {
        return Err(damaged(path, format!("the head says no {key}; add it")));
    };
    let whole =
        number(word).filter(|value| value.fract() == 0.0 && (2.0..=f64::from(u32::MAX)).contains(value));
    // Within the type, by the filter.
    whole.map(|value| value as u32).ok_or_else(|| {
        damaged(path, format!("{key} {} makes no grid; at least 2 x 2 samples are needed", shown(word)))
    })
}

fn damaged(path: &Path, problem: String) -> LayoutError {
    LayoutError::damaged(path, "header", problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Header, String> {
        Header::parse(Path::new("a"), text.as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn heads_of_every_kind() {
        let corner =
            parsed("ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\nNODATA_value -9999\n1 2")
                .unwrap();
        assert_eq!((corner.samples, corner.place), ([3, 2], Some([105.0, 10.0, 0.0, 215.0, 0.0, -10.0])));
        assert_eq!((corner.nodata.as_deref(), corner.unknown.len()), (Some("-9999"), 0));
        let centre = parsed("\u{feff}NROWS 2\r\nNCOLS 3\r\nYLLCENTER 200,5\r\nXLLCENTER 100,5\r\nDX 10\r\nDY 20,5\r\nnodata_VALUE 1e20\r\n-1 ").unwrap();
        assert_eq!((centre.samples, centre.place), ([3, 2], Some([100.5, 10.0, 0.0, 221.0, 0.0, -20.5])));
        assert_eq!(centre.data_at, "\u{feff}NROWS 2\r\nNCOLS 3\r\nYLLCENTER 200,5\r\nXLLCENTER 100,5\r\nDX 10\r\nDY 20,5\r\nnodata_VALUE 1e20".len());
        assert_eq!(parsed("ncols 3 nrows 2 nan nan").unwrap().place, None);
        assert_eq!(parsed("ncols 3 nrows 2 xllcorner 1 yllcorner 2 foo bar 5").unwrap().unknown, ["foo"]);
        assert_eq!(parsed("ncols 3 nrows 2 xllcorner 1 yllcorner 2 dy 4 5").unwrap().place.unwrap()[1], 4.0);
    }

    #[test]
    fn wrong_heads_are_refused_with_words() {
        for (text, wanted) in [
            ("ncols 3", "no nrows"),
            ("ncols", "expected"),
            ("ncols 1 nrows 2 5", "at least 2 x 2"),
            ("ncols -3 nrows 2 5", "at least 2 x 2"),
            ("ncols 2.5 nrows 2 5", "at least 2 x 2"),
            ("ncols 99999999999 nrows 2 5", "at least 2 x 2"),
            ("ncols 3 nrows 2 cellsize 0 5", "no distance"),
            ("ncols 3 nrows 2 cellsize -1 5", "no distance"),
            ("ncols 3 nrows 2 xllcorner x 5", "no number"),
            ("ncols 3 5 6 7", "expected"),
        ] {
            let said = parsed(text).unwrap_err();
            assert!(said.contains(wanted), "{text}: {said}");
        }
    }
}
