//! The chunks of an image of heights: how they are packed, what their samples are, and that all this is something that can be
//! read here.

use super::chunk_grid::{ChunkGrid, side};
use super::span::{LARGEST_WHOLE, Span};
use super::tags::{self, Directory, TiffFile};
use super::zstd_frame;
use std::io::Read;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;

/// How chunks are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Lzw,
    Deflate,
    PackBits,
    Zstd,
}

impl Compression {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::None => "uncompressed",
            Self::Lzw => "LZW",
            Self::Deflate => "DEFLATE",
            Self::PackBits => "PackBits",
            Self::Zstd => "ZSTD",
        }
    }

    /// Bytes that one packed byte can become at most, by the codec's own limits.
    fn greatest_ratio(self) -> u64 {
        match self {
            Self::None => 1,
            Self::PackBits => 64,
            // A match of 258 bytes takes at least two bits.
            Self::Deflate => 1032,
            // A code of at least nine bits stands for at most 4096 bytes.
            Self::Lzw => 4096,
            // A block of 128 KiB of one byte takes four bytes.
            Self::Zstd => 32768,
        }
    }
}

/// What was stored instead of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Predictor {
    None,
    Horizontal,
    Floating,
}

/// Where the samples of an image are.
#[derive(Debug)]
pub(super) struct Chunks {
    pub(super) grid: ChunkGrid,
    pub(super) sample_type: SampleType,
    /// Samples of a pixel that lie side by side.
    pub(super) bands: u64,
    pub(super) big_endian: bool,
    pub(super) compression: Compression,
    pub(super) predictor: Predictor,
    /// Largest window that long chunks of ZSTD ask for.
    pub(super) largest_window: u64,
    /// Samples that lie in chunks that the file did not leave out.
    pub(super) stored_samples: u64,
}

/// Bands of an image, at most.
const MAX_BANDS: u64 = 4096;
/// Longest row of a chunk: what is unpacked at once at least.
const MAX_ROW_BYTES: u64 = 64 << 20;

impl Chunks {
    /// Reads and checks the table of the image `directory`.
    pub(super) fn read(file: &mut TiffFile, directory: &Directory) -> Result<Self, LayoutError> {
        let width = side(file, directory, tags::IMAGE_WIDTH, "width")?;
        let height = side(file, directory, tags::IMAGE_LENGTH, "height")?;
        if width < 2 || height < 2 {
            let problem = format!("{width} x {height} samples are no terrain; at least 2 x 2 are needed");
            return Err(LayoutError::unsupported(file.path(), problem));
        }
        let bands = file.number(directory, tags::SAMPLES_PER_PIXEL)?.unwrap_or(1);
        if !(1..=MAX_BANDS).contains(&bands) {
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "an image of {bands} bands is not read, and of up to {MAX_BANDS} is; extract the one with the heights: \
                     gdal_translate -b 1 INPUT output.tif"
                ),
            ));
        }
        if bands > 1 && file.number(directory, tags::PLANAR_CONFIGURATION)? == Some(2) {
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "its {bands} bands lie one after the other, which is not read; extract the one with the heights: \
                     gdal_translate -b 1 INPUT output.tif"
                ),
            ));
        }
        let sample_type = sample_type(file, directory)?;
        let compression = compression_of(file, directory)?;
        let predictor = file.number(directory, tags::PREDICTOR)?.unwrap_or(1);
        let predictor = match (predictor, sample_type) {
            _ if compression == Compression::None => Predictor::None,
            (1, _) => Predictor::None,
            (2, _) => Predictor::Horizontal,
            (3, SampleType::F16 | SampleType::F32 | SampleType::F64) => Predictor::Floating,
            _ => {
                return Err(file.damaged(format!(
                    "predictor {predictor} is unknown or does not go with its samples; fetch the file again, or write \
                     it again with PREDICTOR=2"
                )));
            }
        };
        let grid = ChunkGrid::read(file, directory, [width, height])?;
        let mut this = Self {
            grid,
            sample_type,
            bands,
            big_endian: file.is_big_endian(),
            compression,
            predictor,
            largest_window: 0,
            stored_samples: 0,
        };
        this.grid.set_decoded_bytes(this.decoded_bytes());
        this.check_places(file)?;
        Ok(this)
    }

    /// Every chunk lies in the file, and is long enough for what it is to become.
    fn check_places(&mut self, file: &TiffFile) -> Result<(), LayoutError> {
        if !self.is_raw() && self.stride() > MAX_ROW_BYTES {
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "a row of its {} of {} samples takes {} MiB, more than the {} MiB allowed; write it again in other tiles: \
                     gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER INPUT output.tif",
                    self.grid.kind(),
                    self.grid.chunk_width,
                    self.stride() >> 20,
                    MAX_ROW_BYTES >> 20
                ),
            ));
        }
        // Of long chunks there are few, so a look into each costs little.
        let asks_for_window = self.compression == Compression::Zstd && self.decoded_bytes() > LARGEST_WHOLE;
        let mut largest_window = LARGEST_WHOLE;
        let stored = self.grid.check_places(
            file,
            self.is_raw(),
            |chunk| self.stored_bytes(chunk),
            |chunk, at, packed| {
                if asks_for_window {
                    let mut head = [0; zstd_frame::HEAD_BYTES];
                    let mut span = Span { file: file.file(), at, left: packed };
                    let read = span.read(&mut head);
                    let length = read.map_err(|source| {
                        LayoutError::io(file.path(), "cannot read the TIFF file", source)
                    })?;
                    largest_window = largest_window.max(zstd_frame::window(&head[..length]).unwrap_or(0));
                }
                if self.is_raw()
                    || packed.saturating_mul(self.compression.greatest_ratio()) >= self.stored_bytes(chunk)
                {
                    return Ok(());
                }
                Err(LayoutError::damaged(
                    file.path(),
                    self.grid.name(chunk),
                    format!("its {packed} bytes cannot hold the samples declared; fetch the file again"),
                ))
            },
        )?;
        self.stored_samples = stored.samples;
        // The codec itself goes no further.
        self.largest_window = largest_window.min(128 << 20);
        Ok(())
    }

    /// Whether the chunks can be read piecewise: they are not compressed.
    pub(super) fn is_raw(&self) -> bool {
        self.compression == Compression::None
    }

    /// Bytes of a sample in the file.
    pub(super) fn sample_bytes(&self) -> u64 {
        match self.sample_type {
            SampleType::U8 | SampleType::I8 => 1,
            SampleType::U16 | SampleType::I16 | SampleType::F16 => 2,
            SampleType::U32 | SampleType::I32 | SampleType::F32 => 4,
            SampleType::U64 | SampleType::I64 | SampleType::F64 => 8,
        }
    }

    /// Bytes of the samples that lie side by side for a pixel.
    pub(super) fn pixel_bytes(&self) -> u64 {
        self.bands * self.sample_bytes()
    }

    /// Bytes of a row of a chunk.
    pub(super) fn stride(&self) -> u64 {
        u64::from(self.grid.chunk_width) * self.pixel_bytes()
    }

    /// Bytes of a whole chunk when unpacked.
    pub(super) fn decoded_bytes(&self) -> u64 {
        (u64::from(self.grid.chunk_width) * u64::from(self.grid.chunk_height))
            .saturating_mul(self.pixel_bytes())
    }

    /// Bytes that must be unpacked for the samples of a chunk that lie in the image.
    pub(super) fn stored_bytes(&self, chunk: u64) -> u64 {
        let rows = u64::from(self.grid.window(chunk).height);
        (u64::from(self.grid.chunk_width) * rows).saturating_mul(self.pixel_bytes())
    }

    /// "tiles of 512 x 512 uint16".
    pub(super) fn describe(&self) -> String {
        let kind = match self.sample_type {
            SampleType::U8 => "uint8",
            SampleType::I8 => "int8",
            SampleType::U16 => "uint16",
            SampleType::I16 => "int16",
            SampleType::U32 => "uint32",
            SampleType::I32 => "int32",
            SampleType::U64 => "uint64",
            SampleType::I64 => "int64",
            SampleType::F16 => "float16",
            SampleType::F32 => "float32",
            SampleType::F64 => "float64",
        };
        let ChunkGrid { chunk_width, chunk_height, .. } = self.grid;
        format!("{} of {chunk_width} x {chunk_height} {kind}", self.grid.kind())
    }
}

