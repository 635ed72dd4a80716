//! A table of places: which sign separates its columns, which columns are the place, and its rows one after the other.
//!
//! A table only has to have as many fields in each row as in the first. Fields stay as they are. **Memory is bounded whatever the file is**: a row longer than a
//! mebibyte, such as an open quotation mark makes, is refused. Cost: crate `csv`'s one pass.

use anyhow::{Context, Result, anyhow, bail};
use csv::{ByteRecord, ReaderBuilder};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{self, Cursor, Read};
use std::path::Path;
use std::rc::Rc;

/// Longest row in bytes.
const LONGEST_ROW: u64 = 1 << 20;
/// Bytes looked at to tell the separator.
const LOOK: usize = 1 << 16;
/// Names of columns that hold a place, the likeliest first; degrees where marked.
const NAMES: [([&str; 2], bool); 13] = [
    (["x", "y"], false),
    (["east", "north"], false),
    (["easting", "northing"], false),
    (["x_m", "y_m"], false),
    (["east_m", "north_m"], false),
    (["e", "n"], false),
    (["lon", "lat"], true),
    (["long", "lat"], true),
    (["lng", "lat"], true),
    (["longitude", "latitude"], true),
    (["lon_deg", "lat_deg"], true),
    (["longitude_deg", "latitude_deg"], true),
    (["decimallongitude", "decimallatitude"], true),
];

/// What is known of the bytes that were read.
#[derive(Default)]
struct Passed {
    /// Bytes that the row may still have.
    left: u64,
    bytes: u64,
    /// Where lines end that no row has passed yet.
    ends: VecDeque<u64>,
    lines: u64,
}

/// A reader that gives up where a row takes too much.
struct Bounded<R> {
    from: R,
    passed: Rc<RefCell<Passed>>,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut passed = self.passed.borrow_mut();
        passed.left = passed.left.checked_sub(bytes.len() as u64).ok_or_else(|| {
            io::Error::other(
                "a row is longer than a mebibyte; is a quotation mark left open, or is this no table?",
            )
        })?;
        let read = self.from.read(bytes)?;
        let start = passed.bytes;
        let is_end = |(_, byte): &(usize, &u8)| **byte == b'\n';
        passed.ends.extend(bytes[..read].iter().enumerate().filter(is_end).map(|(at, _)| start + at as u64));
        passed.bytes += read as u64;
        Ok(read)
    }
}

/// A table under way.
pub(super) struct Table<R> {
    reader: csv::Reader<Bounded<io::Chain<Cursor<Vec<u8>>, R>>>,
    passed: Rc<RefCell<Passed>>,
    /// What the messages call it.
    name: String,
    pub(super) separator: u8,
    /// Names of columns, if it has them.
    pub(super) header: Option<ByteRecord>,
    /// The first row of values, where that was read to look for names.
    first: Option<(ByteRecord, u64)>,
    /// Which columns are the place, east before north.
    columns: [usize; 2],
    /// Whether their names say that they are degrees.
    pub(super) is_lon_lat: bool,
    fields: usize,
}

