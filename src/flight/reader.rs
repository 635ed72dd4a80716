//! Reads a flight file frame by frame: header and notes first, then each frame as it is asked for.
//!
//! Holds one line at a time, so a flight of any length costs a few kilobytes; every frame that comes out has
//! been checked against the format's ranges.

use super::format::{
    self, FIELDS, MAGIC, MAX_FRAMES, MAX_LINE_BYTES, MAX_NOTES, UNITS, VERSION, excerpt, fault_in, frame_of,
    note_of,
};
use super::{Flight, FlightError, FlightFrame};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// The frames of a flight file, one after the other. After an error it yields no more.
#[derive(Debug)]
pub struct FlightReader<R> {
    input: R,
    path: PathBuf,
    buffer: Vec<u8>,
    line: u64,
    notes: Vec<(String, String)>,
    /// The first frame, read while looking for the end of the notes.
    first: Option<FlightFrame>,
    frames: u64,
    before_s: f64,
    done: bool,
}

impl Flight {
    /// Reads a whole flight file.
    ///
    /// # Errors
    /// Any [`FlightError`] but [`FlightError::Write`] and [`FlightError::Note`].
    pub fn read(path: &Path) -> Result<Self, FlightError> {
        let mut reader = FlightReader::open(path)?;
        let frames = reader.by_ref().collect::<Result<_, _>>()?;
        Ok(Self { notes: reader.notes, frames })
    }
}

impl FlightReader<BufReader<File>> {
    /// Opens the flight file at `path` and reads as far as its first frame.
    ///
    /// # Errors
    /// As [`Flight::read`].
    pub fn open(path: &Path) -> Result<Self, FlightError> {
        let file = File::open(path).map_err(|source| FlightError::Read { path: path.into(), source })?;
        Self::new(BufReader::new(file), path)
    }
}

impl<R: BufRead> FlightReader<R> {
    /// Reads `input` as far as its first frame; errors call it `path`.
    ///
    /// # Errors
    /// As [`Flight::read`].
    pub fn new(input: R, path: &Path) -> Result<Self, FlightError> {
        let mut reader = Self {
            input,
            path: path.into(),
            buffer: Vec::with_capacity(256),
            line: 0,
            notes: Vec::new(),
            first: None,
            frames: 0,
            before_s: 0.0,
            done: false,
        };
        reader.read_header()?;
        reader.first = reader.read_frame()?;
        if reader.first.is_none() {
            return Err(FlightError::NoFrames { path: reader.path });
        }
        Ok(reader)
    }

    /// The notes before the first frame, in file order.
    pub fn notes(&self) -> &[(String, String)] {
        &self.notes
    }

    fn read_header(&mut self) -> Result<(), FlightError> {
        let not_a_flight =
            |path: &Path, found: &str| FlightError::NotAFlight { path: path.into(), found: found.into() };
        let first = match read_line(&mut self.input, &mut self.buffer, &self.path, &mut self.line) {
            Ok(line) => line,
            Err(FlightError::NotText { path, .. }) => {
                return Err(not_a_flight(&path, "bytes that are not text"));
            }
            Err(FlightError::LineTooLong { path, .. }) => {
                return Err(not_a_flight(&path, "a very long line"));
            }
            Err(other) => return Err(other),
        };
        let Some(first) = first else { return Err(not_a_flight(&self.path, "nothing: it is empty")) };
        let first = first.strip_prefix('\u{feff}').unwrap_or(first);
        let mut words = first.split_ascii_whitespace();
        let version = match (words.next(), words.next(), words.next()) {
            (Some(MAGIC), Some(version), None) if version.bytes().all(|b| b.is_ascii_digit()) => version,
            _ => return Err(not_a_flight(&self.path, &excerpt(first))),
        };
        match version.parse::<u32>() {
            Ok(VERSION) => {}
            Ok(older) if older < VERSION => return Err(not_a_flight(&self.path, &excerpt(first))),
            _ => return Err(FlightError::Newer { path: self.path.clone(), found: excerpt(version) }),
        }
        let second =
            read_line(&mut self.input, &mut self.buffer, &self.path, &mut self.line)?.unwrap_or_default();
        if !second.split_ascii_whitespace().eq(UNITS) {
            return Err(FlightError::Units { path: self.path.clone(), found: excerpt(second) });
        }
        Ok(())
    }