fn sample_type(file: &mut TiffFile, directory: &Directory) -> Result<SampleType, LayoutError> {
    let bits = file.number(directory, tags::BITS_PER_SAMPLE)?.unwrap_or(1);
    let format = file.number(directory, tags::SAMPLE_FORMAT)?.unwrap_or(1);
    Ok(match (format, bits) {
        (1, 8) => SampleType::U8,
        (2, 8) => SampleType::I8,
        (1, 16) => SampleType::U16,
        (2, 16) => SampleType::I16,
        (1, 32) => SampleType::U32,
        (2, 32) => SampleType::I32,
        (1, 64) => SampleType::U64,
        (2, 64) => SampleType::I64,
        (3, 16) => SampleType::F16,
        (3, 32) => SampleType::F32,
        (3, 64) => SampleType::F64,
        _ => {
            let kind = match format {
                1 => "unsigned",
                2 => "signed",
                3 => "floating-point",
                5 | 6 => "complex",
                _ => "untyped",
            };
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "{bits}-bit {kind} samples are not read (whole numbers of 8, 16, 32 and 64 bits and real ones of 16, 32 and 64 are); \
                     convert them: gdal_translate -ot Float32 INPUT output.tif"
                ),
            ));
        }
    })
}

pub(super) fn compression_of(file: &mut TiffFile, directory: &Directory) -> Result<Compression, LayoutError> {
    let code = file.number(directory, tags::COMPRESSION)?.unwrap_or(1);
    let name = match code {
        1 => return Ok(Compression::None),
        5 => return Ok(Compression::Lzw),
        8 | 32946 => return Ok(Compression::Deflate),
        32773 => return Ok(Compression::PackBits),
        50000 => return Ok(Compression::Zstd),
        2..=4 => "CCITT fax",
        6 | 7 => "JPEG",
        34712 => "JPEG 2000",
        34887 => "LERC",
        34925 => "LZMA",
        50001 => "WebP",
        50002 | 52546 => "JPEG XL",
        _ => "unknown",
    };
    Err(LayoutError::unsupported(
        file.path(),
        format!(
            "its compression is {name} (code {code}), which is not read; convert it: \
             gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -co PREDICTOR=2 -co BIGTIFF=IF_SAFER INPUT output.tif"
        ),
    ))
}
