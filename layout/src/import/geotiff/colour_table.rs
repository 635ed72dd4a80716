//! The table of a TIFF picture's chunks: where they lie, how they are packed, what their channels mean, and that all this can be read.
//!
//! Uncompressed chunks that are taller than needed are cut into lower ones here, so that one huge strip reads like many. Every size is
//! held against the file before memory is taken for it.

use super::chunks::{Compression, compression_of, side};
use super::tags::{self, Directory, TiffFile};
use crate::error::LayoutError;

/// Largest unpacked chunk.
const MAX_CHUNK_BYTES: u64 = 512 << 20;
/// Rows that uncompressed chunks are cut to where that comes out even.
const CUT_ROWS: u32 = 64;

/// What unpacks a chunk.
#[derive(Debug)]
pub(super) enum Packing {
    Bytes(Compression),
    /// Chunks are JPEG streams without the tables they share, which are empty if they share none.
    Jpeg {
        tables: Vec<u8>,
    },
}

/// What the first channels mean.
#[derive(Debug)]
pub(super) enum Paint {
    Grey,
    /// White is zero.
    InverseGrey,
    Rgb,
    /// As RGB, once the JPEG decoder has done its part.
    YCbCr,
    Palette(Vec<[u8; 3]>),
}

/// How a picture is stored.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) bands: u64,
    /// 1, or 2 of which the upper one is taken.
    pub(super) sample_bytes: u64,
    pub(super) big_endian: bool,
    pub(super) paint: Paint,
    /// Channel of alpha.
    alpha: Option<usize>,
    /// Value of all colour channels where there is no picture, in the samples' own type.
    void: Option<u16>,
    pub(super) packing: Packing,
    /// Whether differences to the texel on the left are stored.
    pub(super) differences: bool,
    pub(super) chunk_width: u32,
    pub(super) chunk_height: u32,
    tiled: bool,
    /// Height of the chunks in the file, before they were cut.
    declared_height: u32,
    pub(super) across: u32,
    places: Vec<(u64, u64)>,
    /// What is lost in reading it.
    pub(super) notes: Vec<String>,
}

