//! A PNG file as the decoder's rows, whatever they hold: heights ([`super::png`]) or colours (`crate::imagery`).

use super::{guard, input};
use crate::error::LayoutError;
use ::png::{Decoder, DecodingError, Limits, Reader, Transformations};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Memory the decoder may take: a few rows, and text chunks.
const DECODER_BYTES: usize = 256 << 20;

/// The decoder of a PNG file.
pub(crate) type PngRows = Reader<BufReader<File>>;

/// Opens the file at `path` and reads its header.
pub(crate) fn open(path: &Path, transformations: Transformations) -> Result<PngRows, LayoutError> {
    let file = input::open(path, "cannot open the PNG file")?;
    let mut decoder =
        Decoder::new_with_limits(BufReader::with_capacity(1 << 18, file), Limits { bytes: DECODER_BYTES });
    decoder.set_transformations(transformations);
    guard(
        path,
        || "header".into(),
        || decoder.read_info().map_err(|error| decoding_error(path, "header".into(), error)),
    )
}

/// What the decoder says of a place in the file.
pub(crate) fn decoding_error(path: &Path, place: String, error: DecodingError) -> LayoutError {
    match error {
        DecodingError::IoError(source) if source.raw_os_error().is_some() => {
            LayoutError::io(path, "cannot read the PNG file", source)
        }
        DecodingError::IoError(_) => {
            LayoutError::damaged(path, place, "the file is cut short; fetch it again")
        }
        DecodingError::LimitsExceeded => LayoutError::unsupported(
            path,
            format!(
                "reading it would take more than {} MiB a row; convert it to a tiled GeoTIFF",
                DECODER_BYTES >> 20
            ),
        ),
        error => LayoutError::damaged(path, place, format!("{error}; fetch or write the file again")),
    }
}
