//! The file being written: GeoTIFF or PNG, row after row, under a temporary name until it is complete.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, StreamWriter};
use tempfile::{Builder, NamedTempFile};

use super::{HEIGHT_SCALE, tiff_header};
use crate::error::LayoutError;
use crate::import::{PNG_HEIGHT_SCALE_KEY, PNG_SPACING_KEY};

const CANNOT_WRITE: &str = "cannot write the terrain";

/// A file that takes rows of heights.
pub(super) struct Output {
    out: PathBuf,
    temporary: NamedTempFile,
    encoder: Encoding,
    bytes: Vec<u8>,
}

enum Encoding {
    Tiff(BufWriter<File>),
    Png(Box<StreamWriter<'static, BufWriter<File>>>),
}

impl Output {
    /// Starts a file of `size` rows of `size` samples.
    pub(super) fn create(out: &Path, size: u32, spacing_m: f64) -> Result<Self, LayoutError> {
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
        let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let temporary =
            builder().prefix(".terrasoar-").suffix(".part").tempfile_in(folder).map_err(failed)?;
        let mut file = BufWriter::with_capacity(1 << 18, temporary.reopen().map_err(failed)?);
        let encoder = if png {
            let mut encoder = Encoder::new(file, size, size);
            encoder.set_color(ColorType::Grayscale);
            encoder.set_depth(BitDepth::Sixteen);
            encoder.set_compression(Compression::Fast);
            let writer = encoder
                .add_text_chunk(PNG_SPACING_KEY.into(), spacing_m.to_string())
                .and_then(|()| encoder.add_text_chunk(PNG_HEIGHT_SCALE_KEY.into(), HEIGHT_SCALE.to_string()))
                .and_then(|()| encoder.write_header())
                .and_then(|writer| writer.into_stream_writer_with_size(1 << 18));
            Encoding::Png(Box::new(writer.map_err(|error| failed(png_error(error)))?))
        } else {
            file.write_all(&tiff_header::header(size, spacing_m)).map_err(failed)?;
            Encoding::Tiff(file)
        };
        Ok(Self { out: out.to_owned(), temporary, encoder, bytes: Vec::new() })
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
        written.map_err(|source| LayoutError::io(&self.out, CANNOT_WRITE, source))
    }

    /// Flushes everything to disk and gives the file its name.
    pub(super) fn finish(self) -> Result<(), LayoutError> {
        let failed = |source| LayoutError::io(&self.out, CANNOT_WRITE, source);
        match self.encoder {
            Encoding::Tiff(mut file) => file.flush().map_err(failed)?,
            Encoding::Png(writer) => writer.finish().map_err(|error| failed(png_error(error)))?,
        }
        self.temporary.as_file().sync_all().map_err(failed)?;
        self.temporary.persist(&self.out).map(drop).map_err(|error| failed(error.error))
    }
}

fn png_error(error: EncodingError) -> std::io::Error {
    match error {
        EncodingError::IoError(source) => source,
        other => std::io::Error::other(other),
    }
}

/// Temporary files are private by default; this one becomes an ordinary file.
fn builder<'a, 'b>() -> Builder<'a, 'b> {
    #[cfg_attr(not(unix), expect(unused_mut, reason = "permissions are set on Unix only"))]
    let mut builder = Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder
}
