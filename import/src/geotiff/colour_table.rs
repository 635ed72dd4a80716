//! The chunks of a TIFF picture: how they are packed, which of its bands are read, and that all this can be read.
//!
//! Uncompressed chunks that are taller than needed are cut into lower ones here, so that one huge strip reads like many. Every size is
//! checked against the file's length before memory is taken for it.

use super::chunk_grid::{ChunkGrid, side};
use super::chunks::{Compression, Predictor, compression_of};
use super::colour_paint::{Channels, MAX_BANDS, Paint, Samples};
use super::listing::Places;
use super::metadata;
use super::tags::{self, Directory, TiffFile};
use super::ycbcr::YCbCr;
use crate::jxl;
use crate::shown::{PRESS_NOTE, PictureOptions, chosen_bands};
use std::num::NonZero;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;

/// Rows that uncompressed chunks are cut to where that comes out even.
const CUT_ROWS: u32 = 64;

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
    /// Chunks are files of WebP.
    Webp,
    /// Chunks are streams of JPEG 2000.
    Jpeg2000,
    /// Chunks are streams of JPEG XL.
    JpegXl,
}

impl Packing {
    /// Of the image `directory`.
    fn read(
        file: &mut TiffFile,
        directory: &Directory,
        samples: &Samples,
        (bands, is_planar): (u64, bool),
    ) -> Result<Self, LayoutError> {
        let code = file.number(directory, tags::COMPRESSION)?.unwrap_or(1);
        let has_bytes = samples.sample_type == SampleType::U8 && samples.odd.is_none();
        match code {
            7 if !has_bytes || (!is_planar && !matches!(bands, 1 | 3)) => Err(unsupported(
                file,
                "its chunks are JPEG with more than three channels or 8 bits; convert it: gdal_translate -co TILED=YES \
                 -co COMPRESS=DEFLATE INPUT output.tif",
            )),
            7 => {
                let tables = file.bytes_of(directory, tags::JPEG_TABLES, MAX_TABLE_BYTES)?;
                Ok(Self::Jpeg { tables: tables.unwrap_or_default() })
            }
            50001 if has_bytes && !is_planar && matches!(bands, 3 | 4) => Ok(Self::Webp),
            34712
                if matches!(samples.sample_type, SampleType::U8 | SampleType::U16)
                    && samples.odd.is_none() =>
            {
                Ok(Self::Jpeg2000)
            }
            _ => match compression_of(file, directory)? {
                Compression::Lerc(_) => Err(unsupported(
                    file,
                    "its chunks are LERC, which is read of heights and not of pictures; convert it: gdal_translate -co TILED=YES \
                     -co COMPRESS=DEFLATE INPUT output.tif",
                )),
                Compression::JpegXl => Ok(Self::JpegXl),
                compression => Ok(Self::Bytes(compression)),
            },
        }
    }

    /// Whether chunks are pictures of their own, which are no rows of samples.
    fn is_picture(&self) -> bool {
        !matches!(self, Self::Bytes(_))
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Bytes(compression) => compression.name(),
            Self::Jpeg { .. } => "JPEG",
            Self::Webp => "WebP",
            Self::Jpeg2000 => "JPEG 2000",
            Self::JpegXl => "JPEG XL",
        }
    }
}

/// How a picture is stored.
#[derive(Debug)]
pub(super) struct Table {
    /// Uncompressed chunks are cut into lower ones in it.
    pub(super) grid: ChunkGrid,
    pub(super) bands: u64,
    /// Bands that are read where they lie one after the other in the file; else empty.
    pub(super) planes: Vec<u64>,
    pub(super) samples: Samples,
    /// Whether the bits of each byte stand the other way round (FillOrder 2); never so of JPEG.
    pub(super) is_reversed: bool,
    pub(super) paint: Paint,
    pub(super) channels: Channels,
    /// Whether three channels of JPEG are red, green and blue, not luma and chroma.
    pub(super) is_rgb: bool,
    /// Luma and chroma that no codec makes colours of.
    pub(super) chroma: Option<YCbCr>,
    /// Whether samples of less than a byte are shades of grey.
    is_shades: bool,
    pub(super) packing: Packing,
    pub(super) predictor: Predictor,
    /// Height of the chunks in the file, before they were cut.
    declared_height: u32,
    /// Length of the longest chunk in the file.
    longest: u64,
    /// What is lost in reading it.
    pub(super) notes: Vec<String>,
}

