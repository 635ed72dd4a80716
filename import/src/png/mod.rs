//! PNG as heights: grey of 16 or 8 bits, or colours that heights are packed into.
//!
//! A PNG is one compressed stream: it is decoded from the first row to the last by one thread, a few rows in memory; an interlaced one strip by strip ([`interlaced`]). The
//! text chunks `Terrasoar:spacing_m` and `Terrasoar:height_scale_m`, which [`crate::synth`] writes, give the spacing and the height of a unit; without them a PNG says
//! nothing about where it lies and a unit is one metre. A sample equal to the transparent grey (`tRNS`) is void, and so is a transparent pixel.

mod interlaced;
mod packing;
mod pixels;

use std::path::{Path, PathBuf};

use ::png::{BitDepth, ColorType, Info, Transformations};

use super::WINDOW_SAMPLES;
use super::guard::guard;
use super::png_stream::{self, PngRows, Texts, decoding_error};
use crate::OpenOptions;
use crate::reader::{CrsSaid, Declared, HorizontalSize, Reader, Said};
use crate::value::decode;
pub(crate) use packing::{Evidence, Packing};
use pixels::Pixels;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Keyword of the text chunk with the distance between samples in metres.
pub(crate) const SPACING_KEY: &str = "Terrasoar:spacing_m";
/// Keyword of the text chunk with the metres of height a unit.
pub(crate) const HEIGHT_SCALE_KEY: &str = "Terrasoar:height_scale_m";

/// A PNG of heights.
#[derive(Debug)]
pub(super) struct PngDem {
    path: PathBuf,
    declared: Declared,
    pixels: Pixels,
    is_interlaced: bool,
}

/// How the decoder hands out pixels: grey as it is stored, everything else as RGB or RGBA.
fn transformations(header: &Info<'_>) -> Transformations {
    match header.color_type {
        ColorType::Grayscale | ColorType::GrayscaleAlpha => Transformations::IDENTITY,
        ColorType::Rgb | ColorType::Rgba | ColorType::Indexed => Transformations::EXPAND,
    }
}

impl PngDem {
    /// Reads the header and the text chunks before the image data; and of a colour picture its beginning, if nothing says how heights are packed.
    pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let reader = png_stream::open(path, Transformations::IDENTITY, Texts::Kept)?;
        let header = reader.info();
        if header.width < 2 || header.height < 2 {
            let sides = format!(
                "{} x {} samples are no terrain; at least 2 x 2 are needed",
                header.width, header.height
            );
            return Err(LayoutError::unsupported(path, sides));
        }
        let packing = options.decode.as_deref().map(decode).transpose()?;
        let (pixels, format) = match (header.color_type, header.bit_depth) {
            (ColorType::Grayscale | ColorType::GrayscaleAlpha, _) if packing.is_some() => {
                let problem = format!(
                    "{}: this PNG is grey, and heights are packed into colours; leave the packing out",
                    path.display()
                );
                return Err(LayoutError::Usage(problem).mended_by(Remedy::Decode));
            }
            (ColorType::Grayscale, BitDepth::Sixteen) => (Pixels::Grey16, "16-bit PNG"),
            (ColorType::Grayscale, BitDepth::Eight) => (Pixels::Grey8, "8-bit PNG"),
            (ColorType::GrayscaleAlpha, BitDepth::Sixteen) => {
                (Pixels::GreyAlpha16, "16-bit PNG with transparency")
            }
            (ColorType::GrayscaleAlpha, BitDepth::Eight) => {
                (Pixels::GreyAlpha8, "8-bit PNG with transparency")
            }
            (ColorType::Rgb | ColorType::Rgba, BitDepth::Eight) | (ColorType::Indexed, _) => {
                let has_alpha = header.color_type == ColorType::Rgba || header.trns.is_some();
                let told = match packing {
                    Some(packing) => Some((packing, None)),
                    None => packing::found(path)?.map(|name| (name.decode(), Some(name))),
                };
                let Some((packing, found)) = told else { return Err(refuse_colour(path, header)) };
                (Pixels::Packed { packing, found, has_alpha }, "PNG of heights packed into colours")
            }
            _ => return Err(refuse_colour(path, header)),
        };
        let mut declared = Declared::new([header.width, header.height], pixels.sample_type(), format);
        declare_texts(&mut declared, header);
        let void = header.trns.as_deref().and_then(|bytes| match (pixels, bytes) {
            (Pixels::Grey16, [high, low]) => Some(u16::from_be_bytes([*high, *low])),
            // The decoder keeps the low byte alone.
            (Pixels::Grey8, [low] | [_, low]) => Some((*low).into()),
            _ => None,
        });
        declared.value.nodata.extend(void.map(|value| Said::new(value.to_string(), "the transparent grey")));
        if let Pixels::Packed { found: Some(name), .. } = pixels {
            declared.notes.push(format!(
                "heights are packed into its colours as {} does, told by the colours themselves",
                name.name()
            ));
        }
        Ok(Self { path: path.to_owned(), declared, pixels, is_interlaced: header.interlaced })
    }

    /// Begins to decode the pixels.
    fn rows(&self) -> Result<PngRows, LayoutError> {
        let reader = open_pixels(&self.path)?;
        let header = reader.info();
        if [header.width, header.height] != self.declared.samples || header.interlaced != self.is_interlaced {
            return Err(LayoutError::damaged(
                &self.path,
                "header",
                "the file changed while it was read; start again",
            ));
        }
        Ok(reader)
    }

    /// The bytes of the next row that the decoder has, which must be `width` pixels of row `row`.
    fn next_row<'r>(&self, reader: &'r mut PngRows, row: u32, width: u32) -> Result<&'r [u8], LayoutError> {
        let place = || format!("row {row} of {}", self.declared.samples[1]);
        let damaged = |problem: &str| LayoutError::damaged(&self.path, place(), problem);
        guard(&self.path, place, || {
            let decoded = reader.next_row().map_err(|error| decoding_error(&self.path, place(), error))?;
            let decoded =
                decoded.ok_or_else(|| damaged("the image data ends early; fetch the file again"))?;
            let decoded = decoded.data();
            if decoded.len() != width as usize * self.pixels.bytes() {
                return Err(damaged("the row is cut short; fetch the file again"));
            }
            Ok(decoded)
        })
    }
}

