//! The chunks of a TIFF picture: how they are packed, what their channels mean, and that all this can be read.
//!
//! Uncompressed chunks that are taller than needed are cut into lower ones here, so that one huge strip reads like many. Every size is
//! held against the file before memory is taken for it.

use super::chunk_grid::{ChunkGrid, side};
use super::chunks::{Compression, compression_of};
use super::tags::{self, Directory, TiffFile};
use crate::error::LayoutError;

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
    /// Uncompressed chunks are cut into lower ones in it.
    pub(super) grid: ChunkGrid,
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
    /// Height of the chunks in the file, before they were cut.
    declared_height: u32,
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
        let grid = ChunkGrid::read(file, directory, [width, height])?;
        if grid.count() > u64::from(u32::MAX) {
            return Err(file.damaged("it has more chunks than a picture can have; fetch the file again"));
        }
        let mut table = Self {
            declared_height: grid.chunk_height,
            grid,
            bands,
            sample_bytes,
            big_endian: file.is_big_endian(),
            paint,
            alpha,
            void: void.filter(|v| v.fract() == 0.0 && (0.0..=65535.0).contains(v)).map(|v| v as u16),
            packing,
            differences: predictor == 2 && !is_raw,
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
        let grid = &mut self.grid;
        let one_strip = grid.chunk_height >= grid.height;
        if grid.chunk_height <= CUT_ROWS || !(one_strip || grid.chunk_height.is_multiple_of(CUT_ROWS)) {
            return;
        }
        let row_bytes = u64::from(grid.chunk_width) * self.bands * self.sample_bytes;
        // A file that is too short for its chunks gets no table of more; the check says so.
        if row_bytes.saturating_mul(u64::from(grid.chunk_height)) > file_bytes {
            return;
        }
        let cuts = grid.chunk_height.div_ceil(CUT_ROWS);
        let mut places = Vec::new();
        for chunk_row in grid.places.chunks(grid.across as usize) {
            for cut in 0..u64::from(cuts) {
                let skipped = cut * u64::from(CUT_ROWS) * row_bytes;
                let rest = |&(at, bytes): &(u64, u64)| match bytes {
                    0 => (0, 0),
                    _ => (at.saturating_add(skipped), bytes.saturating_sub(skipped)),
                };
                places.extend(chunk_row.iter().map(rest));
            }
        }
        grid.chunk_height = CUT_ROWS;
        places.truncate(grid.across as usize * grid.height.div_ceil(CUT_ROWS) as usize);
        grid.places = places;
    }

    /// Every chunk lies in the file, and is no larger than it may be.
    fn check(&mut self, file: &TiffFile) -> Result<(), LayoutError> {
        self.grid.check_size(file, self.chunk_bytes())?;
        let is_raw = matches!(self.packing, Packing::Bytes(Compression::None));
        let pixel = self.bands * self.sample_bytes;
        for chunk in 0..self.grid.count() {
            let Some((at, packed)) = self.grid.place(chunk) else { continue };
            let rows = self.grid.window(chunk).height;
            let needed = u64::from(self.grid.chunk_width) * u64::from(rows) * pixel;
            self.grid.check_end(file, chunk, at, if is_raw { needed } else { packed })?;
            if is_raw {
                self.grid.places[chunk as usize].1 = needed;
            } else if packed > 2 * self.chunk_bytes() + (1 << 20) {
                return Err(LayoutError::damaged(
                    file.path(),
                    self.grid.name(chunk),
                    "it is much longer packed than unpacked; fetch the file again",
                ));
            }
        }
        Ok(())
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