impl Table {
    pub(super) fn read(
        file: &mut TiffFile,
        directory: &Directory,
        options: &PictureOptions,
    ) -> Result<Self, LayoutError> {
        let width = side(file, directory, tags::IMAGE_WIDTH, "width")?;
        let height = side(file, directory, tags::IMAGE_LENGTH, "height")?;
        if width == 0 || height == 0 {
            return Err(file.damaged("the image has no texels; fetch the file again"));
        }
        let bands = file.number(directory, tags::SAMPLES_PER_PIXEL)?.unwrap_or(1);
        let code = file.number(directory, tags::COMPRESSION)?.unwrap_or(1);
        // Luma and chroma that are no stream of a picture are made colours of here.
        let is_plain = matches!(code, 1 | 5 | 8 | 32946 | 32773 | 50000)
            && file.number(directory, tags::PLANAR_CONFIGURATION)?.unwrap_or(1) == 1;
        let named = Paint::read(file, directory, bands, (code == 7, is_plain))?;
        let paint_is_chroma = matches!(named, Paint::YCbCr);
        let mut notes = Vec::new();
        let is_stretched = options.stretch.is_some();
        let extra = file.numbers(directory, tags::EXTRA_SAMPLES, MAX_BANDS)?.unwrap_or_default();
        // A band that a person names, or states the blacks and whites of, is amounts of light.
        let is_asked = is_stretched || !options.bands.is_empty();
        let named = match bands.saturating_sub(extra.len() as u64) {
            1 if !is_asked => named.or_palette(file, directory, &mut notes)?,
            _ => named,
        };
        let samples = Samples::read(file, directory, is_stretched)?;
        if samples.bytes() == 2 && !is_stretched && !matches!(named, Paint::Palette(_)) {
            notes.push("16 bits a channel are cut to the upper 8 of those in use".into());
        }
        let alpha = extra.iter().position(|kind| matches!(kind, 1 | 2)).map(|at| named.channels() + at);
        let alpha = alpha.filter(|at| (*at as u64) < bands);
        let is_multiplied = alpha.is_some_and(|at| extra.get(at - named.channels()) == Some(&1));
        let said = match named {
            // What colour bands are is also told by GDAL, where the photometric code has no word for it.
            Paint::Grey | Paint::Rgb => {
                file.text(directory, tags::GDAL_METADATA, super::MAX_METADATA_BYTES)?
            }
            _ => None,
        };
        let (rgb, named_alpha) = metadata::colours(said.as_deref().unwrap_or_default());
        let [rgb, named_alpha] = [rgb.map(Vec::from), named_alpha.map(|at| vec![at])]
            .map(|named| named.filter(|at| at.iter().all(|band| (*band as u64) < bands)));
        let alpha = named_alpha.map(|at| at[0]).or(alpha);
        let (paint, colours) = match rgb {
            Some(rgb) if options.bands.is_empty() && alpha.is_none_or(|at| !rgb.contains(&at)) => {
                (Paint::Rgb, rgb)
            }
            _ => colours(file, named, bands, alpha, &options.bands, &mut notes)?,
        };
        let is_planar = bands > 1 && file.number(directory, tags::PLANAR_CONFIGURATION)?.unwrap_or(1) != 1;
        // Of bands that lie apart those that are read lie side by side once they were.
        let read = colours.iter().chain(&alpha).map(|band| *band as u64);
        let planes: Vec<u64> = if is_planar { read.collect() } else { Vec::new() };
        let void = file.text(directory, tags::GDAL_NODATA, super::MAX_NODATA_BYTES)?;
        let void = void.and_then(|text| text.trim().parse::<f64>().ok()).filter(|void| !void.is_nan());
        let mut channels = Channels { colours, alpha, is_multiplied, void };
        if is_planar {
            channels.alpha = alpha.map(|_| channels.colours.len());
            channels.colours = (0..channels.colours.len()).collect();
        }
        let is_shades = !is_stretched && !matches!(paint, Paint::Palette(_));
        if samples.bits() < 8 && is_shades {
            channels.void = channels.void.and_then(|void| samples.shown(void)).map(f64::from);
        }
        let packing = Packing::read(file, directory, &samples, (bands, is_planar))?;
        let predictor = file.number(directory, tags::PREDICTOR)?.unwrap_or(1);
        let is_raw = matches!(packing, Packing::Bytes(Compression::None));
        let predictor = match predictor {
            1 => Predictor::None,
            _ if is_raw || packing.is_picture() => Predictor::None,
            2 if samples.odd.is_none() => Predictor::Horizontal,
            3 if !samples.sample_type.is_integer() => Predictor::Floating,
            _ => {
                return Err(file.damaged(format!(
                    "predictor {predictor} does not go with its samples; write the file again"
                )));
            }
        };
        let grid = ChunkGrid::read(file, directory, [width, height], if is_planar { bands } else { 1 })?;
        let chroma = match (&paint_is_chroma, &packing) {
            (true, Packing::Bytes(_)) => Some(YCbCr::read(file, directory, [grid.chunk_height, height])?),
            _ => None,
        };
        if chroma.is_some()
            && (samples.sample_type != SampleType::U8
                || samples.odd.is_some()
                || !matches!(predictor, Predictor::None))
        {
            return Err(unsupported(
                file,
                "its luma and chroma are not of 8 bits, or have a predictor; convert it: gdal_translate -co TILED=YES INPUT output.tif",
            ));
        }
        if grid.count().saturating_mul(bands) > u64::from(u32::MAX) {
            return Err(file.damaged("it has more chunks than a picture can have; fetch the file again"));
        }
        let mut table = Self {
            declared_height: grid.chunk_height,
            longest: 0,
            grid,
            bands,
            planes,
            samples,
            is_reversed: !packing.is_picture() && file.number(directory, tags::FILL_ORDER)? == Some(2),
            paint,
            channels,
            is_rgb: !paint_is_chroma,
            chroma,
            is_shades,
            packing,
            predictor,
            notes,
        };
        table.grid.set_decoded_bytes(table.chunk_bytes());
        table.longest = table.check(file)?;
        if table.is_raw() {
            table.cut();
        }
        Ok(table)
    }