impl Table {
    pub(super) fn read(file: &mut TiffFile, directory: &Directory) -> Result<Self, LayoutError> {
        let width = side(file, directory, tags::IMAGE_WIDTH, "width")?;
        let height = side(file, directory, tags::IMAGE_LENGTH, "height")?;
        if width == 0 || height == 0 {
            return Err(file.damaged("the image has no texels; fetch the file again"));
        }
        let bands = file.number(directory, tags::SAMPLES_PER_PIXEL)?.unwrap_or(1);
        let code = file.number(directory, tags::COMPRESSION)?.unwrap_or(1);
        let paint = paint(file, directory, bands, code == 7)?;
        let mut notes = Vec::new();
        let sample_bytes = sample_bytes(file, directory, &mut notes)?;
        let colours = if matches!(paint, Paint::Rgb | Paint::YCbCr) { 3 } else { 1 };
        let extra = file.numbers(directory, tags::EXTRA_SAMPLES)?.unwrap_or_default();
        let alpha = extra.iter().position(|kind| matches!(kind, 1 | 2)).map(|at| colours + at);
        let alpha = alpha.filter(|at| (*at as u64) < bands);
        let unused = bands - colours as u64 - u64::from(alpha.is_some());
        if unused > 0 {
            notes
                .push(format!("{unused} of its {bands} bands are neither colour nor alpha and are left out"));
        }
        if file.number(directory, tags::PLANAR_CONFIGURATION)?.unwrap_or(1) != 1 && bands > 1 {
            return Err(unsupported(
                file,
                "its bands are stored one after the other; interleave them: gdal_translate -co INTERLEAVE=PIXEL \
                 -co TILED=YES INPUT output.tif",
            ));
        }
        let packing = if code == 7 {
            if sample_bytes != 1 || alpha.is_some() || bands != colours as u64 {
                return Err(unsupported(
                    file,
                    "its chunks are JPEG with more than three channels or 8 bits; convert it: gdal_translate -co TILED=YES \
                     -co COMPRESS=DEFLATE INPUT output.tif",
                ));
            }
            Packing::Jpeg { tables: file.bytes_of(directory, tags::JPEG_TABLES)?.unwrap_or_default() }
        } else {
            Packing::Bytes(compression_of(file, directory)?)
        };
        let predictor = file.number(directory, tags::PREDICTOR)?.unwrap_or(1);
        let is_raw = matches!(packing, Packing::Bytes(Compression::None));
        if predictor > 2 && !is_raw {
            return Err(file.damaged(format!(
                "predictor {predictor} does not go with its samples; write the file again"
            )));
        }
        let void = file.text(directory, tags::GDAL_NODATA)?.and_then(|text| text.trim().parse::<f64>().ok());
        let tiled = file.number(directory, tags::TILE_WIDTH)?.is_some();
        let (chunk_width, chunk_height) = if tiled {
            (
                side(file, directory, tags::TILE_WIDTH, "tile width")?,
                side(file, directory, tags::TILE_LENGTH, "tile height")?,
            )
        } else {
            let rows = file.number(directory, tags::ROWS_PER_STRIP)?.unwrap_or(u64::MAX);
            (width, rows.min(u64::from(height)) as u32)
        };
        if chunk_width == 0 || chunk_height == 0 {
            return Err(file.damaged("a strip or tile without texels is declared; write the file again"));
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
        if offsets.len() as u64 != wanted || counts.len() as u64 != wanted || wanted > u64::from(u32::MAX) {
            return Err(file.damaged(format!(
                "{wanted} chunks make up the image, but {} places and {} lengths are listed; fetch the file again",
                offsets.len(),
                counts.len()
            )));
        }
        let mut table = Self {
            width,
            height,
            bands,
            sample_bytes,
            big_endian: file.is_big_endian(),
            paint,
            alpha,
            void: void.filter(|v| v.fract() == 0.0 && (0.0..=65535.0).contains(v)).map(|v| v as u16),
            packing,
            differences: predictor == 2 && !is_raw,
            chunk_width,
            chunk_height,
            tiled,
            declared_height: chunk_height,
            across,
            places: offsets.into_iter().zip(counts).collect(),
            notes,
        };
        if is_raw {
            table.cut(file.bytes());
        }
        table.check(file)?;
        Ok(table)
    }

    /// Cuts uncompressed chunks into lower ones.
    fn cut(&mut self, file_bytes: u64) {
        let one_strip = self.chunk_height >= self.height;
        if self.chunk_height <= CUT_ROWS || !(one_strip || self.chunk_height.is_multiple_of(CUT_ROWS)) {
            return;
        }
        let row_bytes = u64::from(self.chunk_width) * self.bands * self.sample_bytes;
        // A file that is too short for its chunks gets no table of more; the check says so.
        if row_bytes.saturating_mul(u64::from(self.chunk_height)) > file_bytes {
            return;
        }
        let cuts = self.chunk_height.div_ceil(CUT_ROWS);
        let mut places = Vec::new();
        for chunk_row in self.places.chunks(self.across as usize) {
            for cut in 0..u64::from(cuts) {
                let skipped = cut * u64::from(CUT_ROWS) * row_bytes;
                let rest = |&(at, bytes): &(u64, u64)| match bytes {
                    0 => (0, 0),
                    _ => (at.saturating_add(skipped), bytes.saturating_sub(skipped)),
                };
                places.extend(chunk_row.iter().map(rest));
            }
        }
        self.chunk_height = CUT_ROWS;
        places.truncate(self.across as usize * self.height.div_ceil(CUT_ROWS) as usize);
        self.places = places;
    }

    /// Every chunk lies in the file, and is no larger than it may be.
    fn check(&mut self, file: &TiffFile) -> Result<(), LayoutError> {
        if self.chunk_bytes() > MAX_CHUNK_BYTES {
            return Err(unsupported(
                file,
                &format!(
                    "its strips or tiles would take {} MiB each in memory; write it again in tiles: gdal_translate \
                     -co TILED=YES -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER INPUT output.tif",
                    self.chunk_bytes() >> 20
                ),
            ));
        }
        let is_raw = matches!(self.packing, Packing::Bytes(Compression::None));
        let pixel = self.bands * self.sample_bytes;
        for chunk in 0..self.count() {
            let Some((at, packed)) = self.place(chunk) else { continue };
            let rows = self.chunk_height.min(self.height - chunk / self.across * self.chunk_height);
            let needed = u64::from(self.chunk_width) * u64::from(rows) * pixel;
            let ends = |bytes: u64| at.checked_add(bytes).is_some_and(|end| end <= file.bytes());
            if !ends(if is_raw { needed } else { packed }) {
                return Err(LayoutError::damaged(
                    file.path(),
                    self.name(chunk),
                    "it would end beyond the end of the file, which is cut short; fetch it again",
                ));
            }
            if is_raw {
                self.places[chunk as usize].1 = needed;
            } else if packed > 2 * self.chunk_bytes() + (1 << 20) {
                return Err(LayoutError::damaged(
                    file.path(),
                    self.name(chunk),
                    "it is much longer packed than unpacked; fetch the file again",
                ));
            }
        }
        Ok(())
    }

    /// Number of chunks.
    pub(super) fn count(&self) -> u32 {
        self.places.len() as u32
    }

    /// Bytes of a whole chunk when unpacked, as RGBA if that is more.
    pub(super) fn chunk_bytes(&self) -> u64 {
        let texels = u64::from(self.chunk_width) * u64::from(self.chunk_height);
        texels.saturating_mul((self.bands.saturating_mul(self.sample_bytes)).max(4))
    }

    /// Offset and packed length of a chunk; `None` if the file left it out.
    pub(super) fn place(&self, chunk: u32) -> Option<(u64, u64)> {
        self.places.get(chunk as usize).copied().filter(|(at, bytes)| *at != 0 && *bytes != 0)
    }

    /// Name of a chunk in messages.
    pub(super) fn name(&self, chunk: u32) -> String {
        format!("{} {chunk} of {}", if self.tiled { "tile" } else { "strip" }, self.count())
    }

    /// ", tiles of 512 x 512 RGB with alpha, DEFLATE".
    pub(super) fn describe(&self) -> String {
        let colour = match self.paint {
            Paint::Grey | Paint::InverseGrey => "grey",
            Paint::Rgb => "RGB",
            Paint::YCbCr => "YCbCr",
            Paint::Palette(_) => "palette",
        };
        let packing = match &self.packing {
            Packing::Bytes(compression) => compression.name(),
            Packing::Jpeg { .. } => "JPEG",
        };
        format!(
            ", {} of {} x {} {}-bit {colour}{}, {packing}",
            if self.tiled { "tiles" } else { "strips" },
            self.chunk_width,
            self.declared_height,
            8 * self.sample_bytes,
            if self.alpha.is_some() { " with alpha" } else { "" },
        )
    }

    /// Turns the samples of a chunk, `channels` a texel, into RGBA.
    pub(super) fn paint_chunk(&self, samples: &[u8], channels: usize, rgba: &mut [u8]) {
        let (rgba, _) = rgba.as_chunks_mut::<4>();
        if channels == 3 && self.sample_bytes == 1 && self.void.is_none() {
            let (samples, _) = samples.as_chunks::<3>();
            for (to, [r, g, b]) in rgba.iter_mut().zip(samples) {
                *to = [*r, *g, *b, 255];
            }
            return;
        }
        let size = self.sample_bytes as usize;
        let upper = if self.big_endian { 0 } else { size - 1 };
        for (to, from) in rgba.iter_mut().zip(samples.chunks_exact(channels * size)) {
            let byte = |channel: usize| from[channel * size + upper];
            *to = match &self.paint {
                Paint::Grey => [byte(0), byte(0), byte(0), 255],
                Paint::InverseGrey => [255 - byte(0), 255 - byte(0), 255 - byte(0), 255],
                Paint::Rgb | Paint::YCbCr => [byte(0), byte(1), byte(2), 255],
                Paint::Palette(colours) => match colours.get(usize::from(byte(0))) {
                    Some([r, g, b]) => [*r, *g, *b, 255],
                    None => [0; 4],
                },
            };
            if let Some(alpha) = self.alpha {
                to[3] = byte(alpha);
            }
            let colours = if matches!(self.paint, Paint::Rgb | Paint::YCbCr) { 3 } else { 1 };
            if let Some(void) = self.void
                && (0..colours).all(|channel| self.sample(from, channel) == void)
            {
                to[3] = 0;
            }
        }
    }

    fn sample(&self, texel: &[u8], channel: usize) -> u16 {
        match (self.sample_bytes, self.big_endian) {
            (1, _) => u16::from(texel[channel]),
            (_, true) => u16::from_be_bytes([texel[2 * channel], texel[2 * channel + 1]]),
            (_, false) => u16::from_le_bytes([texel[2 * channel], texel[2 * channel + 1]]),
        }
    }
}

fn unsupported(file: &TiffFile, problem: &str) -> LayoutError {
    LayoutError::unsupported(file.path(), problem)
}

fn paint(file: &mut TiffFile, directory: &Directory, bands: u64, jpeg: bool) -> Result<Paint, LayoutError> {
    let photometric = file.number(directory, tags::PHOTOMETRIC)?.unwrap_or(if bands < 3 { 1 } else { 2 });
    let what = match (photometric, bands) {
        (_, 0 | 65..) => {
            return Err(file.damaged(format!("{bands} bands are declared; fetch the file again")));
        }
        (0, _) => return Ok(Paint::InverseGrey),
        (1, _) => return Ok(Paint::Grey),
        (2, 3..) => return Ok(Paint::Rgb),
        (6, 3) if jpeg => return Ok(Paint::YCbCr),
        (3, _) => {
            let colours = file.numbers(directory, tags::COLOR_MAP)?.unwrap_or_default();
            let count = colours.len() / 3;
            if count == 0 || count > 65536 {
                return Err(file.damaged("the palette is missing; fetch or write the file again"));
            }
            let colour = |i: usize| [0, 1, 2].map(|channel| (colours[channel * count + i] >> 8) as u8);
            return Ok(Paint::Palette((0..count).map(colour).collect()));
        }
        (5, _) => "in CMYK, the inks of a press".to_owned(),
        (6, _) => "in YCbCr without JPEG".to_owned(),
        (8..=10, _) => "in CIE Lab".to_owned(),
        (other, bands) => format!("of {bands} bands with the photometric code {other}"),
    };
    Err(unsupported(
        file,
        &format!(
            "the image is {what}, and textures are RGB; convert it with its colour profile, for example: \
             magick INPUT -colorspace sRGB output.tif, and give it its georeference again with gdal_edit.py"
        ),
    ))
}

fn sample_bytes(
    file: &mut TiffFile,
    directory: &Directory,
    notes: &mut Vec<String>,
) -> Result<u64, LayoutError> {
    let bits = file.numbers(directory, tags::BITS_PER_SAMPLE)?.unwrap_or_else(|| vec![1]);
    let format = file.number(directory, tags::SAMPLE_FORMAT)?.unwrap_or(1);
    match (format, bits.first()) {
        (1, Some(8)) if bits.iter().all(|b| *b == 8) => Ok(1),
        (1, Some(16)) if bits.iter().all(|b| *b == 16) => {
            notes.push("16 bits a channel are cut to 8".into());
            Ok(2)
        }
        _ => Err(unsupported(
            file,
            &format!(
                "its samples are of {} bits{}, and pictures are read of 8 or 16; convert it: gdal_translate -ot Byte -scale \
                 INPUT output.tif",
                bits.first().copied().unwrap_or(1),
                if format == 1 { "" } else { " and signed or floating" }
            ),
        )),
    }
}
