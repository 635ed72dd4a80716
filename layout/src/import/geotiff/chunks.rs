//! The table of chunks: where the strips or tiles of the image lie, how they are packed, and that all
//! this is something that can be read here.
//!
//! Chunk `i` covers a rectangle of `chunk_width * chunk_height` samples, `across` of them side by side.
//! Tiles at the right and lower edge are stored whole, strips at the lower edge only as far as the image.

use super::tags::{self, Directory, TiffFile};
use crate::dem::{SampleType, Window};
use crate::error::LayoutError;

/// Largest decoded chunk: the codecs need it in memory at once.
const MAX_CHUNK_BYTES: u64 = 512 << 20;

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
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) sample_type: SampleType,
    pub(super) big_endian: bool,
    pub(super) compression: Compression,
    pub(super) predictor: Predictor,
    pub(super) chunk_width: u32,
    pub(super) chunk_height: u32,
    tiled: bool,
    across: u32,
    places: Vec<(u64, u64)>,
}

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
        let photometric = file.number(directory, tags::PHOTOMETRIC)?.unwrap_or(1);
        if bands != 1 || photometric > 1 {
            let what = match photometric {
                3 => "a palette picture".to_owned(),
                2 | 5 | 6 | 8 => "a colour picture".to_owned(),
                _ => format!("an image of {bands} bands"),
            };
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "this is {what}, and heights are one grey band; if one of its bands holds them, extract it: \
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
            (3, SampleType::F32 | SampleType::F64) => Predictor::Floating,
            _ => {
                return Err(file.damaged(format!(
                    "predictor {predictor} is unknown or does not go with its samples; fetch the file again, or write \
                     it again with PREDICTOR=2"
                )));
            }
        };
        let tile_width = file.number(directory, tags::TILE_WIDTH)?;
        let tiled = tile_width.is_some();
        let (chunk_width, chunk_height) = if tiled {
            (
                side(file, directory, tags::TILE_WIDTH, "tile width")?,
                side(file, directory, tags::TILE_LENGTH, "tile height")?,
            )
        } else {
            let rows =
                file.number(directory, tags::ROWS_PER_STRIP)?.unwrap_or(u64::MAX).min(u64::from(height));
            (width, rows as u32)
        };
        if chunk_width == 0 || chunk_height == 0 {
            return Err(file.damaged("a strip or tile without samples is declared; write the file again"));
        }
        let across = width.div_ceil(chunk_width);
        let wanted = u64::from(across) * u64::from(height.div_ceil(chunk_height));
        let (offsets, counts) = if tiled {
            (tags::TILE_OFFSETS, tags::TILE_BYTE_COUNTS)
        } else {
            (tags::STRIP_OFFSETS, tags::STRIP_BYTE_COUNTS)
        };
        let offsets = file.numbers(directory, offsets)?.unwrap_or_default();
        let counts = file.numbers(directory, counts)?.unwrap_or_default();
        if offsets.len() as u64 != wanted || counts.len() as u64 != wanted {
            return Err(file.damaged(format!(
                "{wanted} chunks make up the image, but {} places and {} lengths are listed; fetch the file again",
                offsets.len(),
                counts.len()
            )));
        }
        let this = Self {
            width,
            height,
            sample_type,
            big_endian: file.is_big_endian(),
            compression,
            predictor,
            chunk_width,
            chunk_height,
            tiled,
            across,
            places: offsets.into_iter().zip(counts).collect(),
        };
        this.check_places(file)?;
        Ok(this)
    }

    /// Every chunk lies in the file, and is long enough for what it is to become.
    fn check_places(&self, file: &TiffFile) -> Result<(), LayoutError> {
        if !self.is_raw() && self.decoded_bytes() > MAX_CHUNK_BYTES {
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "its {} would take {} MiB each in memory, more than the {} MiB allowed; write it again in tiles: \
                     gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER INPUT output.tif",
                    self.describe(),
                    self.decoded_bytes() >> 20,
                    MAX_CHUNK_BYTES >> 20
                ),
            ));
        }
        for chunk in 0..self.count() {
            let Some((at, packed)) = self.place(chunk) else { continue };
            let needed = if self.is_raw() { self.stored_bytes(chunk) } else { packed };
            if at.checked_add(needed).is_none_or(|end| end > file.bytes()) {
                return Err(LayoutError::damaged(
                    file.path(),
                    self.name(chunk),
                    format!(
                        "it would end beyond the {} bytes of the file, which is cut short; fetch it again",
                        file.bytes()
                    ),
                ));
            }
            if !self.is_raw()
                && packed.saturating_mul(self.compression.greatest_ratio()) < self.stored_bytes(chunk)
            {
                return Err(LayoutError::damaged(
                    file.path(),
                    self.name(chunk),
                    format!("its {packed} bytes cannot hold the samples declared; fetch the file again"),
                ));
            }
        }
        Ok(())
    }

    /// Number of chunks.
    pub(super) fn count(&self) -> u64 {
        self.places.len() as u64
    }

    /// Offset and packed length of a chunk; `None` if the file left it out.
    pub(super) fn place(&self, chunk: u64) -> Option<(u64, u64)> {
        self.places.get(chunk as usize).copied().filter(|(at, bytes)| *at != 0 && *bytes != 0)
    }

    /// The part of the image a chunk covers.
    pub(super) fn window(&self, chunk: u64) -> Window {
        // Both fit: there are `across` chunks in a row and the image's sides are 32-bit.
        let col = (chunk % u64::from(self.across)) as u32 * self.chunk_width;
        let row = (chunk / u64::from(self.across)) as u32 * self.chunk_height;
        Window {
            col,
            row,
            width: self.chunk_width.min(self.width - col),
            height: self.chunk_height.min(self.height - row),
        }
    }

    /// Whether the chunks can be read piecewise: they are not compressed.
    pub(super) fn is_raw(&self) -> bool {
        self.compression == Compression::None
    }

    /// Bytes of a sample in the file.
    pub(super) fn sample_bytes(&self) -> u64 {
        match self.sample_type {
            SampleType::U8 => 1,
            SampleType::U16 | SampleType::I16 => 2,
            SampleType::U32 | SampleType::I32 | SampleType::F32 => 4,
            SampleType::F64 => 8,
        }
    }

    /// Bytes of a whole chunk when unpacked.
    pub(super) fn decoded_bytes(&self) -> u64 {
        (u64::from(self.chunk_width) * u64::from(self.chunk_height)).saturating_mul(self.sample_bytes())
    }

    /// Bytes that must be unpacked for the samples of a chunk that lie in the image.
    fn stored_bytes(&self, chunk: u64) -> u64 {
        let rows = u64::from(self.window(chunk).height);
        (u64::from(self.chunk_width) * rows).saturating_mul(self.sample_bytes())
    }

    /// Name of a chunk in messages.
    pub(super) fn name(&self, chunk: u64) -> String {
        format!("{} {chunk} of {}", if self.tiled { "tile" } else { "strip" }, self.count())
    }

    /// "tiles of 512 x 512 uint16".
    pub(super) fn describe(&self) -> String {
        let kind = match self.sample_type {
            SampleType::U8 => "uint8",
            SampleType::U16 => "uint16",
            SampleType::I16 => "int16",
            SampleType::U32 => "uint32",
            SampleType::I32 => "int32",
            SampleType::F32 => "float32",
            SampleType::F64 => "float64",
        };
        let shape = if self.tiled { "tiles" } else { "strips" };
        format!("{shape} of {} x {} {kind}", self.chunk_width, self.chunk_height)
    }
}