impl<R: Read> Table<R> {
    /// Looks at the first row. `wants_degrees`: whether places are given as longitude and latitude, if that is known.
    pub(super) fn new(path: &Path, mut from: R, wants_degrees: Option<bool>) -> Result<Self> {
        let name = if path == Path::new("-") { "standard input".into() } else { path.display().to_string() };
        let mut start = Vec::new();
        while start.len() < LOOK && !start.contains(&b'\n') {
            if read_some(&mut from, &mut start).with_context(|| format!("{name}: cannot read the table"))?
                == 0
            {
                break;
            }
        }
        if start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff") {
            bail!("{name}: the table is in UTF-16; save it as UTF-8");
        }
        if start.starts_with(b"\xef\xbb\xbf") {
            start.drain(..3);
        }
        let separator = separator(&start);
        let passed = Rc::new(RefCell::new(Passed::default()));
        let from = Bounded { from: Cursor::new(start).chain(from), passed: Rc::clone(&passed) };
        let reader =
            ReaderBuilder::new().delimiter(separator).has_headers(false).flexible(true).from_reader(from);
        let mut table = Self {
            reader,
            passed,
            name,
            separator,
            header: None,
            first: None,
            columns: [0, 1],
            is_lon_lat: false,
            fields: 0,
        };
        let mut first = ByteRecord::new();
        let Some(line) = table.read_row(&mut first)? else { return Ok(table) };
        // A sign of a comment that stands alone is no name.
        if first.get(0) == Some(b"#") && separator == b' ' {
            first = first.iter().skip(1).collect();
        }
        table.fields = first.len();
        if let Some((columns, is_lon_lat)) = named(&first, wants_degrees) {
            (table.columns, table.is_lon_lat, table.header) = (columns, is_lon_lat, Some(first));
        } else if first.len() >= 2 && (0..2).any(|column| table.number(&first[column]).is_none()) {
            // Names of columns are no numbers; a row with two is a place whose columns nothing names.
            if first.iter().filter(|field| table.number(field).is_some()).count() >= 2 {
                let shown = |column: usize| {
                    String::from_utf8_lossy(&first[column]).chars().take(40).collect::<String>()
                };
                bail!(
                    "{}, line {line}: the first two columns, `{}` and `{}`, are no place, and no row of names says which columns are; add a first row of names, such as name,lon,lat or name,x,y",
                    table.name,
                    shown(0),
                    shown(1)
                );
            }
            table.header = Some(first);
        } else {
            table.first = Some((first, line));
        }
        Ok(table)
    }

    /// The next row and its place; `None` at the end.
    pub(super) fn next(&mut self, row: &mut ByteRecord) -> Result<Option<[f64; 2]>> {
        let line = match self.first.take() {
            Some((first, line)) => {
                *row = first;
                line
            }
            None => match self.read_row(row)? {
                Some(line) => line,
                None => return Ok(None),
            },
        };
        let (name, count) =
            (&self.name, |n: usize| format!("{n} {}", if n == 1 { "field" } else { "fields" }));
        if row.len() < 2 {
            bail!("{name}, line {line}: a place needs two numbers, and there is {}", count(row.len()));
        }
        if row.len() != self.fields {
            bail!(
                "{name}, line {line}: there are {}, and {} in the first row",
                count(row.len()),
                self.fields
            );
        }
        let mut place = [0.0; 2];
        for (value, column) in place.iter_mut().zip(self.columns) {
            let field = &row[column];
            *value = self.number(field).ok_or_else(|| {
                let shown: String = String::from_utf8_lossy(field).chars().take(40).collect();
                anyhow!("{name}, line {line}: `{shown}` in column {} is not a finite number", column + 1)
            })?;
        }
        Ok(Some(place))
    }

    /// Reads a row and says which line it begins in; `None` at the end. Fields that only several spaces in a row make are left out.
    fn read_row(&mut self, row: &mut ByteRecord) -> Result<Option<u64>> {
        loop {
            self.passed.borrow_mut().left = 2 * LONGEST_ROW;
            let is_there = self.reader.read_byte_record(row).map_err(|error| match error.into_kind() {
                csv::ErrorKind::Io(error) => anyhow!("{}: cannot read the table: {error}", self.name),
                _ => anyhow!("{}: the table cannot be read", self.name),
            })?;
            if !is_there {
                return Ok(None);
            }
            let line = self.line(row);
            if self.separator == b' ' {
                *row = row.iter().filter(|field| !field.is_empty()).collect();
            }
            // A line of blanks is none.
            if row.len() > 1 || row.iter().any(|field| !field.trim_ascii().is_empty()) {
                return Ok(Some(line));
            }
        }
    }

    /// The line that a row begins in which was just read. The crate's own count is one off after blank lines, and where lines end in two characters.
    fn line(&self, row: &ByteRecord) -> u64 {
        let last = self.reader.position().byte().saturating_sub(1);
        let mut passed = self.passed.borrow_mut();
        while passed.ends.front().is_some_and(|end| *end < last) {
            passed.ends.pop_front();
            passed.lines += 1;
        }
        let within = row.as_slice().iter().filter(|byte| **byte == b'\n').count() as u64;
        // Where a quotation mark is left open, the last end of a line is in the row.
        let is_open = last + 1 == passed.bytes && row.as_slice().ends_with(b"\n");
        1 + passed.lines.saturating_sub(within - u64::from(is_open))
    }

    /// A finite number; with a comma for the point where commas do not separate.
    fn number(&self, field: &[u8]) -> Option<f64> {
        let text = std::str::from_utf8(field).ok()?.trim();
        let parsed = text.parse::<f64>().ok().or_else(|| {
            let may = self.separator != b',' && text.matches(',').count() == 1 && !text.contains('.');
            may.then(|| text.replace(',', ".").parse().ok()).flatten()
        });
        parsed.filter(|value| value.is_finite())
    }
}

/// Reads on, as much as is there; 0 at the end.
fn read_some(from: &mut impl Read, into: &mut Vec<u8>) -> io::Result<usize> {
    let mut bytes = [0; 4096];
    loop {
        match from.read(&mut bytes) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => {
                let read = read?;
                into.extend_from_slice(&bytes[..read]);
                return Ok(read);
            }
        }
    }
}

/// The columns that the first row names, and whether they are degrees.
fn named(first: &ByteRecord, wants_degrees: Option<bool>) -> Option<([usize; 2], bool)> {
    let names: Vec<String> = first
        .iter()
        .map(|name| String::from_utf8_lossy(name).trim().trim_start_matches('#').trim().to_lowercase())
        .collect();
    let find = |wanted: &str| names.iter().position(|name| name == wanted);
    let mut found =
        NAMES.iter().filter_map(|([x, y], degrees)| Some(([find(x)?, find(y)?], *degrees))).peekable();
    let any = found.peek().copied();
    found.find(|(_, degrees)| wants_degrees == Some(*degrees)).or(any)
}

