//! Pictures as JPEG XL, decoded as a whole while they are read, which counts against the memory budget.
//!
//! The picture is turned as the stream says, as the standard wants it. What has no colour profile is brought into sRGB. Of more than 8 bits the upper 8 of those in use are shown, for
//! which the picture is decoded once more; reals are shown where they are a lossy picture, of which 1 is white, or where a person states what is black and white.

use crate::jxl::{self, As, Depth, Frame, Trouble};
use crate::reader::{NumberRows, Numbers, Picture, bits_of, upper_eight};
use crate::shown::PictureOptions;
use crate::{guard, input};
use jxl_oxide::Render;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};
use terrasoar_layout::remedy::Remedy;

/// A JPEG XL picture.
#[derive(Debug)]
pub(super) struct JxlPicture {
    path: PathBuf,
    info: ImageInfo,
    frame: Frame,
    /// Length of the file.
    length: u64,
    has_bytes: bool,
    /// Bits in use of up to 16, once they were looked for or said.
    bits: OnceLock<u32>,
}

impl JxlPicture {
    /// Reads the header.
    pub(super) fn open(path: &Path, options: &PictureOptions) -> Result<Self, LayoutError> {
        let file = reader(path)?;
        let length = file.get_ref().metadata().map_err(|e| refused(path, "header", Trouble::Io(e)))?.len();
        let read = || Frame::read(file).map_err(|trouble| refused(path, "header", trouble));
        let frame = guard(path, || "header".to_owned(), read)?;
        if frame.is_press() {
            return Err(refused(path, "header", Trouble::Unsupported("it is in CMYK, the inks of a press")));
        }
        let (bits, kind) = match frame.depth {
            Depth::Whole(bits) => (bits, "whole"),
            Depth::Real(bits) => (bits, "real"),
        };
        // Of a lossy picture the decoder says what is black and what is white.
        let has_bytes = match frame.depth {
            Depth::Whole(bits) => bits <= 8 || (bits > 16 && frame.is_lossy),
            Depth::Real(_) => frame.is_lossy,
        };
        let mut notes = Vec::new();
        if options.stretch.is_none() && !has_bytes {
            if !matches!(frame.depth, Depth::Whole(..=16)) {
                return Err(LayoutError::unsupported(
                    path,
                    format!(
                        "its samples are {kind} numbers of {bits} bits, of which nothing says what is black and what is white; state that, in percent or in values"
                    ),
                )
                .mended_by(Remedy::Stretch));
            }
            notes.push(format!("{bits} bits a channel are cut to the upper 8 of those in use"));
        }
        let others = frame.extra.len() - usize::from(frame.alpha().is_some());
        if others > 0 {
            let channels = frame.colours + frame.extra.len();
            notes.push(format!(
                "{others} of its {channels} bands are neither colour nor alpha and are left out"
            ));
        }
        let info = ImageInfo {
            texels: frame.size(),
            georeference: Georeference::default(),
            format: format!(
                "{bits}-bit {} {} JPEG XL{}",
                if frame.is_lossy { "lossy" } else { "lossless" },
                if frame.colours == 1 { "grey" } else { "RGB" },
                if frame.alpha().is_some() { " with alpha" } else { "" }
            ),
            notes,
            memory_bytes: frame.memory_bytes(length),
        };
        Ok(Self { path: path.to_owned(), info, frame, length, has_bytes, bits: OnceLock::new() })
    }

    /// Decodes it, and makes something of each texel: three colours, of which 1 is white, and alpha.
    fn each<T>(&self, as_what: As, mut take: impl FnMut([f32; 3], f32) -> T) -> Result<Vec<T>, LayoutError> {
        let place = || "image data".to_owned();
        let refuse = |trouble| refused(&self.path, "image data", trouble);
        let file = reader(&self.path)?;
        guard(&self.path, place, || {
            let render = jxl::decode(file, self.length, &self.frame, as_what).map_err(refuse)?;
            let missing = || refuse(Trouble::Damaged("it has another size or kind than it says"));
            self.texels(&render, &mut take).ok_or_else(missing)
        })
    }

    fn texels<T>(&self, render: &Render, take: &mut impl FnMut([f32; 3], f32) -> T) -> Option<Vec<T>> {
        let [wide, high] = self.info.texels.map(|side| side as usize);
        let mut stream = render.stream();
        let channels = self.frame.colours + usize::from(self.frame.alpha().is_some());
        let is_alike = [stream.width(), stream.height()] == self.info.texels;
        if !is_alike || stream.channels() as usize != channels {
            return None;
        }
        let is_multiplied = self.frame.alpha() == Some(true);
        let mut texels = Vec::with_capacity(wide * high);
        let mut row = vec![0.0f32; wide * channels];
        for _ in 0..high {
            if stream.write_to_buffer(&mut row) != row.len() {
                return None;
            }
            texels.extend(row.chunks_exact(channels).map(|texel| {
                let (colours, alpha) = match *texel {
                    [grey] => ([grey; 3], 1.0),
                    [grey, alpha] => ([grey; 3], alpha),
                    [r, g, b] => ([r, g, b], 1.0),
                    [r, g, b, alpha, ..] => ([r, g, b], alpha),
                    [] => ([0.0; 3], 0.0),
                };
                let share = if is_multiplied && alpha > 0.0 { alpha } else { 1.0 };
                take(colours.map(|colour| colour / share), alpha)
            }));
        }
        Some(texels)
    }

