//! Pictures as PNG, one row at a time: grey, RGB, palette, with or without alpha.
//!
//! A PNG is one compressed stream, decoded by one thread from the first row to the last; one of 16 bits twice, for the bits in use are looked for first. An interlaced
//! file, whose rows come in seven passes, is refused.

use crate::guard;
use crate::png_stream;
use crate::png_stream::{PngRows, Texts, decoding_error};
use crate::reader::{NumberRows, Numbers, Orientation, Picture, bits_of, upper_eight};
use crate::shown::PictureOptions;
use ::png::{BitDepth, ColorType, Transformations};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};

/// Whatever the file holds comes as grey, grey and alpha, RGB or RGBA.
const AS_COLOURS: Transformations = Transformations::EXPAND;

/// A PNG picture.
#[derive(Debug)]
pub(super) struct PngImage {
    path: PathBuf,
    info: ImageInfo,
    orientation: Orientation,
    has_bytes: bool,
    is_grey: bool,
    is_palette: bool,
    /// The largest number of a channel in the file.
    most: u16,
    /// Bits in use of 16, once they were looked for or said.
    bits: OnceLock<u32>,
}

impl PngImage {
    /// Reads the header.
    pub(super) fn open(path: &Path, options: &PictureOptions) -> Result<Self, LayoutError> {
        let reader = png_stream::open(path, AS_COLOURS, Texts::PassedOver)?;
        let header = reader.info();
        if header.interlaced {
            return Err(LayoutError::unsupported(
                path,
                "the PNG is interlaced, which cannot be read row by row; write it again without interlacing: \
                 gdal_translate -of PNG INPUT output.png",
            ));
        }
        let color = match header.color_type {
            ColorType::Grayscale | ColorType::GrayscaleAlpha => "grey",
            ColorType::Rgb | ColorType::Rgba => "RGB",
            ColorType::Indexed => "palette",
        };
        let has_alpha =
            header.trns.is_some() || matches!(header.color_type, ColorType::GrayscaleAlpha | ColorType::Rgba);
        let mut notes = Vec::new();
        if header.bit_depth == BitDepth::Sixteen && options.stretch.is_none() {
            notes.push("16 bits a channel are cut to the upper 8 of those in use".into());
        }
        let info = ImageInfo {
            texels: [header.width, header.height],
            georeference: Georeference::default(),
            format: format!(
                "{}-bit {color} PNG{}",
                header.bit_depth as u8,
                if has_alpha { " with alpha" } else { "" }
            ),
            notes,
            memory_bytes: png_stream::memory_bytes(header),
        };
        let orientation = header.exif_metadata.as_deref().map(Orientation::of_exif);
        let orientation = orientation.unwrap_or(Orientation::UPRIGHT);
        let has_bytes = header.bit_depth != BitDepth::Sixteen;
        let (is_grey, is_palette) = (color == "grey", color == "palette");
        let most = ((1u32 << header.bit_depth as u8) - 1) as u16;
        let bits = OnceLock::new();
        Ok(Self { path: path.to_owned(), info, orientation, has_bytes, is_grey, is_palette, most, bits })
    }
}

impl Picture for PngImage {
    fn orientation(&self) -> Orientation {
        self.orientation
    }

    fn has_bytes(&self) -> bool {
        self.has_bytes
    }

    fn byte_of(&self, number: f64) -> Option<u8> {
        let is_one = number.fract() == 0.0 && (0.0..=f64::from(self.most)).contains(&number);
        // Of one, two or four bits: the share of the largest is whole.
        (is_one && self.has_bytes && !self.is_palette).then(|| (number as u16 * (255 / self.most)) as u8)
    }

    fn bits(&self) -> Result<u32, LayoutError> {
        if self.has_bytes {
            return Ok(8);
        }
        if let Some(bits) = self.bits.get() {
            return Ok(*bits);
        }
        let mut rows = self.begin()?;
        let mut peak = 0;
        for _ in 0..self.info.texels[1] {
            rows.next_row(|row, channels| {
                for texel in row.chunks_exact(2 * channels) {
                    let (numbers, _) = texel.as_chunks::<2>();
                    // Two and four channels end with alpha; what nobody sees does not count.
                    let colours = if channels % 2 == 0 { channels - 1 } else { channels };
                    if colours == channels || numbers[colours] != [0; 2] {
                        peak = numbers[..colours].iter().map(|n| u16::from_be_bytes(*n)).fold(peak, u16::max);
                    }
                }
            })?;
        }
        Ok(*self.bits.get_or_init(|| bits_of(peak)))
    }

    fn use_bits(&mut self, bits: u32) {
        self.bits = OnceLock::from(bits);
    }