    /// Cuts uncompressed chunks into lower ones.
    fn cut(&mut self) {
        let one_strip = self.grid.chunk_height >= self.grid.height;
        // Bands that lie apart are cut where each makes as many.
        let is_even = match self.planes.is_empty() {
            true => one_strip || self.grid.chunk_height.is_multiple_of(CUT_ROWS),
            false => one_strip && self.grid.chunk_height == self.grid.height,
        };
        if self.grid.chunk_height > CUT_ROWS && is_even {
            self.grid.cut(CUT_ROWS, self.row_bytes());
        }
    }

    /// Samples of a texel that lie side by side in a chunk.
    pub(super) fn side_by_side(&self) -> u64 {
        if self.planes.is_empty() { self.bands } else { 1 }
    }

    /// Samples of a texel once all are read.
    pub(super) fn joined(&self) -> u64 {
        if self.planes.is_empty() { self.bands } else { self.planes.len() as u64 }
    }

    /// Bytes of a row of a chunk in the file.
    pub(super) fn row_bytes(&self) -> u64 {
        let samples = u64::from(self.grid.chunk_width) * self.side_by_side();
        samples.saturating_mul(self.samples.bits()).div_ceil(8)
    }

    /// Whether the chunks are not compressed.
    fn is_raw(&self) -> bool {
        matches!(self.packing, Packing::Bytes(Compression::None)) && self.chroma.is_none()
    }

    /// Bytes that the samples of a chunk take that lie in the image's rows.
    pub(super) fn stored_bytes(&self, chunk: u64) -> u64 {
        self.row_bytes().saturating_mul(u64::from(self.grid.window(chunk).height))
    }

    /// Offset and length of a chunk of a plane; `None` if the file left it out.
    pub(super) fn place(
        &self,
        plane: u64,
        chunk: u64,
        places: &mut Places<'_>,
    ) -> Result<Option<(u64, u64)>, LayoutError> {
        let place = self.grid.place_of(plane, chunk, places)?;
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
        self.grid.check_sparse(file, stored.samples, None, advice)?;
        Ok(stored.longest)
    }

    /// Memory that unpacking one chunk takes, beside its texels.
    pub(super) fn worker_bytes(&self) -> u64 {
        let rows = u64::from(self.grid.chunk_height);
        let samples = self.row_bytes().saturating_mul(rows);
        // As they are worked with, and side by side.
        let texels = u64::from(self.grid.chunk_width) * rows;
        let joined = texels.saturating_mul(self.joined() * self.samples.bytes() as u64);
        let is_moved = self.samples.odd.is_some() || !self.planes.is_empty() || self.chroma.is_some();
        let moved = if is_moved { joined.saturating_mul(2) } else { 0 };
        // Strips are no higher than the image, cut ones lower than the longest.
        let packed = if self.is_raw() { samples.min(self.longest) } else { self.longest };
        let codec = match &self.packing {
            Packing::Jpeg { .. } | Packing::Webp | Packing::Jpeg2000 | Packing::JpegXl => {
                self.picture_bytes().saturating_add(packed)
            }
            Packing::Bytes(Compression::Zstd) => samples.saturating_mul(2),
            Packing::Bytes(_) => 0,
        };
        packed.saturating_add(samples).saturating_add(moved).saturating_add(codec).saturating_add(1 << 18)
    }

