//! Writes a flight file frame by frame, and refuses what the format could not hold.
//!
//! What is written reads back bit for bit. [`Flight::write`] replaces the file only once it is complete.
#![cfg(feature = "files")]

use super::format::{
    FIELDS, MAGIC, MAX_FRAMES, MAX_NOTES, UNITS, VERSION, excerpt, fault_in, note_line, push_frame, values,
};
use super::{Flight, FlightError, FlightFrame};
use crate::sink::FileSink;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Takes the frames of a flight one after the other.
#[derive(Debug)]
pub struct FlightWriter<W> {
    output: W,
    path: PathBuf,
    text: String,
    line: u64,
    frames: u64,
    before_s: f64,
}

impl Flight {
    /// Writes the flight to `path`: a file appears when it is complete, a stream such as a pipe is written to directly.
    ///
    /// # Errors
    /// [`FlightError::Write`], [`FlightError::Output`], or why a note, a frame or their number does not fit the format.
    pub fn write(&self, path: &Path) -> Result<(), FlightError> {
        let sink = FileSink::create(path).map_err(FlightError::of_output)?;
        self.write_to(sink, path)?.publish().map_err(FlightError::of_output)
    }

    /// Writes the flight to `output`, which errors call `path`, flushes it and gives it back.
    ///
    /// # Errors
    /// As [`Flight::write`].
    pub fn write_to<W: Write>(&self, output: W, path: &Path) -> Result<W, FlightError> {
        let mut writer = FlightWriter::new(output, path, &self.notes)?;
        for frame in &self.frames {
            writer.push(frame)?;
        }
        writer.finish()
    }
}

impl<W: Write> FlightWriter<W> {
    /// Writes header and `notes` to `output`, which errors call `path`.
    ///
    /// # Errors
    /// [`FlightError::Write`], [`FlightError::Note`] or [`FlightError::TooManyNotes`].
    pub fn new(output: W, path: &Path, notes: &[(String, String)]) -> Result<Self, FlightError> {
        let mut writer =
            Self { output, path: path.into(), text: String::new(), line: 1, frames: 0, before_s: 0.0 };
        writer.text = format!("{MAGIC} {VERSION}");
        writer.end_line()?;
        writer.text = UNITS.join(" ");
        writer.end_line()?;
        for (name, value) in notes.iter() {
            let (path, line) = (writer.path.clone(), writer.line);
            if line - 3 == MAX_NOTES as u64 {
                return Err(FlightError::TooManyNotes { path, line });
            }
            let Some(text) = note_line(name, value) else {
                return Err(FlightError::Note { path, line, name: excerpt(name), value: excerpt(value) });
            };
            writer.text = text;
            writer.end_line()?;
        }
        writer.text = format!("# {}", FIELDS.join(" "));
        writer.end_line()?;
        Ok(writer)
    }

    /// Writes the next frame.
    ///
    /// # Errors
    /// [`FlightError::Write`], [`FlightError::NotFinite`], [`FlightError::OutOfRange`],
    /// [`FlightError::TimeBackwards`] or [`FlightError::TooManyFrames`]; the frame is then not written.
    pub fn push(&mut self, frame: &FlightFrame) -> Result<(), FlightError> {
        let (path, line) = (|| self.path.clone(), self.line);
        let values = values(frame);
        if let Some(fault) = fault_in(&values) {
            let (field, found, allowed) = (fault.field, fault.found, fault.allowed);
            return Err(if found.is_finite() {
                FlightError::OutOfRange { path: path(), line, field, found, allowed }
            } else {
                FlightError::NotFinite { path: path(), line, field, found: found.to_string() }
            });
        }
        if frame.time_s < self.before_s {
            return Err(FlightError::TimeBackwards {
                path: path(),
                line,
                found: frame.time_s,
                before: self.before_s,
            });
        }
        if self.frames == MAX_FRAMES {
            return Err(FlightError::TooManyFrames { path: path(), line });
        }
        self.before_s = frame.time_s;
        self.frames += 1;
        // Formatting into a string cannot fail.
        let _ = push_frame(&mut self.text, &values);
        self.end_line()
    }

    /// Flushes and gives the output back. A flight without frames is refused.
    ///
    /// # Errors
    /// [`FlightError::Write`] or [`FlightError::NoFrames`].
    pub fn finish(mut self) -> Result<W, FlightError> {
        if self.frames == 0 {
            return Err(FlightError::NoFrames { path: self.path });
        }
        match self.output.flush() {
            Ok(()) => Ok(self.output),
            Err(source) => Err(FlightError::Write { path: self.path, source }),
        }
    }

