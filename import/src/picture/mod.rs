//! Readers of images: each turns one format into an [`ImageSource`].
//!
//! [`open_image`] looks at a file's first bytes, never at its name. Opening reads headers and what stands beside the file ([`completed`]); rows are read when they are asked for.
//! Nothing in a file is trusted: what it declares is checked against limits before memory is taken for it.

mod across;
mod bands;
mod completed;
mod counts;
mod jp2;
mod jpeg;
mod jxl;
mod oriented;
mod png;
mod stretched;
mod texels;
mod webp;

use crate::jpeg2000::is_jpeg2000;
use crate::jxl::is_jxl;
use crate::places::Frame;
use crate::reader::{Orientation, Picture};
use crate::shown::{PictureOptions, Stretch};
use crate::tiles::{TileImage, check_asked, is_pyramid};
use crate::webp::is_webp;
use crate::{TiffImage, input, is_tiff};
use completed::Completed;
use oriented::Oriented;
use std::io::Read;
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::imagery::ImageSource;
use terrasoar_layout::remedy::Remedy;

/// Opens the image at `path`: a pyramid of map tiles, PNG, JPEG, JPEG XL, WebP, JPEG 2000 or GeoTIFF, of up to 8 bits a channel (16 are cut to 8 with a word), grey, RGB, CMYK or a palette,
/// with or without alpha, with or without a mask. Where it lies is said in it, or by a world file, `.prj` or `.aux.xml` beside it. A picture that lies nowhere is turned as its EXIF
/// tag says.
///
/// # Errors
/// [`LayoutError::Io`] for a file that is missing or cannot be read; [`LayoutError::NotThisFormat`] for none of these formats;
/// [`LayoutError::Unsupported`] and [`LayoutError::Damaged`] from the reader.
pub fn open_image(path: &Path) -> Result<Box<dyn ImageSource>, LayoutError> {
    let mut images = open_images(std::slice::from_ref(&path.to_owned()), None, &PictureOptions::default())?;
    Ok(images.remove(0))
}

/// As [`open_image`], of pictures for the terrain of `header`: they are brought into its reference system, turned north-up and onto texels of one size, those of the finest,
/// where they are not. What says nothing of its place stays as it is.
///
/// # Errors
/// As [`open_image`]; [`LayoutError::Usage`] for a picture that has no place in the terrain's system, or would become too large.
pub fn open_images_on(paths: &[PathBuf], header: &Header) -> Result<Vec<Box<dyn ImageSource>>, LayoutError> {
    open_images(paths, Some(header), &PictureOptions::default())
}

/// As [`open_images_on`], shown as `options` state; without a terrain each picture stays as it is, as of [`open_image`]. For percentiles all pictures are read once, twice those of
/// other numbers than whole ones of 16 bits.
///
/// # Errors
/// As [`open_images_on`]; [`LayoutError::Usage`] for bands that a picture does not have.
pub fn open_images(
    paths: &[PathBuf],
    header: Option<&Header>,
    options: &PictureOptions,
) -> Result<Vec<Box<dyn ImageSource>>, LayoutError> {
    check_asked(paths, &options.tiles)?;
    let around = header.and_then(Frame::wgs84).and_then(|frame| frame.bounds_deg());
    let mut opened = paths.iter().map(|path| open(path, options, around)).collect::<Result<Vec<_>, _>>()?;
    if let Some(stretch) = options.stretch {
        stretch_all(&mut opened, stretch, options)?;
    } else if opened.len() > 1 && header.is_some() {
        let sought = opened.iter().filter(|(completed, _)| !completed.has_bytes());
        fits(sought, "looking for the bits in use", options)?;
        let bits = opened.iter().map(|(completed, _)| completed.bits()).collect::<Result<Vec<_>, _>>()?;
        // Those of bytes take none of it.
        let most = bits.into_iter().max().unwrap_or(8);
        opened.iter_mut().for_each(|(completed, _)| completed.use_bits(most));
    }
    let has_place = |completed: &Completed| completed.info().georeference.pixel_to_crs.is_some();
    match header {
        Some(header) if opened.iter().all(|(completed, _)| has_place(completed)) => {
            across::bring(opened.into_iter().map(|(completed, _)| completed).collect(), header)
        }
        _ => Ok(opened.into_iter().map(|(completed, orientation)| upright(completed, orientation)).collect()),
    }
}

