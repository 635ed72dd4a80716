//! The chunks of a TIFF picture: how they are packed, what their channels mean, and that all this can be read.
//!
//! Uncompressed chunks that are taller than needed are cut into lower ones here, so that one huge strip reads like many. Every size is
//! checked against the file's length before memory is taken for it.

use super::chunk_grid::{ChunkGrid, side};
use super::chunks::{Compression, compression_of};
use super::listing::Places;
use super::tags::{self, Directory, TiffFile};
use crate::reader::upper_eight;
use terrasoar_layout::error::LayoutError;

/// Rows that uncompressed chunks are cut to where that comes out even.
const CUT_ROWS: u32 = 64;

/// Bands of a picture, at most.
const MAX_BANDS: u64 = 64;
/// Colours of a palette, at most.
const MAX_COLOURS: u64 = 65_536;
/// Bytes of the tables that JPEG chunks share, at most; they are some hundreds.
const MAX_TABLE_BYTES: u64 = 1 << 16;

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
    /// Uncompressed chunks are cut into lower ones in it.
    pub(super) grid: ChunkGrid,
    pub(super) bands: u64,
    /// 1, or 2 of which the upper one is taken.
    pub(super) sample_bytes: u64,
    pub(super) big_endian: bool,
    /// Whether the bits of each byte stand the other way round (FillOrder 2); never so of JPEG.
    pub(super) is_reversed: bool,
    pub(super) paint: Paint,
    /// Channel of alpha.
    alpha: Option<usize>,
    /// Value of all colour channels where there is no picture, in the samples' own type.
    void: Option<u16>,
    pub(super) packing: Packing,
    /// Whether differences to the texel on the left are stored.
    pub(super) differences: bool,
    /// Height of the chunks in the file, before they were cut.
    declared_height: u32,
    /// Length of the longest chunk in the file.
    longest: u64,
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
        let named = paint(file, directory, bands, code == 7)?;
        let mut notes = Vec::new();
        let sample_bytes = sample_bytes(file, directory, &mut notes)?;
        let colours = if matches!(named, Paint::Rgb | Paint::YCbCr) { 3 } else { 1 };
        let extra = file.numbers(directory, tags::EXTRA_SAMPLES, MAX_BANDS)?.unwrap_or_default();
        let alpha = extra.iter().position(|kind| matches!(kind, 1 | 2)).map(|at| colours + at);
        let alpha = alpha.filter(|at| (*at as u64) < bands);
        // Programs of maps call the first of three bands grey and say nothing of the others.
        let (paint, colours) = match named {
            Paint::Grey if bands >= 3 && alpha.is_none_or(|at| at >= 3) => {
                notes.push(format!(
                    "the first three of its {bands} bands, which it does not name, are taken as red, green and blue"
                ));
                (Paint::Rgb, 3)
            }
            named => (named, colours),
        };
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
            let tables = file.bytes_of(directory, tags::JPEG_TABLES, MAX_TABLE_BYTES)?;
            Packing::Jpeg { tables: tables.unwrap_or_default() }
        } else {
            match compression_of(file, directory)? {
                Compression::Lerc(_) => {
                    return Err(unsupported(
                        file,
                        "its chunks are LERC, which is read of heights and not of pictures; convert it: gdal_translate -co TILED=YES \
                         -co COMPRESS=DEFLATE INPUT output.tif",
                    ));
                }
                compression => Packing::Bytes(compression),
            }
        };
        let predictor = file.number(directory, tags::PREDICTOR)?.unwrap_or(1);
        let is_raw = matches!(packing, Packing::Bytes(Compression::None));
        if predictor > 2 && !is_raw {
            return Err(file.damaged(format!(
                "predictor {predictor} does not go with its samples; write the file again"
            )));
        }
        let void = file.text(directory, tags::GDAL_NODATA, super::MAX_NODATA_BYTES)?;
        let void = void.and_then(|text| text.trim().parse::<f64>().ok());
        let grid = ChunkGrid::read(file, directory, [width, height], 1)?;
        if grid.count() > u64::from(u32::MAX) {
            return Err(file.damaged("it has more chunks than a picture can have; fetch the file again"));
        }
        let mut table = Self {
            declared_height: grid.chunk_height,
            longest: 0,
            grid,
            bands,
            sample_bytes,
            big_endian: file.is_big_endian(),
            is_reversed: code != 7 && file.number(directory, tags::FILL_ORDER)? == Some(2),
            paint,
            alpha,
            void: void.filter(|v| v.fract() == 0.0 && (0.0..=65535.0).contains(v)).map(|v| v as u16),
            packing,
            differences: predictor == 2 && !is_raw,
            notes,
        };
        table.grid.set_decoded_bytes(table.chunk_bytes());
        table.longest = table.check(file)?;
        if is_raw {
            table.cut();
        }
        Ok(table)
    }

    /// Cuts uncompressed chunks into lower ones.
    fn cut(&mut self) {
        let one_strip = self.grid.chunk_height >= self.grid.height;
        let is_even = one_strip || self.grid.chunk_height.is_multiple_of(CUT_ROWS);
        if self.grid.chunk_height > CUT_ROWS && is_even {
            self.grid.cut(CUT_ROWS, u64::from(self.grid.chunk_width) * self.pixel_bytes());
        }
    }

    /// Bytes of a texel's samples.
    fn pixel_bytes(&self) -> u64 {
        self.bands * self.sample_bytes
    }

    /// Whether the chunks are not compressed.
    fn is_raw(&self) -> bool {
        matches!(self.packing, Packing::Bytes(Compression::None))
    }

    /// Bytes that the samples of a chunk take that lie in the image's rows.
    pub(super) fn stored_bytes(&self, chunk: u64) -> u64 {
        let texels = u64::from(self.grid.chunk_width) * u64::from(self.grid.window(chunk).height);
        texels.saturating_mul(self.pixel_bytes())
    }

    /// Offset and length of a chunk; `None` if the file left it out.
    pub(super) fn place(
        &self,
        chunk: u64,
        places: &mut Places<'_>,
    ) -> Result<Option<(u64, u64)>, LayoutError> {
        let place = self.grid.place(chunk, places)?;
        Ok(place.map(|(at, length)| (at, if self.is_raw() { self.stored_bytes(chunk) } else { length })))
    }

    /// Every chunk lies in the file, and is no longer than it may be. Gives the length of the longest.
    fn check(&self, file: &TiffFile) -> Result<u64, LayoutError> {
        let is_raw = self.is_raw();
        let longest_allowed = self.chunk_bytes().saturating_mul(2).saturating_add(1 << 20);
        let stored = self.grid.check_places(
            file,
            is_raw,
            |chunk| self.stored_bytes(chunk),
            |chunk, _, packed| {
                if is_raw || packed <= longest_allowed {
                    return Ok(());
                }
                Err(LayoutError::damaged(
                    file.path(),
                    self.grid.name(chunk),
                    "it is much longer packed than unpacked; fetch the file again",
                ))
            },
        )?;
        let advice = "cut out what is there: gdal_translate -projwin WEST NORTH EAST SOUTH INPUT output.tif";
        self.grid.check_sparse(file, stored.samples, advice)?;
        Ok(stored.longest)
    }

    /// Memory that unpacking one chunk takes, beside its texels.
    pub(super) fn worker_bytes(&self) -> u64 {
        let texels = u64::from(self.grid.chunk_width) * u64::from(self.grid.chunk_height);
        let samples = texels.saturating_mul(self.pixel_bytes());
        // Strips are no higher than the image, cut ones lower than the longest.
        let packed = if self.is_raw() { samples.min(self.longest) } else { self.longest };
        let codec = match &self.packing {
            Packing::Jpeg { .. } => self.jpeg_bytes().saturating_add(packed),
            Packing::Bytes(Compression::Zstd) => samples.saturating_mul(2),
            Packing::Bytes(_) => 0,
        };
        packed.saturating_add(samples).saturating_add(codec).saturating_add(1 << 18)
    }

    /// Memory that unpacking a chunk of JPEG may take.
    pub(super) fn jpeg_bytes(&self) -> u64 {
        let padded = [self.grid.chunk_width, self.grid.chunk_height].map(|side| u64::from(side) + 64);
        padded[0].saturating_mul(padded[1]).saturating_mul(5 * self.bands)
    }

    /// Bytes of a whole chunk when unpacked, as RGBA if that is more.
    pub(super) fn chunk_bytes(&self) -> u64 {
        let texels = u64::from(self.grid.chunk_width) * u64::from(self.grid.chunk_height);
        texels.saturating_mul((self.bands.saturating_mul(self.sample_bytes)).max(4))
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
            self.grid.kind(),
            self.grid.chunk_width,
            self.declared_height,
            8 * self.sample_bytes,
            if self.alpha.is_some() { " with alpha" } else { "" },
        )
    }

    /// The largest number of the colours in a chunk of 16-bit samples, but for those that mean nothing.
    pub(super) fn peak_of(&self, samples: &[u8], channels: usize) -> u16 {
        let colours = self.colours().min(channels);
        let texels = samples.chunks_exact(channels * self.sample_bytes as usize);
        // What nobody sees does not count.
        let seen = texels.filter(|texel| self.alpha.is_none_or(|alpha| self.sample(texel, alpha) > 0));
        let numbers = seen.flat_map(|texel| (0..colours).map(|channel| self.sample(texel, channel)));
        numbers.filter(|number| Some(*number) != self.void).max().unwrap_or(0)
    }

    /// Channels of colour.
    fn colours(&self) -> usize {
        if matches!(self.paint, Paint::Rgb | Paint::YCbCr) { 3 } else { 1 }
    }

    /// Turns the samples of a chunk, `channels` a texel, into RGBA. Those of 16 bits make use of `bits` of them.
    pub(super) fn paint_chunk(&self, samples: &[u8], channels: usize, bits: u32, rgba: &mut [u8]) {
        let (rgba, _) = rgba.as_chunks_mut::<4>();
        if channels == 3 && self.sample_bytes == 1 && self.void.is_none() {
            let (samples, _) = samples.as_chunks::<3>();
            for (to, [r, g, b]) in rgba.iter_mut().zip(samples) {
                *to = [*r, *g, *b, 255];
            }
            return;
        }
        let size = self.sample_bytes as usize;
        for (to, from) in rgba.iter_mut().zip(samples.chunks_exact(channels * size)) {
            // Beyond the bits in use lies what is hidden anyway.
            let shown = |channel: usize, bits: u32| match size {
                1 => from[channel],
                _ => upper_eight(self.sample(from, channel), bits),
            };
            let byte = |channel: usize| shown(channel, bits);
            *to = match &self.paint {
                Paint::Grey => [byte(0), byte(0), byte(0), 255],
                Paint::InverseGrey => [255 - byte(0), 255 - byte(0), 255 - byte(0), 255],
                Paint::Rgb | Paint::YCbCr => [byte(0), byte(1), byte(2), 255],
                Paint::Palette(colours) => match colours.get(usize::from(self.sample(from, 0))) {
                    Some([r, g, b]) => [*r, *g, *b, 255],
                    None => [0; 4],
                },
            };
            if let Some(alpha) = self.alpha {
                to[3] = shown(alpha, 16);
            }
            if let Some(void) = self.void
                && (0..self.colours()).all(|channel| self.sample(from, channel) == void)
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
        (_, bands) if !(1..=MAX_BANDS).contains(&bands) => {
            return Err(file.damaged(format!("{bands} bands are declared; fetch the file again")));
        }
        (0, _) => return Ok(Paint::InverseGrey),
        (1, _) => return Ok(Paint::Grey),
        (2, 3..) => return Ok(Paint::Rgb),
        (6, 3) if jpeg => return Ok(Paint::YCbCr),
        (3, _) => {
            let listed = file.count(directory, tags::COLOR_MAP);
            if !(3..=3 * MAX_COLOURS).contains(&listed) {
                return Err(file.damaged(format!(
                    "{listed} numbers make no palette of up to {MAX_COLOURS} colours; fetch or write the file again"
                )));
            }
            let colours = file.numbers(directory, tags::COLOR_MAP, listed)?.unwrap_or_default();
            let count = colours.len() / 3;
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
    let bits = file.numbers(directory, tags::BITS_PER_SAMPLE, MAX_BANDS)?.unwrap_or_else(|| vec![1]);
    let format = file.number(directory, tags::SAMPLE_FORMAT)?.unwrap_or(1);
    match (format, bits.first()) {
        (1, Some(8)) if bits.iter().all(|b| *b == 8) => Ok(1),
        (1, Some(16)) if bits.iter().all(|b| *b == 16) => {
            notes.push("16 bits a channel are cut to the upper 8 of those in use".into());
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
