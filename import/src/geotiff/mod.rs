//! GeoTIFF, BigTIFF and cloud-optimised ones, one chunk (strip or tile) at a time.
//!
//! [`tags`] reads the directory and checks every declared size against the file's length, [`chunks`] makes the
//! table of chunks of the one that [`images`] chooses, [`geokeys`] and [`metadata`] say where the grid lies and what a unit is.
//! Chunks are read piecewise, however large: uncompressed ones by [`raw`], compressed ones by
//! [`packed`] with [`rows`], [`codec`], [`lerc`] and [`predictor`]. [`stored`] and [`convert`] turn bytes into samples, [`planes`] joins bands that lie apart.
//! Memory: some rows a worker, whatever the file declares; of LERC a chunk.
//!
//! This is our own code, because no crate does all of it: tiff-reader 0.10 reads every fixture here and holds each chunk as a whole, so that a file of one strip takes
//! the memory of the terrain, and refuses files that state no lengths of chunks; tiff 0.11.3 refuses sound LZW tiles that GDAL writes and inverts "white is zero".
//!
//! Two things are as in GDAL: a chunk without data is void if the file declares a void value, else zero, and zeros of a mask or of alpha hide; heights
//! are not inverted for "white is zero" files. Chunks without data that are void, or that a mask hides, are passed over.

mod bands;
mod body;
mod chunk_grid;
mod chunks;
mod codec;
mod colour;
mod colour_codecs;
mod colour_paint;
mod colour_table;
mod convert;
mod failure;
mod geokeys;
mod images;
mod keys;
mod lerc;
mod listing;
mod metadata;
mod packed;
mod planes;
mod predictor;
mod projection;
mod raw;
mod rows;
mod shapes;
mod span;
mod stored;
mod tags;
mod ycbcr;
mod zstd_frame;
#[cfg(feature = "zstd")]
mod zstd_library;
#[cfg(any(test, not(feature = "zstd")))]
mod zstd_plain;
#[cfg(feature = "zstd")]
use zstd_library as zstd_codec;
#[cfg(not(feature = "zstd"))]
use zstd_plain as zstd_codec;

use std::path::{Path, PathBuf};

use chunks::Chunks;
pub(crate) use codec::unpack_zstd;
pub(crate) use colour::TiffImage;
use convert::{Convert, Pick};
use planes::Planes;
use tags::TiffFile;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

use super::WINDOW_SAMPLES;
use crate::mask;
use crate::options::OpenOptions;
use crate::reader::{Corrects, CrsSaid, Declared, Reader, Said};

/// Longest text of the void value: a number.
const MAX_NODATA_BYTES: u64 = 256;
/// Longest metadata; those of a DEM are a few KiB.
const MAX_METADATA_BYTES: u64 = 4 << 20;

/// A GeoTIFF with a band of heights.
#[derive(Debug)]
pub(super) struct TiffDem {
    path: PathBuf,
    declared: Declared,
    chunks: Chunks,
    planes: Planes,
    convert: Convert,
    mask: Option<TiffMask>,
}

/// An image of which 0 means that another has nothing to say there.
#[derive(Debug)]
pub(crate) struct TiffMask {
    path: PathBuf,
    declared: Declared,
    chunks: Chunks,
    convert: Convert,
}

impl TiffMask {
    /// The first full-resolution image of a file beside the masked one.
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let mut file = TiffFile::open(path)?;
        let directory = file.first_full_image()?;
        Self::of(&mut file, &directory)
    }

    fn of(file: &mut TiffFile, directory: &tags::Directory) -> Result<Self, LayoutError> {
        let chunks = Chunks::read(file, directory)?;
        let samples = [chunks.grid.width, chunks.grid.height];
        let convert = Convert {
            sample_type: chunks.sample_type,
            odd: (!chunks.stored.is_plain()).then_some(chunks.stored),
            big_endian: chunks.big_endian,
            bands: chunks.side_by_side() as usize,
            pick: Pick::Band(0),
            alpha: None,
            absent: 0.0,
            // Of a mask 0 hides.
            left_out: f64::NAN,
        };
        let declared = Declared::new(samples, chunks.sample_type, "mask");
        Ok(Self { path: file.path().to_owned(), declared, chunks, convert })
    }
}

impl Reader for TiffMask {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        self.chunks.memory_bytes(&Planes::one())
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let stream = if self.chunks.is_raw() { raw::stream } else { packed::stream };
        stream(&self.path, &self.chunks, &Planes::one(), &self.convert, sink)
    }
}

/// The map from sample centres and the system that a TIFF inside of the file `path` says.
///
/// # Errors
/// As of a damaged TIFF.
pub(crate) fn place_of(path: &Path, tiff: &[u8]) -> Result<(Option<[f64; 6]>, CrsSaid), LayoutError> {
    let mut file = TiffFile::inside(path, tiff)?;
    let directory = file.first_full_image()?;
    let place = geokeys::read(&mut file, &directory)?;
    Ok((place.map, place.crs))
}