    /// The next frame; `None` at the end of the file. Keeps the notes that stand before the first.
    fn read_frame(&mut self) -> Result<Option<FlightFrame>, FlightError> {
        loop {
            let line = read_line(&mut self.input, &mut self.buffer, &self.path, &mut self.line)?;
            let (path, at) = (&self.path, self.line);
            let Some(text) = line.map(|l| l.trim_matches([' ', '\t'])) else { return Ok(None) };
            if text.starts_with('#') {
                if let (0, Some((name, value))) = (self.frames, note_of(text)) {
                    if self.notes.len() == MAX_NOTES {
                        return Err(FlightError::TooManyNotes { path: path.clone(), line: at });
                    }
                    self.notes.push((name.into(), value.into()));
                }
                continue;
            }
            if text.is_empty() {
                continue;
            }
            if self.frames == MAX_FRAMES {
                return Err(FlightError::TooManyFrames { path: path.clone(), line: at });
            }
            let frame = parse_frame(text, path, at)?;
            if frame.time_s < self.before_s {
                return Err(FlightError::TimeBackwards {
                    path: path.clone(),
                    line: at,
                    found: frame.time_s,
                    before: self.before_s,
                });
            }
            self.before_s = frame.time_s;
            self.frames += 1;
            return Ok(Some(frame));
        }
    }
}

impl<R: BufRead> Iterator for FlightReader<R> {
    type Item = Result<FlightFrame, FlightError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(first) = self.first.take() {
            return Some(Ok(first));
        }
        if self.done {
            return None;
        }
        let frame = self.read_frame().transpose();
        self.done = !matches!(frame, Some(Ok(_)));
        frame
    }
}

/// The next line without its end, and its number counted; `None` at the end of the input.
fn read_line<'a>(
    input: &mut impl BufRead,
    buffer: &'a mut Vec<u8>,
    path: &Path,
    line: &mut u64,
) -> Result<Option<&'a str>, FlightError> {
    buffer.clear();
    // Two bytes more than a line may have: its end.
    let got = input
        .take(MAX_LINE_BYTES as u64 + 2)
        .read_until(b'\n', buffer)
        .map_err(|source| FlightError::Read { path: path.into(), source })?;
    if got == 0 {
        return Ok(None);
    }
    *line += 1;
    let bytes = buffer.strip_suffix(b"\n").unwrap_or(buffer);
    let bytes = bytes.strip_suffix(b"\r").unwrap_or(bytes);
    if bytes.len() > MAX_LINE_BYTES {
        return Err(FlightError::LineTooLong { path: path.into(), line: *line });
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(Some(text)),
        Err(_) => Err(FlightError::NotText { path: path.into(), line: *line }),
    }
}

