//! Grey PNG, 16 or 8 bits a sample, one row at a time.
//!
//! A PNG is one compressed stream: it is decoded from the first row to the last by one thread, a few
//! rows in memory. The text chunks `Terrasoar:spacing_m` and `Terrasoar:height_scale_m`, which
//! [`crate::synth`] writes, give the spacing and the height of a unit; without them a PNG says nothing
//! about where it lies and a unit is one metre. A sample equal to the transparent grey (`tRNS`) is void.

use std::path::{Path, PathBuf};

use ::png::{BitDepth, ColorType, Transformations};

use super::WINDOW_SAMPLES;
use super::guard::guard;
use super::png_stream::{self, PngRows, Texts, decoding_error};
use crate::reader::{CrsSaid, Declared, HorizontalSize, Reader, Said};
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;

/// Keyword of the text chunk with the distance between samples in metres.
pub(crate) const SPACING_KEY: &str = "Terrasoar:spacing_m";
/// Keyword of the text chunk with the metres of height a unit.
pub(crate) const HEIGHT_SCALE_KEY: &str = "Terrasoar:height_scale_m";

/// A grey PNG.
#[derive(Debug)]
pub(super) struct PngDem {
    path: PathBuf,
    declared: Declared,
}

impl PngDem {
    /// Reads the header and the text chunks before the image data.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
        let reader = png_stream::open(path, Transformations::IDENTITY, Texts::Kept)?;
        let header = reader.info();
        let sample_type = match (header.color_type, header.bit_depth) {
            (ColorType::Grayscale, BitDepth::Sixteen) => SampleType::U16,
            (ColorType::Grayscale, BitDepth::Eight) => SampleType::U8,
            (color, depth) => return Err(refuse_color(path, color, depth)),
        };
        if header.interlaced {
            return Err(LayoutError::unsupported(
                path,
                "the PNG is interlaced, which cannot be read row by row; write it again without interlacing: \
                 gdal_translate -of PNG INPUT output.png",
            ));
        }
        if header.width < 2 || header.height < 2 {
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "{} x {} samples are no terrain; at least 2 x 2 are needed",
                    header.width, header.height
                ),
            ));
        }
        let texts = &header.uncompressed_latin1_text;
        let number = |key: &str| {
            let text = texts.iter().find(|chunk| chunk.keyword == key);
            text.and_then(|chunk| chunk.text.trim().parse::<f64>().ok())
                .filter(|value| value.is_finite() && *value > 0.0)
        };
        let format = if sample_type == SampleType::U16 { "16-bit PNG" } else { "8-bit PNG" };
        let mut declared = Declared::new([header.width, header.height], sample_type, format);
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
        let void = header.trns.as_deref().and_then(|bytes| match *bytes {
            [high, low] if sample_type == SampleType::U16 => Some(u16::from_be_bytes([high, low])),
            [_, low] => Some(low.into()),
            _ => None,
        });
        declared.value.nodata.extend(void.map(|value| Said::new(value.to_string(), "the transparent grey")));
        Ok(Self { path: path.to_owned(), declared })
    }
}

impl Reader for PngDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let mut reader = png_stream::open(&self.path, Transformations::IDENTITY, Texts::PassedOver)?;
        let width = u64::from(self.declared.samples[0]);
        let header = reader.info();
        if [header.width, header.height] != self.declared.samples {
            return Err(LayoutError::damaged(
                &self.path,
                "header",
                "the file changed while it was read; start again",
            ));
        }
        let rows_at_once = (WINDOW_SAMPLES / width).max(1);
        let mut samples: Vec<f64> = Vec::new();
        let mut first_row = 0;
        for row in 0..self.declared.samples[1] {
            self.append_row(&mut reader, row, &mut samples)?;
            let height = row - first_row + 1;
            if u64::from(height) == rows_at_once || row + 1 == self.declared.samples[1] {
                sink.put(
                    Window { col: 0, row: first_row, width: self.declared.samples[0], height },
                    &samples,
                )?;
                samples.clear();
                first_row = row + 1;
            }
        }
        Ok(())
    }
}

impl PngDem {
    fn append_row(&self, reader: &mut PngRows, row: u32, samples: &mut Vec<f64>) -> Result<(), LayoutError> {
        let place = || format!("row {row} of {}", self.declared.samples[1]);
        guard(&self.path, place, || {
            let decoded = reader.next_row().map_err(|error| decoding_error(&self.path, place(), error))?;
            let Some(decoded) = decoded else {
                return Err(LayoutError::damaged(
                    &self.path,
                    place(),
                    "the image data ends early; fetch the file again",
                ));
            };
            match self.declared.sample_type {
                SampleType::U16 => {
                    let pairs = decoded.data().chunks_exact(2);
                    samples.extend(pairs.map(|pair| f64::from(u16::from_be_bytes([pair[0], pair[1]]))));
                }
                _ => samples.extend(decoded.data().iter().map(|&byte| f64::from(byte))),
            }
            Ok(())
        })?;
        let expected = u64::from(self.declared.samples[0]);
        if !(samples.len() as u64).is_multiple_of(expected) {
            return Err(LayoutError::damaged(
                &self.path,
                place(),
                "the row is cut short; fetch the file again",
            ));
        }
        Ok(())
    }
}

fn refuse_color(path: &Path, color: ColorType, depth: BitDepth) -> LayoutError {
    let color = match color {
        ColorType::Grayscale => "grey",
        ColorType::GrayscaleAlpha => "grey and alpha",
        ColorType::Rgb => "RGB",
        ColorType::Rgba => "RGB and alpha",
        ColorType::Indexed => "palette",
    };
    let bits = depth as u8;
    LayoutError::unsupported(
        path,
        format!(
            "this is a {bits}-bit {color} PNG, and heights are read from 16-bit or 8-bit grey ones; if it is a picture \
             of the terrain, look for its elevation data; if heights are in one channel, extract it: \
             gdal_translate -of PNG -b 1 INPUT output.png"
        ),
    )
}