impl TiffDem {
    /// Reads the directory of the first full-resolution image.
    pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let mut file = TiffFile::open(path)?;
        let directory = file.first_full_image()?;
        let chunks = Chunks::read(&mut file, &directory)?;
        let xml = file.text(&directory, tags::GDAL_METADATA, MAX_METADATA_BYTES)?.unwrap_or_default();
        let bands = bands::of(&mut file, &directory, &chunks, &metadata::names(&xml), options)?;
        let samples = [chunks.grid.width, chunks.grid.height];
        let sample_type = bands::sample_type(&bands.pick, chunks.sample_type);
        let format = format!(
            "{}{}, {}, {}",
            if file.is_big() { "BigTIFF" } else { "TIFF" },
            if directory.has_georeference() { " with georeference" } else { "" },
            chunks.describe(),
            chunks.compression.name()
        );
        let mut declared = Declared::new(samples, sample_type, format);
        declared.band_number = bands.described as u32 + 1;
        declared.corrects = Corrects { place: true, system: true, nodata: true, ..Corrects::default() };
        geokeys::read(&mut file, &directory)?.declare(&mut declared);
        metadata::heights(&xml, bands.described, &mut declared.value);
        let nodata = file.text(&directory, tags::GDAL_NODATA, MAX_NODATA_BYTES)?;
        let nodata = nodata.filter(|text| !text.trim().is_empty());
        declared.value.nodata.extend(nodata.map(|text| Said::new(text, "tag GDAL_NODATA")));
        let is_void = !declared.value.nodata.is_empty() || !options.nodata.is_empty();
        let mask = match file.mask_of(samples)? {
            Some(directory) => Some(TiffMask::of(&mut file, &directory)?),
            None => None,
        };
        if !is_void && bands.alpha.is_none() && !mask::beside(path).is_file() {
            let shown = mask.as_ref().map(|mask| mask.chunks.stored_samples);
            let advice = "the others would all be heights of 0, for it declares no void value; if they are voids, say so: \
                          gdal_edit.py -a_nodata -9999 FILE";
            chunks.grid.check_sparse(&file, chunks.stored_samples, shown, advice)?;
        }
        let absent = if is_void { f64::NAN } else { 0.0 };
        let left_out = match &bands.pick {
            // Alpha is left out too, and so is 0.
            _ if bands.alpha.is_some() => f64::NAN,
            Pick::Band(_) => absent,
            Pick::Decode(decode) => decode.height([absent; 3]),
        };
        let planes = if chunks.is_planar { Planes::of(&bands) } else { Planes::one() };
        let (pick, alpha) = if chunks.is_planar { (Pick::Band(0), None) } else { (bands.pick, bands.alpha) };
        let convert = Convert {
            sample_type: chunks.sample_type,
            odd: (!chunks.stored.is_plain()).then_some(chunks.stored),
            big_endian: chunks.big_endian,
            bands: chunks.side_by_side() as usize,
            pick,
            alpha,
            absent,
            left_out,
        };
        Ok(Self { path: path.to_owned(), declared, chunks, planes, convert, mask })
    }
}

impl Reader for TiffDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn mask(&self) -> Option<&dyn Reader> {
        self.mask.as_ref().map(|mask| mask as &dyn Reader)
    }

    fn memory_bytes(&self) -> u64 {
        self.chunks.memory_bytes(&self.planes)
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let stream = if self.chunks.is_raw() { raw::stream } else { packed::stream };
        stream(&self.path, &self.chunks, &self.planes, &self.convert, sink)
    }
}

/// Pushes `window` full of one value, a few rows at a time, unless a mask hides it.
fn put_constant(sink: &dyn SampleSink, window: Window, value: f64) -> Result<(), LayoutError> {
    let rows = rows_at_once(window.width).min(window.height);
    if value.is_nan() || sink.is_void(window) {
        return sink.put_void(window);
    }
    // At most a window's worth, or one row, of which a build has no longer ones than a terrain.
    let samples = vec![value; window.width as usize * rows as usize];
    for part in parts(window, rows) {
        sink.put(part, &samples[..part.width as usize * part.height as usize])?;
    }
    Ok(())
}

/// Cuts `window` into windows of at most `rows` rows.
fn parts(window: Window, rows: u32) -> impl Iterator<Item = Window> {
    let bottom = window.row + window.height;
    (window.row..bottom).step_by(rows.max(1) as usize).map(move |row| Window {
        row,
        height: rows.min(bottom - row),
        ..window
    })
}

/// Rows of `width` samples in one window of a sink, at least 1.
fn rows_at_once(width: u32) -> u32 {
    u32::try_from(WINDOW_SAMPLES / u64::from(width.max(1))).unwrap_or(u32::MAX).max(1)
}