fn parse_frame(text: &str, path: &Path, line: u64) -> Result<FlightFrame, FlightError> {
    let found = text.split_ascii_whitespace().count();
    if found != FIELDS.len() {
        return Err(FlightError::FieldCount { path: path.into(), line, found });
    }
    let mut values = [0.0; 8];
    for ((value, field), text) in values.iter_mut().zip(FIELDS).zip(text.split_ascii_whitespace()) {
        let parsed = text.parse::<f64>().ok();
        let path = path.to_path_buf();
        match parsed {
            Some(number) if !number.is_finite() => {
                return Err(FlightError::NotFinite { path, line, field, found: excerpt(text) });
            }
            Some(number) if format::is_decimal(text) => *value = number,
            _ => return Err(FlightError::NotANumber { path, line, field, found: excerpt(text) }),
        }
    }
    match fault_in(&values) {
        None => Ok(frame_of(values)),
        Some(f) => Err(FlightError::OutOfRange {
            path: path.into(),
            line,
            field: f.field,
            found: f.found,
            allowed: f.allowed,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HEAD: &str = "terrasoar-flight 1\nunits metres degrees seconds\n";

    fn read(bytes: &[u8]) -> Result<Vec<FlightFrame>, FlightError> {
        FlightReader::new(bytes, Path::new("f.flight"))?.collect()
    }

    fn message(text: &str) -> String {
        read(text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn a_file_as_people_write_it_is_read() {
        let text = "\u{feff}terrasoar-flight  1\r\nunits metres degrees seconds\r\n\r\n# terrain: alps\r\n\t# a remark\r\n\
                    0 1 2 3 4 5 6 45\r\n# later: dropped\r\n 1\t1 2 3 4 5 6 45";
        let mut reader = FlightReader::new(text.as_bytes(), Path::new("x")).unwrap();
        assert_eq!(reader.notes(), [("terrain".to_owned(), "alps".to_owned())]);
        assert_eq!(reader.next().unwrap().unwrap(), frame_of([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 45.0]));
        assert_eq!(reader.next().unwrap().unwrap().time_s, 1.0);
        assert!(reader.next().is_none() && reader.next().is_none());
        assert_eq!(reader.notes().len(), 1);
    }

    #[test]
    fn every_fault_names_file_line_and_remedy() {
        let frame = |f: &str| format!("{HEAD}{f}\n");
        let ok = "0 0 0 0 0 0 0 45";
        for (text, says) in [
            (String::new(), "f.flight:1: not a flight file: it starts with nothing"),
            ("hello\n".into(), "f.flight:1: not a flight file: it starts with `hello`"),
            ("terrasoar-flight 0\n".into(), "not a flight file"),
            ("terrasoar-flight -1\n".into(), "not a flight file"),
            ("terrasoar-flight 2\n".into(), "version `2` of the flight format"),
            ("terrasoar-flight 99999999999999\n".into(), "use a newer terrasoar"),
            ("terrasoar-flight 1\nunits feet\n".into(), "f.flight:2: found `units feet`"),
            ("terrasoar-flight 1".into(), "f.flight:2: found ``"),
            (HEAD.into(), "f.flight: the flight has no frames"),
            (frame("1 2 3"), "f.flight:3: 3 fields instead of 8"),
            (frame("0 0 0 0 0 0 0 45 # x"), "10 fields instead of 8"),
            (frame("0 0 zero 0 0 0 0 45"), "f.flight:3: north_m is `zero`, not a number"),
            (frame("0 0 0 inf 0 0 0 45"), "up_m is `inf`, which is not a finite number"),
            (frame("0 0 0 1e999 0 0 0 45"), "not a finite number"),
            (frame("0 1.1e9 0 0 0 0 0 45"), "east_m is 1100000000; it must be from -1e9 to 1e9"),
            (frame("0 0 0 0 0 90.5 0 45"), "pitch_deg is 90.5"),
            (frame("0 0 0 0 0 0 0 180"), "vfov_deg is 180; it must be above 0 and below 180"),
            (frame("-1 0 0 0 0 0 0 45"), "time_s is -1"),
            (
                frame(&format!("{ok}\n2{}\n1{}", &ok[1..], &ok[1..])),
                "f.flight:5: time_s goes back from 2 to 1",
            ),
            (frame(&format!("{ok}\n{}", "1".repeat(5000))), "f.flight:4: the line is longer than 4096 bytes"),
        ] {
            let found = message(&text);
            assert!(found.contains(says) && found.contains("f.flight"), "{found}\nshould say: {says}");
            assert!(found.len() < 200, "{found}");
        }
        let notes: String = (0..257).map(|i| format!("# n{i}: v\n")).collect();
        assert!(
            message(&format!("{HEAD}{notes}")).contains("f.flight:259: the flight has more than 256 notes")
        );
    }

    #[test]
    fn a_picture_is_no_flight() {
        let png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR";
        let found = read(png).unwrap_err().to_string();
        assert!(found.contains("bytes that are not text"), "{found}");
        assert!(read(&vec![b'a'; 1 << 20]).unwrap_err().to_string().contains("a very long line"));
        let mut late = format!("{HEAD}# x\n").into_bytes();
        late.extend(b"\xff\xfe\n");
        assert!(matches!(read(&late), Err(FlightError::NotText { line: 4, .. })));
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = Flight::read(Path::new("/no/such.flight")).unwrap_err();
        assert!(matches!(error, FlightError::Read { .. }) && error.to_string().contains("/no/such.flight"));
    }

    #[test]
    fn nothing_comes_after_an_error() {
        let text = format!("{HEAD}0 0 0 0 0 0 0 45\nbad\n1 0 0 0 0 0 0 45\n");
        let mut reader = FlightReader::new(text.as_bytes(), Path::new("x")).unwrap();
        assert!(reader.next().unwrap().is_ok());
        assert!(reader.next().unwrap().is_err());
        assert!(reader.next().is_none());
    }

    #[test]
    fn the_frame_limit_holds() {
        struct Endless(usize);
        impl Read for Endless {
            fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
                let line = b"0 0 0 0 0 0 0 45\n";
                for byte in to.iter_mut() {
                    *byte = line[self.0 % line.len()];
                    self.0 += 1;
                }
                Ok(to.len())
            }
        }
        let input = BufReader::new(HEAD.as_bytes().chain(Endless(0)));
        let mut reader = FlightReader::new(input, Path::new("x")).unwrap();
        // Skip ahead rather than read ten million lines.
        reader.frames = MAX_FRAMES - 1;
        assert_eq!(reader.by_ref().take_while(Result::is_ok).count(), 2);
        assert!(reader.done);
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(tail in prop::collection::vec(any::<u8>(), 0..200), headed in any::<bool>()) {
            let mut bytes = if headed { HEAD.as_bytes().to_vec() } else { Vec::new() };
            bytes.extend(tail);
            if let Ok(frames) = read(&bytes) {
                prop_assert!(frames.iter().all(|f| fault_in(&format::values(f)).is_none()));
            }
        }

        #[test]
        fn no_text_makes_it_panic(tail in "[-0-9.e #:a\n]{0,120}") {
            let _ = read(format!("{HEAD}{tail}").as_bytes());
        }
    }
}
