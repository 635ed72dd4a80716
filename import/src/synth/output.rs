//! The file being written: GeoTIFF or PNG, row after row, without a name until it is complete.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, StreamWriter};

use super::{HEIGHT_SCALE, SynthOptions, tiff_header};
use crate::{PNG_HEIGHT_SCALE_KEY, PNG_SPACING_KEY};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::atomic::AtomicFile;
use terrasoar_layout::machine::free_disk_bytes;

/// The words of a PNG, in their order.
pub(super) const PNG_KEYS: [&str; 2] = [PNG_SPACING_KEY, PNG_HEIGHT_SCALE_KEY];

const CANNOT_WRITE: &str = "cannot write the terrain";

/// A file that takes rows of heights.
pub(super) struct Output {
    file: AtomicFile,
    failure: Failure,
    encoder: Encoding,
    bytes: Vec<u8>,
}

enum Encoding {
    Tiff(BufWriter<Watched>),
    Png(Box<StreamWriter<'static, BufWriter<Watched>>>),
}

impl Output {
    /// Starts a file of `size` rows of `size` samples.
    pub(super) fn create(out: &Path, options: &SynthOptions) -> Result<Self, LayoutError> {
        let SynthOptions { size, spacing_m, .. } = *options;
        let extension = out.extension().map(|extension| extension.to_ascii_lowercase());
        let png = match extension.as_ref().and_then(|extension| extension.to_str()) {
            Some("png") => true,
            Some("tif" | "tiff") => false,
            _ => {
                return Err(LayoutError::Usage(format!(
                    "{}: synthetic terrain is written as GeoTIFF or PNG; give the file the extension .tif or .png",
                    out.display()
                )));
            }
        };
        let failed = |source| LayoutError::io(out, CANNOT_WRITE, source);
        // How much a PNG takes only its samples tell.
        if !png {
            let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
            let free = free_disk_bytes(folder.unwrap_or(Path::new(".")));
            check_room(out, options.sample_bytes(), free)?;
        }
        let atomic = AtomicFile::create(out)?;
        let failure = Failure::default();
        let watched =
            Watched { file: atomic.file().try_clone().map_err(failed)?, failure: Arc::clone(&failure) };
        let mut file = BufWriter::with_capacity(1 << 18, watched);
        let encoder = if png {
            let mut encoder = Encoder::new(file, size, size);
            encoder.set_color(ColorType::Grayscale);
            encoder.set_depth(BitDepth::Sixteen);
            encoder.set_compression(Compression::Fast);
            let writer = encoder
                .add_text_chunk(PNG_KEYS[0].into(), spacing_m.to_string())
                .and_then(|()| encoder.add_text_chunk(PNG_KEYS[1].into(), HEIGHT_SCALE.to_string()))
                .and_then(|()| encoder.write_header())
                .and_then(|writer| writer.into_stream_writer_with_size(1 << 18));
            Encoding::Png(Box::new(writer.map_err(|error| failed(png_error(error)))?))
        } else {
            file.write_all(&tiff_header::header(size, spacing_m)).map_err(failed)?;
            Encoding::Tiff(file)
        };
        Ok(Self { file: atomic, failure, encoder, bytes: Vec::new() })
    }

    /// Appends whole rows.
    pub(super) fn write_rows(&mut self, samples: &[u16]) -> Result<(), LayoutError> {
        self.bytes.clear();
        let written = match &mut self.encoder {
            Encoding::Tiff(file) => {
                self.bytes.extend(samples.iter().flat_map(|sample| sample.to_le_bytes()));
                file.write_all(&self.bytes)
            }
            Encoding::Png(writer) => {
                self.bytes.extend(samples.iter().flat_map(|sample| sample.to_be_bytes()));
                writer.write_all(&self.bytes)
            }
        };
        written.map_err(|source| LayoutError::io(self.file.target(), CANNOT_WRITE, source))
    }

    /// Flushes everything to disk and gives the file its name.
    pub(super) fn finish(self) -> Result<(), LayoutError> {
        let failed = |source| LayoutError::io(self.file.target(), CANNOT_WRITE, source);
        match self.encoder {
            Encoding::Tiff(mut file) => file.flush().map_err(failed)?,
            Encoding::Png(writer) => writer.finish().map_err(|error| failed(png_error(error)))?,
        }
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        match failure {
            Some(source) => Err(failed(source)),
            None => self.file.publish(),
        }
    }
}

/// Refuses what does not fit the disk.
fn check_room(out: &Path, bytes: u64, free: Option<u64>) -> Result<(), LayoutError> {
    match free {
        Some(free) if free < bytes => Err(LayoutError::Usage(format!(
            "{}: every sample is stored, which takes {bytes} bytes, and {free} are free on that disk; take a smaller size, or another disk. Terrain \
             of this size is mostly void as a rule: a sparse GeoTIFF holds that in as little as it has heights",
            out.display()
        ))),
        _ => Ok(()),
    }
}

/// The first failure of a [`Watched`] file.
type Failure = Arc<Mutex<Option<io::Error>>>;

/// A file that remembers its first failure: the PNG encoder writes its last chunks while it is dropped, and cannot report an error then.
struct Watched {
    file: File,
    failure: Failure,
}

impl Watched {
    fn heard<T>(&self, done: io::Result<T>) -> io::Result<T> {
        if let Err(error) = &done {
            let copy = error.raw_os_error().map_or_else(|| error.kind().into(), io::Error::from_raw_os_error);
            self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(copy);
        }
        done
    }
}

impl Write for Watched {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let done = self.file.write(bytes);
        // An interrupted call is made again.
        if done.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::Interrupted) {
            return done;
        }
        self.heard(done)
    }

    fn flush(&mut self) -> io::Result<()> {
        let done = self.file.flush();
        self.heard(done)
    }
}

fn png_error(error: EncodingError) -> std::io::Error {
    match error {
        EncodingError::IoError(source) => source,
        other => std::io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_the_disk_is_refused_before_it_is_begun() {
        let bytes = SynthOptions::default().size(1_048_577).sample_bytes();
        assert_eq!(bytes, 2_199_027_449_858);
        assert!(check_room(Path::new("a.tif"), bytes, None).is_ok());
        assert!(check_room(Path::new("a.tif"), bytes, Some(bytes)).is_ok());
        let said = check_room(Path::new("a.tif"), bytes, Some(5000)).unwrap_err().to_string();
        assert!(
            said.contains("a.tif: ") && said.contains("2199027449858 bytes, and 5000 are free"),
            "{said}"
        );
    }
}
