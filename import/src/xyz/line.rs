//! A line of an XYZ file: which of its words are east, north and height, and their numbers.
//!
//! The sign that separates words is found from the first line of numbers: a semicolon, else blanks, else a comma; so `1,5 2,5 3,5` has decimal commas and `1.5,2.5,3.5` does not.

use crate::text::{is_blank, number};

/// What stands between the words of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Separator {
    Semicolon,
    Blank,
    Comma,
}

/// How lines are to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Format {
    separator: Separator,
    /// Which word is east, north, height.
    pub(super) columns: [usize; 3],
}

/// Words of a header that mean east, north and height, in small letters without what is in brackets.
const NAMES: [&[&str]; 3] = [
    &[
        "x",
        "e",
        "east",
        "easting",
        "lon",
        "long",
        "longitude",
        "lng",
        "rechtswert",
        "x_coord",
        "xcoord",
        "ostwert",
        "utm_e",
        "point_x",
        "pointx",
    ],
    &[
        "y", "n", "north", "northing", "lat", "latitude", "hochwert", "y_coord", "ycoord", "nordwert",
        "utm_n", "point_y", "pointy",
    ],
    &[
        "z",
        "h",
        "height",
        "elev",
        "elevation",
        "alt",
        "altitude",
        "value",
        "hoehe",
        "h\u{f6}he",
        "depth",
        "grid_code",
        "dem",
        "dtm",
        "dgm",
        "z_coord",
        "zcoord",
        "band_1",
        "band1",
    ],
];

/// What the head of a file says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Head {
    pub(super) format: Format,
    /// Byte at which the first line of numbers begins.
    pub(super) data_at: usize,
    /// The name of the column of heights, if there is a header.
    pub(super) height_name: Option<String>,
}

/// Whether a line says nothing: it is empty or a remark.
pub(super) fn is_passed_over(line: &[u8]) -> bool {
    let first = line.iter().find(|byte| !is_blank(**byte));
    first.is_none_or(|byte| b"#%!".contains(byte)) || line.trim_ascii_start().starts_with(b"//")
}

impl Format {
    /// The words of a line.
    fn words(self, line: &[u8]) -> impl Iterator<Item = &[u8]> {
        let separator = self.separator;
        let is_separator = move |byte: &u8| match separator {
            Separator::Semicolon => *byte == b';',
            Separator::Comma => *byte == b',',
            Separator::Blank => is_blank(*byte),
        };
        line.split(is_separator).map(<[u8]>::trim_ascii).filter(|word| !word.is_empty())
    }

    /// East, north and height of a line; `None` if it has no three such numbers. A height may be NaN.
    pub(super) fn point(self, line: &[u8]) -> Option<[f64; 3]> {
        let mut point = [None; 3];
        for (i, word) in self.words(line).enumerate().take(self.columns.into_iter().max().unwrap_or(2) + 1) {
            for (to, column) in point.iter_mut().zip(self.columns) {
                if column == i {
                    *to = Some(number(word)?);
                }
            }
        }
        let [x, y, z] = point;
        Some([x.filter(|x| x.is_finite())?, y.filter(|y| y.is_finite())?, z?])
    }

    /// The format of a line of numbers in columns that are not named.
    fn of(line: &[u8]) -> Option<Self> {
        let formats = [Separator::Semicolon, Separator::Blank, Separator::Comma];
        formats.into_iter().map(|separator| Self { separator, columns: [0, 1, 2] }).find(|format| {
            let mut words = format.words(line);
            let three = words.by_ref().take(3).filter(|word| number(word).is_some()).count();
            three == 3 && (format.separator == Separator::Comma || format.point(line).is_some())
        })
    }
}