pub(super) fn side(
    file: &mut TiffFile,
    directory: &Directory,
    tag: u16,
    what: &str,
) -> Result<u32, LayoutError> {
    let value = file.number(directory, tag)?;
    // Sides of 2^31 and more would overflow the sum of a chunk's place and its size.
    let side = value.and_then(|value| u32::try_from(value).ok()).filter(|side| *side <= i32::MAX as u32);
    side.ok_or_else(|| match value {
        Some(value) => {
            file.damaged(format!("a {what} of {value} samples is out of range; fetch the file again"))
        }
        None => file.damaged(format!("the {what} is missing; fetch or write the file again")),
    })
}

fn sample_type(file: &mut TiffFile, directory: &Directory) -> Result<SampleType, LayoutError> {
    let bits = file.number(directory, tags::BITS_PER_SAMPLE)?.unwrap_or(1);
    let format = file.number(directory, tags::SAMPLE_FORMAT)?.unwrap_or(1);
    Ok(match (format, bits) {
        (1, 8) => SampleType::U8,
        (1, 16) => SampleType::U16,
        (2, 16) => SampleType::I16,
        (1, 32) => SampleType::U32,
        (2, 32) => SampleType::I32,
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
                    "{bits}-bit {kind} samples are not read (uint8, int16, uint16, int32, uint32, float32 and float64 are); \
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