    /// A whole number of the file.
    fn whole(&self, colour: f32) -> u16 {
        (colour * self.frame.depth.white()).round() as u16
    }
}

/// A share of white, in bytes.
fn byte(share: f32) -> u8 {
    (share * 255.0).round() as u8
}

impl Picture for JxlPicture {
    fn has_bytes(&self) -> bool {
        self.has_bytes
    }

    fn byte_of(&self, number: f64) -> Option<u8> {
        let white = f64::from(self.frame.depth.white());
        let is_one = number.fract() == 0.0 && (0.0..=white).contains(&number);
        // Of a lossy picture hardly a number is what it was.
        let is_kept = self.has_bytes && !self.frame.is_lossy;
        (is_one && is_kept).then(|| byte((number / white) as f32))
    }

    fn bits(&self) -> Result<u32, LayoutError> {
        if self.has_bytes {
            return Ok(8);
        }
        if let Some(bits) = self.bits.get() {
            return Ok(*bits);
        }
        let mut peak = 0;
        self.each(As::Shown, |colours, alpha| {
            // What nobody sees does not count.
            let seen = colours.into_iter().filter(|_| alpha > 0.0);
            peak = seen.fold(peak, |peak, colour| peak.max(self.whole(colour)));
        })?;
        Ok(*self.bits.get_or_init(|| bits_of(peak)))
    }

    fn use_bits(&mut self, bits: u32) {
        self.bits = OnceLock::from(bits);
    }

    fn colours(&self) -> usize {
        self.frame.colours
    }

    fn numbers(&self) -> Result<Option<Box<dyn NumberRows + '_>>, LayoutError> {
        if matches!(self.frame.depth, Depth::Whole(..=8)) {
            return Ok(None);
        }
        let white = self.frame.depth.white();
        // Whole numbers of a lossless picture are whole again.
        let is_whole = matches!(self.frame.depth, Depth::Whole(_)) && !self.frame.is_lossy;
        let number = |share: f32| if is_whole { (share * white).round() } else { share * white };
        let texels = self.each(As::Stored, |colours, alpha| {
            let [r, g, b] = colours.map(number);
            [r, g, b, alpha.clamp(0.0, 1.0) * 255.0]
        })?;
        Ok(Some(Box::new(Kept { texels, at: 0 })))
    }

    fn limits(&self) -> Option<[i32; 2]> {
        match self.frame.depth {
            Depth::Whole(..=8) => Some([0, 255]),
            // A lossy picture may go beyond its bits.
            Depth::Whole(bits @ ..=16) if !self.frame.is_lossy => Some([0, (1 << bits) - 1]),
            _ => None,
        }
    }
}

impl ImageSource for JxlPicture {
    fn path(&self) -> &Path {
        &self.path
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        let bits = self.bits()?;
        let texels = self.each(As::Shown, |colours, alpha| {
            let [r, g, b] = match self.has_bytes {
                true => colours.map(byte),
                false => colours.map(|colour| upper_eight(self.whole(colour), bits)),
            };
            [r, g, b, byte(alpha)]
        })?;
        Ok(Box::new(Kept { texels, at: 0 }))
    }
}

/// Texels that were decoded as a whole.
struct Kept<T> {
    texels: Vec<T>,
    at: usize,
}

impl<T: Copy> Kept<T> {
    fn fill(&mut self, texels: &mut [T]) {
        // The readers of rows ask for no more than there are.
        let next = &self.texels[self.at.min(self.texels.len())..];
        texels.iter_mut().zip(next).for_each(|(to, from)| *to = *from);
        self.at += texels.len();
    }
}

impl RowReader for Kept<[u8; 4]> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        self.fill(rgba.as_chunks_mut::<4>().0);
        Ok(())
    }
}

impl NumberRows for Kept<Numbers> {
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError> {
        self.fill(texels);
        Ok(())
    }
}

fn reader(path: &Path) -> Result<BufReader<File>, LayoutError> {
    Ok(BufReader::with_capacity(1 << 16, input::open(path, "cannot open the JPEG XL file")?))
}

fn refused(path: &Path, place: &str, trouble: Trouble) -> LayoutError {
    match trouble {
        Trouble::Io(source) => LayoutError::io(path, "cannot read the JPEG XL file", source),
        Trouble::Damaged(problem) => {
            LayoutError::damaged(path, place, format!("{problem}; fetch or write the file again"))
        }
        Trouble::Unsupported(problem) => LayoutError::unsupported(
            path,
            format!("{problem}, which is not read; convert it: djxl INPUT output.png"),
        ),
    }
}
