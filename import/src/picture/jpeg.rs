//! Pictures as JPEG, baseline and progressive, decoded by jpeg-decoder.
//!
//! No Rust decoder gives a JPEG row by row, so its texels are held as a whole while it is read, and more while it is decoded ([`JpegFrame::memory_bytes`]): 4.5 bytes a
//! texel of the usual kind, 7.5 of a progressive one. That counts against the memory budget; larger pictures go through a tiled GeoTIFF.

use super::webp::Whole;
use crate::jpeg_frame::JpegFrame;
use crate::reader::{Orientation, Picture};
use crate::shown::PRESS_NOTE;
use crate::{guard, input};
use jpeg_decoder::{CodingProcess, Decoder, Error, PixelFormat, UnsupportedFeature};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};

/// A JPEG picture.
#[derive(Debug)]
pub(super) struct JpegImage {
    path: PathBuf,
    info: ImageInfo,
    channels: usize,
    orientation: Orientation,
}

impl JpegImage {
    /// Reads the header.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
        let frame = JpegFrame::read(reader(path)?)
            .map_err(|source| LayoutError::io(path, "cannot read the JPEG file", source))?;
        frame.check().map_err(|problem| LayoutError::unsupported(path, problem))?;
        let mut decoder = Decoder::new(reader(path)?);
        guard(path, || "header".into(), || decoder.read_info().map_err(|e| decoding_error(path, e)))?;
        let Some(header) = decoder.info() else {
            return Err(LayoutError::damaged(path, "header", "it says no size; fetch the file again"));
        };
        let channels = channels(path, header.pixel_format)?;
        let texels = [u32::from(header.width), u32::from(header.height)];
        if texels.contains(&0) {
            return Err(LayoutError::damaged(path, "header", "it has no texels; fetch the file again"));
        }
        let progressive = header.coding_process == CodingProcess::DctProgressive;
        let info = ImageInfo {
            texels,
            georeference: Georeference::default(),
            format: format!(
                "{}{} JPEG",
                if progressive { "progressive " } else { "" },
                match channels {
                    1 => "grey",
                    3 => "RGB",
                    _ => "CMYK",
                }
            ),
            notes: if channels == 4 { vec![PRESS_NOTE.into()] } else { Vec::new() },
            memory_bytes: frame.memory_bytes(),
        };
        let orientation = decoder.exif_data().map(Orientation::of_exif);
        let orientation = orientation.unwrap_or(Orientation::UPRIGHT);
        Ok(Self { path: path.to_owned(), info, channels, orientation })
    }
}

impl Picture for JpegImage {
    fn orientation(&self) -> Orientation {
        self.orientation
    }

    fn has_bytes(&self) -> bool {
        true
    }

    fn colours(&self) -> usize {
        if self.channels == 1 { 1 } else { 3 }
    }
}

impl ImageSource for JpegImage {
    fn path(&self) -> &Path {
        &self.path
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        let mut decoder = Decoder::new(reader(&self.path)?);
        let mut texels = guard(
            &self.path,
            || "image data".into(),
            || decoder.decode().map_err(|e| decoding_error(&self.path, e)),
        )?;
        let [wide, high] = self.info.texels.map(|side| side as usize);
        if texels.len() != wide * high * self.channels {
            return Err(LayoutError::damaged(
                &self.path,
                "image data",
                "it has another size than its header says",
            ));
        }
        if self.channels == 4 {
            press_to_light(&mut texels);
        }
        Ok(Box::new(Whole { texels, channels: if self.channels == 4 { 3 } else { self.channels }, at: 0 }))
    }
}

/// Four inks a texel into red, green and blue, in place.
fn press_to_light(texels: &mut Vec<u8>) {
    let mut light = 0;
    for at in (0..texels.len()).step_by(4) {
        let [c, m, y, k] = [0, 1, 2, 3].map(|i| 255 - u32::from(texels[at + i]));
        for ink in [c, m, y] {
            texels[light] = (ink * k / 255) as u8;
            light += 1;
        }
    }
    texels.truncate(light);
}

fn reader(path: &Path) -> Result<BufReader<File>, LayoutError> {
    Ok(BufReader::with_capacity(1 << 18, input::open(path, "cannot open the JPEG file")?))
}

fn channels(path: &Path, format: PixelFormat) -> Result<usize, LayoutError> {
    match format {
        PixelFormat::L8 => Ok(1),
        PixelFormat::RGB24 => Ok(3),
        // The decoder undoes what Adobe's programs turn round: 0 is no ink.
        PixelFormat::CMYK32 => Ok(4),
        PixelFormat::L16 => Err(LayoutError::unsupported(
            path,
            "the JPEG is lossless of more than 8 bits, which is not read; convert it: gdal_translate -ot Byte -scale INPUT output.tif",
        )),
    }
}

fn decoding_error(path: &Path, error: Error) -> LayoutError {
    match error {
        Error::Io(source) if source.raw_os_error().is_some() => {
            LayoutError::io(path, "cannot read the JPEG file", source)
        }
        Error::Unsupported(feature) => LayoutError::unsupported(
            path,
            format!(
                "the JPEG {}, which is not read; convert it: gdal_translate -co TILED=YES INPUT output.tif",
                words_for(&feature)
            ),
        ),
        Error::Io(_) => LayoutError::damaged(path, "image data", "the file is cut short; fetch it again"),
        _ => LayoutError::damaged(path, "image data", "its JPEG stream is damaged; fetch the file again"),
    }
}

fn words_for(feature: &UnsupportedFeature) -> String {
    match feature {
        UnsupportedFeature::Hierarchical => "is hierarchical".into(),
        UnsupportedFeature::ArithmeticEntropyCoding => "is packed by arithmetic coding".into(),
        UnsupportedFeature::SamplePrecision(bits) => format!("has {bits} bits a channel"),
        UnsupportedFeature::ComponentCount(count) => format!("has {count} channels"),
        UnsupportedFeature::DNL => "says its height behind its picture".into(),
        UnsupportedFeature::SubsamplingRatio | UnsupportedFeature::NonIntegerSubsamplingRatio => {
            "samples its channels in an unusual ratio".into()
        }
        _ => "is of an unusual kind".into(),
    }
}
