//! Pictures as PNG, one row at a time: grey, RGB, palette, with or without alpha.
//!
//! A PNG is one compressed stream, decoded by one thread from the first row to the last. Sixteen bits a channel are cut to eight; an interlaced
//! file, whose rows come in seven passes, is refused.

use crate::guard;
use crate::png_stream;
use crate::png_stream::{PngRows, Texts, decoding_error};
use crate::reader::{Orientation, Picture};
use ::png::{BitDepth, ColorType, Transformations};
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};

/// Whatever the file holds comes as grey, grey and alpha, RGB or RGBA of 8 bits.
const AS_COLOURS: Transformations = Transformations::EXPAND.union(Transformations::STRIP_16);

/// A PNG picture.
#[derive(Debug)]
pub(super) struct PngImage {
    path: PathBuf,
    info: ImageInfo,
    orientation: Orientation,
    has_bytes: bool,
}

impl PngImage {
    /// Reads the header.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
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
        if header.bit_depth == BitDepth::Sixteen {
            notes.push("16 bits a channel are cut to 8".into());
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
        Ok(Self { path: path.to_owned(), info, orientation, has_bytes })
    }
}

impl Picture for PngImage {
    fn orientation(&self) -> Orientation {
        self.orientation
    }

    fn has_bytes(&self) -> bool {
        self.has_bytes
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
        let reader = png_stream::open(&self.path, AS_COLOURS, Texts::PassedOver)?;
        let header = reader.info();
        if [header.width, header.height] != self.info.texels {
            return Err(LayoutError::damaged(
                &self.path,
                "header",
                "the file changed while it was read; start again",
            ));
        }
        Ok(Box::new(Rows { image: self, reader, y: 0 }))
    }
}

struct Rows<'i> {
    image: &'i PngImage,
    reader: PngRows,
    y: u32,
}

impl RowReader for Rows<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let path = &self.image.path;
        let [wide, high] = self.image.info.texels;
        for row in rgba.chunks_exact_mut(wide as usize * 4) {
            let y = self.y;
            let place = || format!("row {y} of {high}");
            let (color, _) = self.reader.output_color_type();
            let channels = color.samples();
            let reader = &mut self.reader;
            guard(path, place, || {
                let decoded = reader.next_row().map_err(|error| decoding_error(path, place(), error))?;
                let data = decoded.as_ref().map_or(&[][..], |row| row.data());
                if data.len() < wide as usize * channels {
                    return Err(LayoutError::damaged(
                        path,
                        place(),
                        "the image data ends early; fetch the file again",
                    ));
                }
                spread(data, channels, row);
                Ok(())
            })?;
            self.y += 1;
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
