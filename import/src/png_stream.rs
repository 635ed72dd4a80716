//! A PNG file as the decoder's rows, whatever they hold: heights ([`super::png`]) or colours (`crate::imagery`).

use super::{guard, input};
use ::png::{Decoder, DecodingError, Info, Limits, Reader, Transformations};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// Memory the decoder may take for chunks beside the picture, such as texts, before it is refused.
const CHUNK_BYTES: usize = 4 << 20;
/// Rows the decoder holds, about: some to look back on, one before, one that is worked on, one that is done.
const ROWS: u64 = 8;
/// Longest row that is read.
const MAX_ROW_BYTES: u64 = 64 << 20;

/// The decoder of a PNG file.
pub(crate) type PngRows = Reader<BufReader<File>>;

/// Whether the text chunks of a file are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Texts {
    Kept,
    PassedOver,
}

/// Opens the file at `path` and reads its header.
pub(crate) fn open(
    path: &Path,
    transformations: Transformations,
    texts: Texts,
) -> Result<PngRows, LayoutError> {
    let file = input::open(path, "cannot open the PNG file")?;
    let mut decoder = Decoder::new(BufReader::with_capacity(1 << 18, file));
    decoder.set_transformations(transformations);
    // Profiles are packed and can become any length.
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_ignore_text_chunk(texts == Texts::PassedOver);
    let failed = |error| decoding_error(path, "header".into(), error);
    guard(
        path,
        || "header".into(),
        || {
            let header = decoder.read_header_info().map_err(failed)?;
            let row = row_bytes(header);
            if row > MAX_ROW_BYTES {
                return Err(LayoutError::unsupported(
                    path,
                    format!(
                        "a row of {} texels takes {} MiB, more than the {} MiB allowed; convert it to a tiled GeoTIFF: \
                         gdal_translate -co TILED=YES -co BIGTIFF=IF_SAFER INPUT output.tif",
                        header.width,
                        row >> 20,
                        MAX_ROW_BYTES >> 20
                    ),
                ));
            }
            // At most a row as it is handed out, of 16 bits a channel and all four channels, beside the chunks.
            decoder.set_limits(Limits { bytes: CHUNK_BYTES + row as usize });
            decoder.read_info().map_err(failed)
        },
    )
}

/// Bytes of the longest form that a row of the picture takes in the decoder.
fn row_bytes(header: &Info<'_>) -> u64 {
    u64::from(header.width) * 8
}

/// Memory that reading the picture with this header takes.
pub(crate) fn memory_bytes(header: &Info<'_>) -> u64 {
    ROWS * row_bytes(header) + CHUNK_BYTES as u64
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
                "what it holds beside its picture takes more than {} MiB; write it again without texts and profiles, for example: \
                 gdal_translate -of PNG INPUT output.png",
                CHUNK_BYTES >> 20
            ),
        ),
        _ => LayoutError::damaged(path, place, "its PNG stream is damaged; fetch or write the file again"),
    }
}