/// Opens the file at `path` for its pixels.
fn open_pixels(path: &Path) -> Result<PngRows, LayoutError> {
    let kind = transformations(png_stream::open(path, Transformations::IDENTITY, Texts::PassedOver)?.info());
    png_stream::open(path, kind, Texts::PassedOver)
}

fn declare_texts(declared: &mut Declared, header: &Info<'_>) {
    let texts = &header.uncompressed_latin1_text;
    let number = |key: &str| {
        let text = texts.iter().find(|chunk| chunk.keyword == key);
        text.and_then(|chunk| chunk.text.trim().parse::<f64>().ok())
            .filter(|value| value.is_finite() && *value > 0.0)
    };
    if let Some(spacing_m) = number(SPACING_KEY) {
        let north = f64::from(header.height - 1) * spacing_m;
        let by = format!("the text {SPACING_KEY}");
        declared.place = Some(Said::new([0.0, spacing_m, 0.0, north, 0.0, -spacing_m], by.clone()));
        declared.crs = CrsSaid {
            name: "local metres".into(),
            unit: Some(Said::new(HorizontalSize::Metres(1.0), by)),
            is_local: true,
            ..CrsSaid::default()
        };
    }
    let scale = number(HEIGHT_SCALE_KEY);
    declared.value.scale = scale.map(|scale| Said::new(scale, format!("the text {HEIGHT_SCALE_KEY}")));
}

impl Reader for PngDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        if self.is_interlaced { interlaced::memory_bytes(self.declared.samples, self.pixels) } else { 0 }
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        if self.is_interlaced {
            return interlaced::stream(self, sink);
        }
        let [width, high] = self.declared.samples;
        let mut reader = self.rows()?;
        let rows_at_once = (WINDOW_SAMPLES / u64::from(width)).max(1);
        let mut samples: Vec<f64> = Vec::new();
        let mut first_row = 0;
        for row in 0..high {
            let decoded = self.next_row(&mut reader, row, width)?;
            self.pixels.append(&self.path, row, decoded, &mut samples)?;
            let height = row - first_row + 1;
            if u64::from(height) == rows_at_once || row + 1 == high {
                sink.put(Window { col: 0, row: first_row, width, height }, &samples)?;
                samples.clear();
                first_row = row + 1;
            }
        }
        Ok(())
    }
}

fn refuse_colour(path: &Path, header: &Info<'_>) -> LayoutError {
    let color = match header.color_type {
        ColorType::Grayscale => "grey",
        ColorType::GrayscaleAlpha => "grey and alpha",
        ColorType::Rgb => "RGB",
        ColorType::Rgba => "RGB and alpha",
        ColorType::Indexed => "palette",
    };
    let bits = header.bit_depth as u8;
    LayoutError::unsupported(
        path,
        format!(
            "this is a {bits}-bit {color} PNG, and heights are read from 16-bit or 8-bit grey ones and from 8-bit colours that they are packed into; if heights are packed, \
             state how (mapbox, terrarium or factors); if it is a picture of the terrain, look for its elevation data; if heights are in one channel, extract it: \
             gdal_translate -of PNG -b 1 INPUT output.png"
        ),
    )
    .mended_by(Remedy::Decode)
}
