//! The chunks of an image of heights: how they are packed, what their samples are, and that all this is something that can be
//! read here.

use super::chunk_grid::{ChunkGrid, side};
use super::span::{LARGEST_WHOLE, Span};
use super::stored::{MAX_BANDS, Stored};
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
    Lerc(Lerc),
    JpegXl,
}

/// How a blob of LERC is packed once more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lerc {
    Plain,
    Deflate,
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
            Self::Lerc(Lerc::Plain) => "LERC",
            Self::Lerc(Lerc::Deflate) => "LERC and DEFLATE",
            Self::Lerc(Lerc::Zstd) => "LERC and ZSTD",
            Self::JpegXl => "JPEG XL",
        }
    }

    /// Whether a chunk is unpacked as a whole.
    fn is_whole(self) -> bool {
        matches!(self, Self::Lerc(_) | Self::JpegXl)
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
            // One value takes a head, however many samples have it.
            Self::Lerc(_) | Self::JpegXl => u64::MAX,
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
    pub(super) stored: Stored,
    /// Samples of a pixel.
    pub(super) bands: u64,
    /// Whether the bands lie one after the other, not side by side.
    pub(super) is_planar: bool,
    pub(super) big_endian: bool,
    /// Whether the bits of each byte stand the other way round (FillOrder 2).
    pub(super) is_reversed: bool,
    pub(super) compression: Compression,
    pub(super) predictor: Predictor,
    /// Largest window that long chunks of ZSTD ask for.
    pub(super) largest_window: u64,
    /// Samples that lie in chunks that the file did not leave out.
    pub(super) stored_samples: u64,
}

/// Longest chunk that is unpacked as a whole.
const MOST_WHOLE_BYTES: u64 = 64 << 20;
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
        let is_planar = bands > 1 && file.number(directory, tags::PLANAR_CONFIGURATION)? == Some(2);
        let stored = Stored::read(file, directory)?;
        let compression = compression_of(file, directory)?;
        let is_packed_so = matches!(stored.sample_type(), SampleType::U8 | SampleType::U16 | SampleType::F32);
        if compression == Compression::JpegXl && !(stored.is_plain() && is_packed_so) {
            return Err(file.damaged(format!(
                "its samples are {}, which JPEG XL does not have; fetch or write the file again",
                stored.name()
            )));
        }
        let predictor = file.number(directory, tags::PREDICTOR)?.unwrap_or(1);
        let predictor = match predictor {
            _ if compression == Compression::None || compression.is_whole() => Predictor::None,
            1 => Predictor::None,
            2 if stored.is_plain() => Predictor::Horizontal,
            3 if stored.is_real() => Predictor::Floating,
            _ => {
                return Err(file.damaged(format!(
                    "predictor {predictor} is unknown or does not go with its samples; fetch the file again, or write \
                     it again with PREDICTOR=2"
                )));
            }
        };
        let planes = if is_planar { bands } else { 1 };
        let grid = ChunkGrid::read(file, directory, [width, height], planes)?;
        let mut this = Self {
            grid,
            sample_type: stored.sample_type(),
            stored,
            bands,
            is_planar,
            big_endian: file.is_big_endian(),
            is_reversed: file.number(directory, tags::FILL_ORDER)? == Some(2),
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
        // Of a raw row only what lies in the image is read, and one band of that is what any format has.
        let row_bytes = if self.is_raw() { self.row_bytes(self.grid.width) } else { self.stride() };
        if (!self.is_raw() || self.side_by_side() > 1) && row_bytes > MAX_ROW_BYTES {
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "a row of its {} of {} samples takes {} MiB, more than the {} MiB allowed; write it again in other tiles: \
                     gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER INPUT output.tif",
                    self.grid.kind(),
                    self.grid.chunk_width,
                    row_bytes >> 20,
                    MAX_ROW_BYTES >> 20
                ),
            ));
        }
        if self.compression.is_whole() && self.decoded_bytes() > MOST_WHOLE_BYTES {
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "its {} of {} unpack to {} MiB each, more than the {} MiB allowed; write it again in tiles: \
                     gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER INPUT output.tif",
                    self.grid.kind(),
                    self.compression.name(),
                    self.decoded_bytes() >> 20,
                    MOST_WHOLE_BYTES >> 20
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
                    let is_reversed = self.is_reversed;
                    let mut span = Span { file: file.file(), at, left: packed, is_reversed };
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

    /// Samples of a pixel that lie side by side.
    pub(super) fn side_by_side(&self) -> u64 {
        if self.is_planar { 1 } else { self.bands }
    }

    /// Bytes of the first `width` pixels of a row.
    pub(super) fn row_bytes(&self, width: u32) -> u64 {
        // At most 2^31 pixels of 4096 samples of 64 bits.
        (u64::from(width) * self.side_by_side() * self.stored.bits()).div_ceil(8)
    }

    /// Bytes of a row of a chunk.
    pub(super) fn stride(&self) -> u64 {
        self.row_bytes(self.grid.chunk_width)
    }

    /// Bytes of a whole chunk when unpacked.
    pub(super) fn decoded_bytes(&self) -> u64 {
        self.stride().saturating_mul(u64::from(self.grid.chunk_height))
    }

    /// Bytes that must be unpacked for the samples of a chunk that lie in the image.
    pub(super) fn stored_bytes(&self, chunk: u64) -> u64 {
        self.stride().saturating_mul(u64::from(self.grid.window(chunk).height))
    }

    /// "tiles of 512 x 512 uint16".
    pub(super) fn describe(&self) -> String {
        let ChunkGrid { chunk_width, chunk_height, .. } = self.grid;
        format!("{} of {chunk_width} x {chunk_height} {}", self.grid.kind(), self.stored.name())
    }
}

pub(super) fn compression_of(file: &mut TiffFile, directory: &Directory) -> Result<Compression, LayoutError> {
    let code = file.number(directory, tags::COMPRESSION)?.unwrap_or(1);
    let name = match code {
        1 => return Ok(Compression::None),
        5 => return Ok(Compression::Lzw),
        8 | 32946 => return Ok(Compression::Deflate),
        32773 => return Ok(Compression::PackBits),
        50000 => return Ok(Compression::Zstd),
        50002 | 52546 => return Ok(Compression::JpegXl),
        34887 => {
            // Version of LERC, and how its blobs are packed.
            let parameters = file.numbers(directory, tags::LERC_PARAMETERS, 2)?.unwrap_or_default();
            match parameters.get(1) {
                None | Some(0) => return Ok(Compression::Lerc(Lerc::Plain)),
                Some(1) => return Ok(Compression::Lerc(Lerc::Deflate)),
                Some(2) => return Ok(Compression::Lerc(Lerc::Zstd)),
                Some(_) => "LERC packed in an unknown way",
            }
        }
        2..=4 => "CCITT fax",
        6 | 7 => "JPEG",
        34712 => "JPEG 2000",
        32809 => "ThunderScan",
        34661 => "JBIG",
        34676 | 34677 => "SGI LogLuv",
        34892 => "lossy JPEG",
        34925 => "LZMA",
        50001 => "WebP",
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
