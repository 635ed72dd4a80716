//! Readers of images: each turns one format into an [`ImageSource`].
//!
//! [`open`] looks at a file's first bytes, never at its name. Opening reads headers; rows are read when they are asked for. Nothing in a file is
//! trusted: what it declares is checked against limits before memory is taken for it.

mod jpeg;
mod png;
mod world;

use crate::{TiffImage, input, is_tiff};
use std::io::Read;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::ImageSource;

/// Opens the image at `path`: PNG, JPEG or GeoTIFF, of 8 bits a channel (16 are cut to 8 with a word), grey, RGB or a palette, with or
/// without alpha. A world file beside it says where a PNG or JPEG lies.
///
/// # Errors
/// [`LayoutError::Io`] for a file that is missing or cannot be read; [`LayoutError::NotThisFormat`] for none of these formats;
/// [`LayoutError::Unsupported`] and [`LayoutError::Damaged`] from the reader.
pub fn open_image(path: &Path) -> Result<Box<dyn ImageSource>, LayoutError> {
    let mut head = Vec::with_capacity(16);
    if path.is_dir() {
        return Err(LayoutError::not_this_format(path, "this is a directory; name the images in it"));
    }
    input::open(path, "cannot read the image")?
        .take(16)
        .read_to_end(&mut head)
        .map_err(|source| LayoutError::io(path, "cannot read the image", source))?;
    Ok(if head.starts_with(b"\x89PNG\r\n\x1a\n") {
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
    })
}
