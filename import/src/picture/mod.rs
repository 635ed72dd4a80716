//! Readers of images: each turns one format into an [`ImageSource`].
//!
//! [`open_image`] looks at a file's first bytes, never at its name. Opening reads headers and what stands beside the file ([`completed`]); rows are read when they are asked for.
//! Nothing in a file is trusted: what it declares is checked against limits before memory is taken for it.

mod across;
mod completed;
mod jpeg;
mod oriented;
mod png;
mod texels;

use crate::reader::{Orientation, Picture};
use crate::{TiffImage, input, is_tiff};
use completed::Completed;
use oriented::Oriented;
use std::io::Read;
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::imagery::ImageSource;

/// Opens the image at `path`: PNG, JPEG or GeoTIFF, of 8 bits a channel (16 are cut to 8 with a word), grey, RGB or a palette, with or
/// without alpha, with or without a mask. Where it lies is said in it, or by a world file, `.prj` or `.aux.xml` beside it. A picture that lies nowhere is turned as its EXIF
/// tag says.
///
/// # Errors
/// [`LayoutError::Io`] for a file that is missing or cannot be read; [`LayoutError::NotThisFormat`] for none of these formats;
/// [`LayoutError::Unsupported`] and [`LayoutError::Damaged`] from the reader.
pub fn open_image(path: &Path) -> Result<Box<dyn ImageSource>, LayoutError> {
    let (completed, orientation) = open(path)?;
    Ok(upright(completed, orientation))
}

/// As [`open_image`], of pictures for the terrain of `header`: they are brought into its reference system, turned north-up and onto texels of one size, those of the finest,
/// where they are not. What says nothing of its place stays as it is.
///
/// # Errors
/// As [`open_image`]; [`LayoutError::Usage`] for a picture that has no place in the terrain's system, or would become too large.
pub fn open_images_on(paths: &[PathBuf], header: &Header) -> Result<Vec<Box<dyn ImageSource>>, LayoutError> {
    let mut opened = paths.iter().map(|path| open(path)).collect::<Result<Vec<_>, _>>()?;
    if opened.len() > 1 {
        let bits = opened.iter().map(|(completed, _)| completed.bits()).collect::<Result<Vec<_>, _>>()?;
        // Those of bytes take none of it.
        let most = bits.into_iter().max().unwrap_or(8);
        opened.iter_mut().for_each(|(completed, _)| completed.use_bits(most));
    }
    if opened.iter().any(|(completed, _)| completed.info().georeference.pixel_to_crs.is_none()) {
        return Ok(opened
            .into_iter()
            .map(|(completed, orientation)| upright(completed, orientation))
            .collect());
    }
    across::bring(opened.into_iter().map(|(completed, _)| completed).collect(), header)
}

/// Undoes how the camera was held, of a picture that lies nowhere: programs of maps place the rows of the file, whatever was done to them.
fn upright(completed: Completed, orientation: Orientation) -> Box<dyn ImageSource> {
    if orientation == Orientation::UPRIGHT || completed.info().georeference.pixel_to_crs.is_some() {
        return Box::new(completed);
    }
    Box::new(Oriented::new(completed, orientation))
}

fn open(path: &Path) -> Result<(Completed, Orientation), LayoutError> {
    let mut head = Vec::with_capacity(16);
    if path.is_dir() {
        return Err(LayoutError::not_this_format(path, "this is a directory; name the images in it"));
    }
    input::open(path, "cannot read the image")?
        .take(16)
        .read_to_end(&mut head)
        .map_err(|source| LayoutError::io(path, "cannot read the image", source))?;
    let picture: Box<dyn Picture> = if head.starts_with(b"\x89PNG\r\n\x1a\n") {
        Box::new(png::PngImage::open(path)?)
    } else if head.starts_with(b"\xff\xd8\xff") {
        Box::new(jpeg::JpegImage::open(path)?)
    } else if is_tiff(&head) {
        Box::new(TiffImage::open(path)?)
    } else {
        return Err(LayoutError::not_this_format(
            path,
            "this is no PNG, JPEG or TIFF; if GDAL knows it, convert it: gdal_translate -co TILED=YES INPUT output.tif",
        ));
    };
    let orientation = picture.orientation();
    Ok((Completed::new(picture)?, orientation))
}