/// Refuses to do something with all of `pictures`, one after the other, for which there is too little memory.
fn fits<'p>(
    pictures: impl Iterator<Item = &'p (Completed, Orientation)>,
    what: &str,
    options: &PictureOptions,
) -> Result<(), LayoutError> {
    let needed = pictures.map(|(completed, _)| completed.info().memory_bytes).max().unwrap_or(0);
    let allowed = options.memory_mib.unwrap_or(512).saturating_mul(1 << 20);
    if needed <= allowed {
        return Ok(());
    }
    let enough_mib = needed.div_ceil(1 << 20) + 16;
    Err(LayoutError::Usage(format!(
        "{what} takes {enough_mib} MiB, more than the {} MiB allowed",
        allowed >> 20
    ))
    .mended_by(Remedy::Memory { enough_mib: Some(enough_mib) }))
}

/// Finds black and white of all pictures together.
fn stretch_all(
    opened: &mut [(Completed, Orientation)],
    stretch: Stretch,
    options: &PictureOptions,
) -> Result<(), LayoutError> {
    if matches!(stretch, Stretch::Percentiles(..)) {
        fits(opened.iter(), "looking for black and white", options)?;
    }
    let pictures: Vec<&Completed> = opened.iter().map(|(completed, _)| completed).collect();
    let limits = counts::limits(&pictures, stretch)?;
    let how = match stretch {
        Stretch::Values(..) => String::new(),
        Stretch::Percentiles(low, high) => {
            let of = if opened.len() > 1 { " of all pictures" } else { "" };
            format!(" ({low} and {high} percent{of})")
        }
    };
    opened.iter_mut().for_each(|(completed, _)| completed.stretch(limits, &how));
    Ok(())
}

/// Undoes how the camera was held, of a picture that lies nowhere: programs of maps place the rows of the file, whatever was done to them.
fn upright(completed: Completed, orientation: Orientation) -> Box<dyn ImageSource> {
    if orientation == Orientation::UPRIGHT || completed.info().georeference.pixel_to_crs.is_some() {
        return Box::new(completed);
    }
    Box::new(Oriented::new(completed, orientation))
}

/// The name of a format that packs pictures as films are packed, by the first bytes of a file.
fn of_video(head: &[u8]) -> Option<&'static str> {
    match head.get(4..12)? {
        b"ftypavif" | b"ftypavis" => Some("AVIF"),
        b"ftypheic" | b"ftypheix" | b"ftypheim" | b"ftypheis" | b"ftyphevc" | b"ftypmif1" | b"ftypmsf1" => {
            Some("HEIF")
        }
        _ => None,
    }
}

/// Opens a picture; `around` is where it is needed: west, south, east and north in degrees.
fn open(
    path: &Path,
    options: &PictureOptions,
    around: Option<[f64; 4]>,
) -> Result<(Completed, Orientation), LayoutError> {
    if is_pyramid(path) {
        let image = TileImage::open(path, &options.tiles, around)?;
        return Ok((Completed::new(Box::new(image), options)?, Orientation::UPRIGHT));
    }
    let mut head = Vec::with_capacity(16);
    if path.is_dir() {
        return Err(LayoutError::not_this_format(path, "this is a directory; name the images in it"));
    }
    input::open(path, "cannot read the image")?
        .take(16)
        .read_to_end(&mut head)
        .map_err(|source| LayoutError::io(path, "cannot read the image", source))?;
    let picture: Box<dyn Picture> = if head.starts_with(b"\x89PNG\r\n\x1a\n") {
        Box::new(png::PngImage::open(path, options)?)
    } else if head.starts_with(b"\xff\xd8\xff") {
        Box::new(jpeg::JpegImage::open(path)?)
    } else if is_webp(&head) {
        Box::new(webp::WebpImage::open(path)?)
    } else if is_jxl(&head) {
        Box::new(jxl::JxlPicture::open(path, options)?)
    } else if is_jpeg2000(&head) {
        Box::new(jp2::Jp2Image::open(path, options)?)
    } else if is_tiff(&head) {
        Box::new(TiffImage::open(path, options)?)
    } else if let Some(what) = of_video(&head) {
        return Err(LayoutError::unsupported(
            path,
            format!("this is an {what} picture, which is not read; convert it: magick INPUT output.png"),
        ));
    } else {
        return Err(LayoutError::not_this_format(
            path,
            "this is no PNG, JPEG, JPEG XL, WebP, JPEG 2000 or TIFF; if GDAL knows it, convert it: gdal_translate -co TILED=YES INPUT output.tif",
        ));
    };
    let orientation = picture.orientation();
    Ok((Completed::new(picture, options)?, orientation))
}