/// The sign between columns: the first of tab, semicolon, comma and space that parts the first line.
fn separator(start: &[u8]) -> u8 {
    let line = start.split(|byte| matches!(byte, b'\n' | b'\r')).find(|line| !line.trim_ascii().is_empty());
    let line = line.unwrap_or_default().trim_ascii();
    let mut is_quoted = false;
    let signs: Vec<u8> = line
        .iter()
        .copied()
        .filter(|byte| {
            is_quoted ^= *byte == b'"';
            !is_quoted
        })
        .collect();
    [b'\t', b';', b',', b' '].into_iter().find(|sign| signs.contains(sign)).unwrap_or(b',')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, wants_degrees: Option<bool>) -> Result<(Vec<[f64; 2]>, bool, u8)> {
        let mut table = Table::new(Path::new("t.csv"), text.as_bytes(), wants_degrees)?;
        let (mut places, mut row) = (Vec::new(), ByteRecord::new());
        while let Some(place) = table.next(&mut row)? {
            places.push(place);
        }
        Ok((places, table.is_lon_lat, table.separator))
    }

    #[test]
    fn columns_are_found_by_name_or_are_the_first_two() {
        for (text, is_lon_lat, separator) in [
            ("1,2\n3,4.5\n", false, b','),
            ("x,y\n1,2\n3,4.5", false, b','),
            ("\u{feff}Y;name;X\r\n2;a;1\r\n4,5;\"b;c\";3\r\n", false, b';'),
            ("lat\tlon\n2\t1\n4.5\t3\n", true, b'\t'),
            ("# Longitude  Latitude\n  1   2\n3 4,5\n\n", true, b' '),
            ("\"id, place\",EAST,north\n7,1,2\n\n8,3,4.5\n", false, b','),
            ("here,there,z\n1,2,9\n3,4.5,9\n", false, b','),
            ("  1 2 a\n 3  4.5 b", false, b' '),
        ] {
            let found = read(text, None).unwrap();
            assert_eq!(found, (vec![[1.0, 2.0], [3.0, 4.5]], is_lon_lat, separator), "{text}");
        }
        let both = "lon,lat,x,y\n7,46,1,2\n";
        assert_eq!(read(both, None).unwrap().0, [[1.0, 2.0]]);
        assert_eq!(read(both, Some(true)).unwrap(), (vec![[7.0, 46.0]], true, b','));
        assert_eq!(read(both, Some(false)).unwrap().0, [[1.0, 2.0]]);
        assert_eq!(read("", None).unwrap().0.len() + read("\n\n", None).unwrap().0.len(), 0);
        assert_eq!(read("lon,lat\n", None).unwrap().0.len(), 0);
    }

    #[test]
    fn wrong_rows_are_told_by_their_line() {
        for (text, words) in [
            ("x,y\n1,2\n\n3,abc\n", "line 4: `abc` in column 2"),
            ("x,y\r\n1,2\r\n\r\n3,abc\r\n", "line 4: `abc`"),
            ("x,y,z\n1,2,\"a\nb\"\n3,abc,z", "line 4: `abc`"),
            ("x,y\n1,2\n3\n", "line 3: a place needs two numbers, and there is 1 field"),
            ("1,2\n3,4,5\n", "line 2: there are 3 fields, and 2 in the first row"),
            ("x,y\n1,\"2\n3,4\n", "line 2"),
            ("1,2\nnan,4\n", "line 2: `nan`"),
            ("1,2\n3,inf\n", "line 2: `inf`"),
            ("1,2\n3,\n", "line 2: `` in column 2"),
            ("7\n", "line 1: a place needs two numbers"),
            ("a,b\n\"1\n2\",3\n", "line 2"),
            ("\u{ff}\u{fe}", "line 1"),
        ] {
            let said = read(text, None).unwrap_err().to_string();
            assert!(said.contains("t.csv") && said.contains(words), "{text:?}: {said}");
        }
        let wide = Table::new(Path::new("-"), &b"\xff\xfe1\0"[..], None).err().unwrap().to_string();
        assert!(wide.contains("standard input") && wide.contains("UTF-16"), "{wide}");
    }

    /// A file without an end of line, or an open quotation mark, does not fill the memory.
    #[test]
    fn endless_rows_are_refused() {
        for start in ["x,y\n1,\"2", "1,2\n3,4"] {
            let endless = start.as_bytes().chain(io::repeat(b'7'));
            let mut table = Table::new(Path::new("t.csv"), endless, None).unwrap();
            let mut row = ByteRecord::new();
            let said = (0..3).find_map(|_| table.next(&mut row).err()).unwrap().to_string();
            assert!(said.contains("longer than a mebibyte"), "{said}");
        }
    }
}
