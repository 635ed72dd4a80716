//! Pictures as WebP, lossy and lossless, with or without alpha. One is decoded as a whole while it is read, which counts against the memory budget.

use super::png::spread;
use crate::reader::{Orientation, Picture};
use crate::webp::{self, Frame, Trouble};
use crate::{guard, input};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};

/// A WebP picture.
#[derive(Debug)]
pub(super) struct WebpImage {
    path: PathBuf,
    info: ImageInfo,
    frame: Frame,
    orientation: Orientation,
}

impl WebpImage {
    /// Reads the header.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
        let header = || "header".to_owned();
        let file = reader(path)?;
        let frame =
            guard(path, header, || Frame::read(file).map_err(|trouble| refused(path, "header", trouble)))?;
        if frame.is_animated {
            return Err(LayoutError::unsupported(
                path,
                "the WebP moves, and a picture does not; take one of its pictures: webpmux -get frame 1 INPUT -o output.webp",
            ));
        }
        let file = reader(path)?;
        let exif = guard(path, header, || Ok(webp::exif(file)))?;
        let info = ImageInfo {
            texels: frame.size,
            georeference: Georeference::default(),
            format: format!(
                "{} WebP{}",
                if frame.is_lossy { "lossy" } else { "lossless" },
                if frame.has_alpha { " with alpha" } else { "" }
            ),
            notes: Vec::new(),
            memory_bytes: frame.memory_bytes(),
        };
        let orientation = exif.as_deref().map_or(Orientation::UPRIGHT, Orientation::of_exif);
        Ok(Self { path: path.to_owned(), info, frame, orientation })
    }
}

impl Picture for WebpImage {
    fn orientation(&self) -> Orientation {
        self.orientation
    }

    fn has_bytes(&self) -> bool {
        true
    }
}

impl ImageSource for WebpImage {
    fn path(&self) -> &Path {
        &self.path
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        let place = || "image data".to_owned();
        let file = reader(&self.path)?;
        let texels = guard(&self.path, place, || {
            webp::decode(file, &self.frame).map_err(|trouble| refused(&self.path, "image data", trouble))
        })?;
        Ok(Box::new(Whole { texels, channels: self.frame.channels(), at: 0 }))
    }
}

/// Texels of a picture that was decoded as a whole.
pub(super) struct Whole {
    pub(super) texels: Vec<u8>,
    /// As of [`spread`].
    pub(super) channels: usize,
    pub(super) at: usize,
}

impl RowReader for Whole {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let end = (self.at + rgba.len() / 4 * self.channels).min(self.texels.len());
        spread(&self.texels[self.at..end], self.channels, rgba);
        self.at = end;
        Ok(())
    }
}

fn reader(path: &Path) -> Result<BufReader<File>, LayoutError> {
    Ok(BufReader::with_capacity(1 << 18, input::open(path, "cannot open the WebP file")?))
}

fn refused(path: &Path, place: &str, trouble: Trouble) -> LayoutError {
    match trouble {
        Trouble::Io(source) => LayoutError::io(path, "cannot read the WebP file", source),
        Trouble::Damaged(problem) => {
            LayoutError::damaged(path, place, format!("{problem}; fetch or write the file again"))
        }
        Trouble::Unsupported(problem) => LayoutError::unsupported(
            path,
            format!(
                "{problem}, which is not read; convert it: gdal_translate -co TILED=YES INPUT output.tif"
            ),
        ),
    }
}