/// Looks at the beginning of a file: a header line if there is one, and two lines of numbers of one format. `None` if it is something else.
pub(super) fn head(text: &[u8]) -> Option<Head> {
    let mut at = if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let mut header: Option<&[u8]> = None;
    let mut first: Option<(Format, usize)> = None;
    while at < text.len() {
        let length = text[at..].iter().position(|byte| *byte == b'\n' || *byte == b'\r');
        // The last line may be cut off here, and a whole one has an end.
        let is_last = length.is_none();
        let line = &text[at..at + length.unwrap_or(text.len() - at)];
        let begins = at;
        at += line.len() + 1;
        if is_passed_over(line) {
            continue;
        }
        let format = Format::of(line);
        match (format, first) {
            (Some(format), None) => first = Some((format, begins)),
            (Some(format), Some((earlier, begun))) if format == earlier => {
                return Some(finish(format, begun, header));
            }
            // A line that is cut off says nothing.
            (_, Some((earlier, begun))) if is_last => return Some(finish(earlier, begun, header)),
            (None, None) if header.is_none() && !is_last => header = Some(line),
            _ => return None,
        }
    }
    first.map(|(format, begun)| finish(format, begun, header))
}

fn finish(format: Format, data_at: usize, header: Option<&[u8]>) -> Head {
    let names: Vec<String> = header.map_or_else(Vec::new, |line| {
        // Names may be separated otherwise than numbers.
        let text = String::from_utf8_lossy(line).to_lowercase();
        let parts: Vec<&str> = match format.separator {
            Separator::Semicolon => text.split(';').collect(),
            Separator::Comma => text.split(',').collect(),
            Separator::Blank => text.split_whitespace().collect(),
        };
        let plain = |name: &str| {
            let name = name.split(['[', '(']).next().unwrap_or_default();
            name.trim_matches(|c: char| !c.is_alphanumeric()).to_owned()
        };
        parts.into_iter().map(plain).collect()
    });
    let of = |wanted: &[&str]| names.iter().position(|name| wanted.contains(&name.as_str()));
    let columns = match (of(NAMES[0]), of(NAMES[1]), of(NAMES[2])) {
        (Some(x), Some(y), Some(z)) => [x, y, z],
        (Some(x), Some(y), None) => [x, y, (0..3).find(|i| *i != x && *i != y).unwrap_or(2)],
        _ => [0, 1, 2],
    };
    let height_name = names.get(columns[2]).filter(|name| !name.is_empty()).cloned();
    Head { format: Format { columns, ..format }, data_at, height_name }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(text: &str) -> Option<Vec<[f64; 3]>> {
        let head = head(text.as_bytes())?;
        let lines = text.as_bytes()[head.data_at..].split(|byte| *byte == b'\n');
        lines.filter(|line| !is_passed_over(line)).map(|line| head.format.point(line)).collect()
    }

    #[test]
    fn separators_headers_and_decimal_commas() {
        let wanted = Some(vec![[1.5, 2.5, 3.25], [4.5, 2.5, -6.0]]);
        for text in [
            "1.5 2.5 3.25\n4.5 2.5 -6\n",
            "1,5 2,5 3,25\r\n4,5 2,5 -6\r\n",
            "1.5,2.5,3.25\n4.5,2.5,-6",
            "1.5, 2.5, 3.25\n4.5, 2.5, -6",
            "1,5;2,5;3,25\n4,5;2,5;-6;7\n",
            "1.5\t2.5\t3.25\n4.5\t2.5\t-6\n",
            "X Y Z\n1.5 2.5 3.25\n4.5 2.5 -6\n",
            "\u{feff}# made by\n\"lat\",\"lon\",\"elev (m)\"\n2.5,1.5,3.25\n2.5,4.5,-6\n",
            "id;east;north;hoehe\n1;1,5;2,5;3,25\n2;4,5;2,5;-6\n",
            "  1.5   2.5   3.25  9 \n\n\n4.5 2.5 -6 9\n",
        ] {
            assert_eq!(points(text), wanted, "{text}");
        }
        for text in
            ["hello\nworld\n", "1 2\n3 4\n", "", "a b c\nd e f\n1 2 3\n4 5 6\n", "1 2 3\nx y z\n1 2 3\n"]
        {
            assert_eq!(head(text.as_bytes()), None, "{text}");
        }
    }
}