    /// Memory that unpacking a chunk that is a picture of its own may take.
    pub(super) fn picture_bytes(&self) -> u64 {
        let padded = [self.grid.chunk_width, self.grid.chunk_height].map(|side| u64::from(side) + 64);
        let texels = padded[0].saturating_mul(padded[1]);
        match &self.packing {
            Packing::Jpeg2000 => texels.saturating_mul(10 * self.side_by_side() + 24).saturating_add(1 << 17),
            Packing::JpegXl => jxl::chunk_bytes(texels, self.side_by_side(), self.longest),
            Packing::Webp => texels.saturating_mul(12).saturating_add(8 << 20),
            _ => texels.saturating_mul(5 * self.side_by_side()),
        }
    }

    /// Bytes of a whole chunk when unpacked, as RGBA if that is more.
    pub(super) fn chunk_bytes(&self) -> u64 {
        let rows = u64::from(self.grid.chunk_height);
        let rgba = u64::from(self.grid.chunk_width) * 4;
        self.row_bytes().max(rgba).saturating_mul(rows)
    }

    /// ", tiles of 512 x 512 RGB with alpha, DEFLATE".
    pub(super) fn describe(&self) -> String {
        let colour = self.paint.name();
        let packing = self.packing.name();
        format!(
            ", {} of {} x {} {}-bit {colour}{}, {packing}",
            self.grid.kind(),
            self.grid.chunk_width,
            self.declared_height,
            self.samples.bits(),
            if self.channels.alpha.is_some() { " with alpha" } else { "" },
        )
    }

    /// Whether its samples are shown as they are, as bytes.
    pub(super) fn has_bytes(&self) -> bool {
        self.samples.sample_type == SampleType::U8
    }

    /// The byte of each colour as which a number of the file is shown; `None` of one that no sample is, and of inks and places in a palette.
    pub(super) fn shown(&self, number: f64) -> Option<u8> {
        let byte = self.samples.shown(number)?;
        match self.paint {
            Paint::Palette(_) | Paint::Cmyk => None,
            Paint::InverseGrey => Some(255 - byte),
            Paint::Grey | Paint::Rgb | Paint::YCbCr => Some(byte),
        }
    }

    /// The samples of a chunk of one plane as they are worked with, where no machine has those of the file.
    pub(super) fn widen(&self, stored: &[u8], bytes: &mut Vec<u8>) {
        bytes.clear();
        let count = self.grid.chunk_width as usize * self.side_by_side() as usize;
        for row in stored.chunks_exact(self.row_bytes() as usize) {
            self.samples.widen(row, count, self.is_shades, bytes);
        }
    }
}

/// What the bands that are read mean, and which they are.
fn colours(
    file: &TiffFile,
    named: Paint,
    bands: u64,
    alpha: Option<usize>,
    wanted: &[NonZero<u32>],
    notes: &mut Vec<String>,
) -> Result<(Paint, Vec<usize>), LayoutError> {
    let chosen = chosen_bands(file.path(), bands, wanted)?;
    if !chosen.is_empty() {
        let paint = match named {
            // One band that is places in a palette is these.
            Paint::Palette(colours) if chosen.len() == 1 && chosen[0] == 0 => Paint::Palette(colours),
            Paint::InverseGrey if chosen.len() == 1 => Paint::InverseGrey,
            Paint::YCbCr if chosen.len() == 3 => Paint::YCbCr,
            _ if chosen.len() == 1 => Paint::Grey,
            _ => Paint::Rgb,
        };
        return Ok((paint, chosen));
    }
    // Programs of maps call the first of three bands grey and say nothing of the others.
    let paint = match named {
        Paint::Grey if bands >= 3 && alpha.is_none_or(|at| at >= 3) => {
            notes.push(format!(
                "the first three of its {bands} bands, which it does not name, are taken as red, green and blue"
            ));
            Paint::Rgb
        }
        named => named,
    };
    if matches!(paint, Paint::Cmyk) {
        notes.push(PRESS_NOTE.into());
    }
    let colours: Vec<usize> = (0..paint.channels()).collect();
    let unused = bands - colours.len() as u64 - u64::from(alpha.is_some());
    if unused > 0 {
        notes.push(format!("{unused} of its {bands} bands are neither colour nor alpha and are left out"));
    }
    Ok((paint, colours))
}

fn unsupported(file: &TiffFile, problem: &str) -> LayoutError {
    LayoutError::unsupported(file.path(), problem)
}
