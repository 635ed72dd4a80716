//! Pictures as JPEG, baseline and progressive, decoded by jpeg-decoder.
//!
//! The decoder gives a picture as a whole: its texels are held while it is read, and more while it is decoded ([`JpegFrame::memory_bytes`]): 4.5 bytes a texel of the usual kind, 7.5 of a
//! progressive one. That counts against the memory budget. A large baseline picture is handed to it in bands ([`crate::jpeg_rows`]), and takes memory for these alone; a large progressive one
//! goes through a tiled GeoTIFF.

use super::png::spread;
use super::webp::Whole;
use crate::jpeg_frame::JpegFrame;
use crate::jpeg_rows::{JpegRows, NoRows, Shape};
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
    /// Its shape, if it is read in bands.
    bands: Option<Shape>,
}

/// Memory from which on a picture is read in bands.
const MUCH: u64 = 64 << 20;

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
        let bands = frame.in_rows().filter(|_| frame.memory_bytes() > MUCH);
        let bands =
            bands.filter(|shape| reader(path).is_ok_and(|file| JpegRows::begin(file, *shape).is_ok()));
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
            memory_bytes: bands.map_or(frame.memory_bytes(), |shape| shape.memory_bytes()),
        };
        let orientation = decoder.exif_data().map(Orientation::of_exif);
        let orientation = orientation.unwrap_or(Orientation::UPRIGHT);
        Ok(Self { path: path.to_owned(), info, channels, orientation, bands })
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
        if let Some(shape) = self.bands {
            let rows = JpegRows::begin(reader(&self.path)?, shape).map_err(|e| no_rows(&self.path, e))?;
            return Ok(Box::new(InBands { image: self, rows, texels: Vec::new() }));
        }
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

/// Rows of a picture that is read in bands.
struct InBands<'i> {
    image: &'i JpegImage,
    rows: JpegRows<BufReader<File>>,
    texels: Vec<u8>,
}

impl RowReader for InBands<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let JpegImage { path, info, channels, .. } = self.image;
        for row in rgba.chunks_exact_mut(4 * info.texels[0] as usize) {
            self.texels.resize(info.texels[0] as usize * channels, 0);
            let (rows, texels) = (&mut self.rows, &mut self.texels);
            guard(path, || "image data".into(), || rows.read(texels).map_err(|e| no_rows(path, e)))?;
            if *channels == 4 {
                press_to_light(texels);
            }
            spread(texels, if *channels == 4 { 3 } else { *channels }, row);
        }
        Ok(())
    }
}

fn no_rows(path: &Path, trouble: NoRows) -> LayoutError {
    match trouble {
        NoRows::Io(source) => LayoutError::io(path, "cannot read the JPEG file", source),
        _ => LayoutError::damaged(
            path,
            "image data",
            "its JPEG stream is damaged or cut short; fetch the file again",
        ),
    }
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