    fn colours(&self) -> usize {
        if self.is_grey { 1 } else { 3 }
    }

    fn numbers(&self) -> Result<Option<Box<dyn NumberRows + '_>>, LayoutError> {
        Ok(if self.has_bytes { None } else { Some(Box::new(self.begin()?)) })
    }

    fn limits(&self) -> Option<[i32; 2]> {
        Some([0, if self.has_bytes { 255 } else { 65_535 }])
    }
}

impl PngImage {
    /// The first row is next.
    fn begin(&self) -> Result<Rows<'_>, LayoutError> {
        let reader = png_stream::open(&self.path, AS_COLOURS, Texts::PassedOver)?;
        let header = reader.info();
        if [header.width, header.height] != self.info.texels {
            return Err(LayoutError::damaged(
                &self.path,
                "header",
                "the file changed while it was read; start again",
            ));
        }
        Ok(Rows { image: self, reader, y: 0, bits: 8, bytes: Vec::new() })
    }
}

impl ImageSource for PngImage {
    fn path(&self) -> &Path {
        &self.path
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        Ok(Box::new(Rows { bits: self.bits()?, ..self.begin()? }))
    }
}

struct Rows<'i> {
    image: &'i PngImage,
    reader: PngRows,
    y: u32,
    /// Bits in use, of channels of 16.
    bits: u32,
    /// A row of these as bytes.
    bytes: Vec<u8>,
}

impl Rows<'_> {
    /// Gives the next row to `take`, as the file has it, and the channels of a texel.
    fn next_row(&mut self, take: impl FnOnce(&[u8], usize)) -> Result<(), LayoutError> {
        let path = &self.image.path;
        let [wide, high] = self.image.info.texels;
        let y = self.y;
        let place = || format!("row {y} of {high}");
        let (color, depth) = self.reader.output_color_type();
        let channels = color.samples();
        let length = wide as usize * channels * if depth == BitDepth::Sixteen { 2 } else { 1 };
        let reader = &mut self.reader;
        guard(path, place, || {
            let decoded = reader.next_row().map_err(|error| decoding_error(path, place(), error))?;
            let data = decoded.as_ref().map_or(&[][..], |row| row.data());
            if data.len() < length {
                return Err(LayoutError::damaged(
                    path,
                    place(),
                    "the image data ends early; fetch the file again",
                ));
            }
            take(&data[..length], channels);
            Ok(())
        })?;
        self.y += 1;
        Ok(())
    }
}

impl RowReader for Rows<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let (has_bytes, bits) = (self.image.has_bytes, self.bits);
        for row in rgba.chunks_exact_mut(self.image.info.texels[0] as usize * 4) {
            let mut bytes = std::mem::take(&mut self.bytes);
            self.next_row(|data, channels| {
                if has_bytes {
                    spread(data, channels, row);
                    return;
                }
                bytes.clear();
                for (i, number) in data.as_chunks::<2>().0.iter().enumerate() {
                    let is_alpha = channels % 2 == 0 && i % channels == channels - 1;
                    bytes.push(upper_eight(u16::from_be_bytes(*number), if is_alpha { 16 } else { bits }));
                }
                spread(&bytes, channels, row);
            })?;
            self.bytes = bytes;
        }
        Ok(())
    }
}

/// Of 16 bits a channel.
impl NumberRows for Rows<'_> {
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError> {
        for row in texels.chunks_exact_mut(self.image.info.texels[0] as usize) {
            self.next_row(|data, channels| {
                for (to, from) in row.iter_mut().zip(data.chunks_exact(2 * channels)) {
                    let at = |i: usize| f32::from(u16::from_be_bytes([from[2 * i], from[2 * i + 1]]));
                    let alpha = if channels % 2 == 0 { at(channels - 1) / 257.0 } else { 255.0 };
                    let [green, blue] = if channels < 3 { [0, 0] } else { [1, 2] };
                    *to = [at(0), at(green), at(blue), alpha];
                }
            })?;
        }
        Ok(())
    }
}

/// Texels of 1 to 4 channels (grey; grey and alpha; RGB; RGB and alpha) as RGBA.
pub(super) fn spread(texels: &[u8], channels: usize, rgba: &mut [u8]) {
    let (rgba, _) = rgba.as_chunks_mut::<4>();
    for (to, from) in rgba.iter_mut().zip(texels.chunks_exact(channels)) {
        *to = match *from {
            [grey] => [grey, grey, grey, 255],
            [grey, alpha] => [grey, grey, grey, alpha],
            [r, g, b] => [r, g, b, 255],
            [r, g, b, alpha, ..] => [r, g, b, alpha],
            [] => [0; 4],
        };
    }
}
