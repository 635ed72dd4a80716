//! The bytes of a netCDF file, read piece by piece, and our own messages for what its libraries report.
//!
//! `netcdf-reader` asks for stretches of the file. While the file is opened they are metadata: each is at most [`MOST_AT_ONCE`], all together at most [`MOST_METADATA`].
//! So a head that claims gigabytes is an error. Samples are read from a file that was opened anew with limits of their own.

use crate::guard::guard;
use crate::input;
use hdf5_reader::storage::{Storage, StorageBuffer};
use netcdf_reader::{NcFile, NcMetadataMode, NcOpenOptions};
use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::read_at;

/// Longest piece of metadata.
const MOST_AT_ONCE: u64 = 2 << 20;
/// All metadata of a file together, those looked at twice counted twice.
const MOST_METADATA: u64 = 32 << 20;
/// Longest head of one object of HDF5.
const MOST_HEADER: usize = 1 << 20;

/// A file as the library wants it.
struct Bytes {
    file: File,
    length: u64,
    /// Bytes of metadata that may still be read; nothing once samples are read.
    left: Option<AtomicU64>,
}

impl Storage for Bytes {
    fn len(&self) -> u64 {
        self.length
    }

    fn read_range(&self, offset: u64, len: usize) -> hdf5_reader::error::Result<StorageBuffer> {
        use hdf5_reader::error::Error;
        let needed = len as u64;
        if offset.checked_add(needed).is_none_or(|end| end > self.length) {
            let available = self.length.saturating_sub(offset);
            return Err(Error::UnexpectedEof { offset, needed, available });
        }
        if let Some(left) = &self.left {
            let is_within =
                left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(needed));
            if needed > MOST_AT_ONCE || is_within.is_err() {
                return Err(Error::ResourceLimit("metadata".into()));
            }
        }
        let mut bytes = vec![0; len];
        read_at(&self.file, &mut bytes, offset)?;
        Ok(StorageBuffer::from_vec(bytes))
    }
}

/// What a file is opened for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose {
    /// To see what it holds.
    Look,
    /// To read samples, in chunks of at most so many bytes, of which so many bytes are kept.
    Stream { chunk_bytes: u64, kept_bytes: u64 },
}

/// The file at `path` as bytes.
pub(super) fn storage(path: &Path, purpose: Purpose) -> Result<Arc<dyn Storage>, LayoutError> {
    let cannot_read = |source| LayoutError::io(path, "cannot read the netCDF file", source);
    let file = input::open(path, "cannot open the netCDF file")?;
    let length = file.metadata().map_err(cannot_read)?.len();
    let left = matches!(purpose, Purpose::Look).then(|| AtomicU64::new(MOST_METADATA));
    Ok(Arc::new(Bytes { file, length, left }))
}

/// Opens the file at `path`.
pub(super) fn open(path: &Path, purpose: Purpose) -> Result<NcFile, LayoutError> {
    let storage = storage(path, purpose)?;
    let (chunk, kept) = match purpose {
        Purpose::Look => (MOST_AT_ONCE, 0),
        Purpose::Stream { chunk_bytes, kept_bytes } => (chunk_bytes, kept_bytes),
    };
    let options = NcOpenOptions {
        chunk_cache_bytes: usize::try_from(kept).unwrap_or(usize::MAX),
        chunk_cache_slots: 4,
        // What is no netCDF in it, such as references to regions, is no reason to leave the heights.
        metadata_mode: NcMetadataMode::Lossy,
        max_chunk_bytes: usize::try_from(chunk).unwrap_or(usize::MAX).max(1 << 16),
        max_object_header_bytes: MOST_HEADER,
        ..NcOpenOptions::default()
    };
    guarded(path, "header", || NcFile::from_storage_with_options(storage, options))
}

/// Asks the library for something; a panic in it is damage in the file.
pub(super) fn guarded<T>(
    path: &Path,
    place: &str,
    ask: impl FnOnce() -> netcdf_reader::Result<T>,
) -> Result<T, LayoutError> {
    guard(path, || place.to_owned(), || ask().map_err(|error| in_words(path, place, error)))
}

/// The library's error in words.
fn in_words(path: &Path, place: &str, error: netcdf_reader::Error) -> LayoutError {
    use netcdf_reader::Error;
    match error {
        Error::Io(source) => io(path, place, source),
        Error::UnexpectedEof { .. } => cut_short(path, place),
        Error::UnsupportedFeature(_) | Error::UnsupportedVersion(_) => {
            not_read(path, "it uses a part of netCDF")
        }
        Error::Hdf5(error) => hdf5_in_words(path, place, error),
        _ => damaged(path, place),
    }
}

/// The same of an error of HDF5.
pub(super) fn hdf5_in_words(path: &Path, place: &str, error: hdf5_reader::error::Error) -> LayoutError {
    use hdf5_reader::error::Error;
    match error {
        Error::Context { source, .. } => hdf5_in_words(path, place, *source),
        Error::Io(source) => io(path, place, source),
        Error::UnexpectedEof { .. } | Error::OffsetOutOfBounds(_) => cut_short(path, place),
        Error::ResourceLimit(_) => LayoutError::unsupported(
            path,
            format!(
                "its {place} take more memory than a file of elevation data needs; write it again: gdal_translate -co TILED=YES \
                 -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER INPUT output.tif"
            ),
        ),
        Error::UnsupportedFilter(_) => not_read(path, "its samples are packed in a way"),
        Error::UnsupportedEncoding(_)
        | Error::UnsupportedSuperblockVersion(_)
        | Error::UnsupportedObjectHeaderVersion(_)
        | Error::UnsupportedDatatypeClass(_)
        | Error::UnsupportedLayoutClass(_)
        | Error::UnsupportedLayoutVersion(_)
        | Error::UnsupportedChunkIndexType(_) => not_read(path, "it uses a part of HDF5"),
        _ => damaged(path, place),
    }
}

fn io(path: &Path, place: &str, source: std::io::Error) -> LayoutError {
    if source.kind() == ErrorKind::UnexpectedEof {
        return cut_short(path, place);
    }
    LayoutError::io(path, "cannot read the netCDF file", source)
}

fn cut_short(path: &Path, place: &str) -> LayoutError {
    LayoutError::damaged(
        path,
        place,
        "the file ends before what it declares; it is cut short: fetch it again",
    )
}

fn not_read(path: &Path, what: &str) -> LayoutError {
    LayoutError::unsupported(
        path,
        format!(
            "{what} that is not read; convert it: gdal_translate -co TILED=YES -co COMPRESS=DEFLATE INPUT output.tif"
        ),
    )
}

fn damaged(path: &Path, place: &str) -> LayoutError {
    LayoutError::damaged(path, place, "its structure is damaged; fetch or write the file again")
}
