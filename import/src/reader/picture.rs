//! The border between formats of pictures and everything else: what a file says of its place, its mask and how its camera was held, and its texels.

use super::{CrsSaid, Reader};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::ImageSource;

/// How the camera was held: where row 0 and column 0 of the file are in what is shown (EXIF 2.32, 4.6.4, tag 274).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Orientation(u8);

impl Orientation {
    /// Row 0 is the top and column 0 the left.
    pub(crate) const UPRIGHT: Self = Self(1);

    /// The tag's value, from 1 to 8; what is none means upright.
    pub(crate) fn of_tag(tag: u64) -> Self {
        u8::try_from(tag).ok().filter(|tag| (1..=8).contains(tag)).map_or(Self::UPRIGHT, Self)
    }

    /// The tag in a block of EXIF, if it is there.
    pub(crate) fn of_exif(block: &[u8]) -> Self {
        let read = exif::Reader::new().read_raw(block.to_vec());
        let tag = read
            .ok()
            .and_then(|exif| exif.get_field(exif::Tag::Orientation, exif::In::PRIMARY)?.value.get_uint(0));
        tag.map_or(Self::UPRIGHT, |tag| Self::of_tag(tag.into()))
    }

    /// The tag's value.
    pub(crate) fn tag(self) -> u8 {
        self.0
    }

    /// Whether columns and rows change places.
    pub(crate) fn is_sideways(self) -> bool {
        self.0 >= 5
    }
}

/// A picture of one format, as its file has it.
pub(crate) trait Picture: ImageSource {
    /// The map from centres of texels to coordinates, and their system, as the file says them.
    fn said(&self) -> (Option<[f64; 6]>, CrsSaid) {
        (None, CrsSaid::default())
    }

    /// A mask in the file, of which 0 means that there is no picture.
    fn mask(&self) -> Option<&dyn Reader> {
        None
    }

    /// How the camera was held.
    fn orientation(&self) -> Orientation {
        Orientation::UPRIGHT
    }

    /// Whether its channels are bytes in the file.
    fn has_bytes(&self) -> bool;

    /// The byte of each colour as which a number of the file is shown; `None` of one that no channel can hold, and where bytes are no numbers of the file.
    fn byte_of(&self, number: f64) -> Option<u8> {
        (self.has_bytes() && number.fract() == 0.0 && (0.0..=255.0).contains(&number)).then_some(number as u8)
    }

    /// Bits that its channels make use of: of 16 cameras and satellites use 10, 12 or 14. May read the whole picture once.
    ///
    /// # Errors
    /// As reading its rows.
    fn bits(&self) -> Result<u32, LayoutError> {
        Ok(8)
    }

    /// Shows it as one whose channels make use of so many bits, from 8 to 16, so that pictures beside each other are as bright.
    fn use_bits(&mut self, _bits: u32) {}

    /// Channels of colour: 1 of a grey picture, else 3.
    fn colours(&self) -> usize {
        3
    }

    /// Whether the bands that were asked for are those that it gives; else they are chosen among its colours.
    fn has_chosen_bands(&self) -> bool {
        false
    }

    /// Its numbers as the file has them, from the first row on; `None` where its rows of bytes are these.
    ///
    /// # Errors
    /// As reading its rows.
    fn numbers(&self) -> Result<Option<Box<dyn NumberRows + '_>>, LayoutError> {
        Ok(None)
    }

    /// The smallest and largest number that its channels can hold, where these are whole numbers.
    fn limits(&self) -> Option<[i32; 2]> {
        Some([0, 255])
    }

    /// Whether its numbers grow towards black.
    fn is_inverse(&self) -> bool {
        false
    }
}

/// Three colours and alpha (0 to 255) of a texel, as the file has them. A grey texel has its number three times; what is not there is NaN.
pub(crate) type Numbers = [f32; 4];

/// Gives the numbers of a picture row by row.
pub(crate) trait NumberRows: Send {
    /// The next rows, as many as fit.
    ///
    /// # Errors
    /// Damage in the data, naming the file and the place; I/O.
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError>;
}

/// Bits that numbers up to this one take, at least the eight that are shown.
pub(crate) fn bits_of(peak: u16) -> u32 {
    (16 - peak.leading_zeros()).max(8)
}

/// The upper eight of so many bits.
pub(crate) fn upper_eight(number: u16, bits: u32) -> u8 {
    (number >> (bits - 8)).min(255) as u8
}