    fn end_line(&mut self) -> Result<(), FlightError> {
        self.text.push('\n');
        let written = self.output.write_all(self.text.as_bytes());
        self.text.clear();
        self.line += 1;
        written.map_err(|source| FlightError::Write { path: self.path.clone(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::super::format::frame_of;
    use super::*;
    use proptest::prelude::*;

    fn text_of(flight: &Flight) -> Result<String, FlightError> {
        flight.write_to(Vec::new(), Path::new("f.flight")).map(|bytes| String::from_utf8(bytes).unwrap())
    }

    fn flight(values: &[[f64; 8]]) -> Flight {
        Flight { notes: Vec::new(), frames: values.iter().copied().map(frame_of).collect() }
    }

    #[test]
    fn the_specifications_example_is_what_is_written() {
        let mut example = flight(&[
            [0.0, 81910.0, 8191.0, 5200.5, 0.0, -15.0, 0.0, 45.0],
            [1.0 / 30.0, 81910.0, 8203.0, 5200.5, 0.0, -15.0, 0.0, 45.0],
        ]);
        example.notes.push(("terrain".into(), "alps.iqt".into()));
        let text = text_of(&example).unwrap();
        let indented: String = text.lines().map(|l| format!("    {l}\n")).collect();
        assert!(include_str!("FLIGHT.md").contains(&indented), "{text}");
    }

    #[test]
    fn what_does_not_fit_is_refused_at_its_line() {
        let message = |f: &Flight| text_of(f).unwrap_err().to_string();
        let ok = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 45.0];
        let mut late = ok;
        late[0] = 1.0;
        let mut nan = ok;
        nan[4] = f64::NAN;
        assert!(message(&flight(&[])).contains("no frames"));
        assert!(message(&flight(&[late, ok])).contains("f.flight:5: time_s goes back"));
        assert!(message(&flight(&[ok, nan])).contains("f.flight:5: yaw_deg is NaN"));
        let note = |n: &str, v: &str| Flight { notes: vec![(n.into(), v.into())], ..flight(&[ok]) };
        for bad in [note("Upper", "x"), note("a", ""), note("a", "b\n0 0 0"), note("a", " b")] {
            assert!(message(&bad).contains("f.flight:3: the note"), "{}", message(&bad));
        }
    }

    #[test]
    fn the_file_is_replaced_only_when_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.flight");
        let good = flight(&[[0.0, 1.0, -0.0, 1e-300, 0.1, 0.2, 0.3, 45.0]]);
        good.write(&path).unwrap();
        flight(&[]).write(&path).unwrap_err();
        assert_eq!(Flight::read(&path).unwrap(), good);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no leftovers");
        let error = good.write(&folder.path().join("none/a.flight")).unwrap_err().to_string();
        assert!(error.contains("none/a.flight") && error.contains("check the folder"), "{error}");
    }

    prop_compose! {
        fn any_frame()(
            time in 0.0..1e9f64,
            eye in prop::array::uniform3(-1e9..=1e9f64),
            yaw in -1e9..=1e9f64,
            pitch in -90.0..=90.0f64,
            roll in prop_oneof![Just(-0.0f64), Just(5e-324), -1e9..=1e9f64],
            fov in 1e-9..179.999f64,
        ) -> [f64; 8] {
            [time, eye[0], eye[1], eye[2], yaw, pitch, roll, fov]
        }
    }

    proptest! {
        #[test]
        fn a_flight_survives_the_file(
            mut frames in prop::collection::vec(any_frame(), 1..20),
            notes in prop::collection::vec(("[a-z][a-z0-9-]{0,8}", "[!-~]([ -~é]{0,20}[!-~])?"), 0..4),
        ) {
            frames.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let flight = Flight { notes, ..flight(&frames) };
            let bytes = flight.write_to(Vec::new(), Path::new("x")).unwrap();
            let mut reader = super::super::FlightReader::new(&bytes[..], Path::new("x")).unwrap();
            let back: Vec<_> = reader.by_ref().map(|f| values(&f.unwrap()).map(f64::to_bits)).collect();
            prop_assert_eq!(back, frames.iter().map(|f| f.map(f64::to_bits)).collect::<Vec<_>>());
            prop_assert_eq!(reader.notes(), &flight.notes[..]);
        }
    }
}
