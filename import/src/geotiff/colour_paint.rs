//! What the bands of a TIFF picture mean, and the texels made of them: RGBA, or numbers for a stretch.
//!
//! Cost: one pass over the samples of a chunk.

use super::stored::Stored;
use super::tags::{self, Directory, TiffFile};
use crate::reader::{Numbers, upper_eight};
use half::f16;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Bands of a picture, at most.
pub(super) const MAX_BANDS: u64 = 64;
/// Colours of a palette, at most.
const MAX_COLOURS: u64 = 65_536;

/// What the first channels mean.
#[derive(Debug)]
pub(super) enum Paint {
    Grey,
    /// White is zero.
    InverseGrey,
    Rgb,
    /// As RGB, once the JPEG decoder has done its part.
    YCbCr,
    /// Cyan, magenta, yellow and black, of which 0 is no ink.
    Cmyk,
    Palette(Vec<[u8; 3]>),
}

impl Paint {
    /// Of the image `directory`.
    pub(super) fn read(
        file: &mut TiffFile,
        directory: &Directory,
        bands: u64,
        (jpeg, bytes): (bool, bool),
    ) -> Result<Self, LayoutError> {
        let photometric = file.number(directory, tags::PHOTOMETRIC)?.unwrap_or(if bands < 3 { 1 } else { 2 });
        let what = match (photometric, bands) {
            (_, bands) if !(1..=MAX_BANDS).contains(&bands) => {
                return Err(LayoutError::unsupported(
                    file.path(),
                    format!(
                        "it has {bands} bands, and pictures are read of up to {MAX_BANDS}; choose some: gdal_translate -b 1 -b 2 -b 3 INPUT output.tif"
                    ),
                ));
            }
            (0, _) => return Ok(Self::InverseGrey),
            (1, _) => return Ok(Self::Grey),
            (2, 3..) => return Ok(Self::Rgb),
            (5, 4..) if !jpeg => return Ok(Self::Cmyk),
            (6, 3) if jpeg || bytes => return Ok(Self::YCbCr),
            (3, _) => return Ok(Self::Palette(palette(file, directory)?)),
            (5, _) => "in CMYK, the inks of a press".to_owned(),
            (6, _) => "in YCbCr of an unusual kind".to_owned(),
            (8..=10, _) => "in CIE Lab".to_owned(),
            (other, bands) => format!("of {bands} bands with the photometric code {other}"),
        };
        Err(LayoutError::unsupported(
            file.path(),
            format!(
                "the image is {what}, and textures are RGB; convert it with its colour profile, for example: \
                 magick INPUT -colorspace sRGB output.tif, and give it its georeference again with gdal_edit.py"
            ),
        ))
    }

    /// The palette that a grey image of one band has beside it: who put it there wants these colours, and GDAL shows them.
    pub(super) fn or_palette(
        self,
        file: &mut TiffFile,
        directory: &Directory,
        notes: &mut Vec<String>,
    ) -> Result<Self, LayoutError> {
        let listed = file.count(directory, tags::COLOR_MAP);
        if listed == 0 || !matches!(self, Self::Grey | Self::InverseGrey) {
            return Ok(self);
        }
        let bits = file.number(directory, tags::BITS_PER_SAMPLE)?.unwrap_or(1);
        if bits > 16 || listed != 3 << bits {
            notes.push(format!(
                "its palette of {listed} numbers does not go with its samples of {bits} bits and is left out; it is shown as grey"
            ));
            return Ok(self);
        }
        notes.push(
            "it calls itself grey and has a palette; it is shown in the colours of the palette, and in grey if band 1 is named"
                .into(),
        );
        Ok(Self::Palette(palette(file, directory)?))
    }

    /// Its channels of colour in the file.
    pub(super) fn channels(&self) -> usize {
        match self {
            Self::Grey | Self::InverseGrey | Self::Palette(_) => 1,
            Self::Rgb | Self::YCbCr => 3,
            Self::Cmyk => 4,
        }
    }

    /// Its name.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Grey | Self::InverseGrey => "grey",
            Self::Rgb => "RGB",
            Self::YCbCr => "YCbCr",
            Self::Cmyk => "CMYK",
            Self::Palette(_) => "palette",
        }
    }
}

/// The colours of the palette.
fn palette(file: &mut TiffFile, directory: &Directory) -> Result<Vec<[u8; 3]>, LayoutError> {
    let listed = file.count(directory, tags::COLOR_MAP);
    if !(3..=3 * MAX_COLOURS).contains(&listed) {
        return Err(file.damaged(format!(
            "{listed} numbers make no palette of up to {MAX_COLOURS} colours; fetch or write the file again"
        )));
    }
    let colours = file.numbers(directory, tags::COLOR_MAP, listed)?.unwrap_or_default();
    let count = colours.len() / 3;
    let colour = |i: usize| [0, 1, 2].map(|channel| (colours[channel * count + i] >> 8) as u8);
    Ok((0..count).map(colour).collect())
}

/// The samples of a picture as they are worked with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Samples {
    pub(super) sample_type: SampleType,
    /// How the file has them, where no machine does.
    pub(super) odd: Option<Stored>,
    big_endian: bool,
}

impl Samples {
    /// Those of the image `directory`. Only pictures that are stretched may be of other samples than whole ones of up to 16 bits.
    pub(super) fn read(
        file: &mut TiffFile,
        directory: &Directory,
        is_stretched: bool,
    ) -> Result<Self, LayoutError> {
        let stored = Stored::read(file, directory)?;
        let sample_type = match stored.sample_type() {
            // A real of 24 bits is one of 32.
            wide @ (SampleType::U8 | SampleType::U16) => wide,
            plain if stored.is_plain() => plain,
            _ => SampleType::F32,
        };
        if !is_stretched && !matches!(sample_type, SampleType::U8 | SampleType::U16) {
            return Err(LayoutError::unsupported(
                file.path(),
                format!(
                    "its samples are {}, of which nothing says what is black and what is white; state that, in percent or in values",
                    stored.name()
                ),
            )
            .mended_by(Remedy::Stretch));
        }
        let odd = (!stored.is_plain()).then_some(stored);
        Ok(Self { sample_type, odd, big_endian: file.is_big_endian() })
    }

    /// Bytes of a sample when it is worked with.
    pub(super) fn bytes(&self) -> usize {
        match self.sample_type {
            SampleType::U8 | SampleType::I8 => 1,
            SampleType::U16 | SampleType::I16 | SampleType::F16 => 2,
            SampleType::U32 | SampleType::I32 | SampleType::F32 => 4,
            SampleType::U64 | SampleType::I64 | SampleType::F64 => 8,
        }
    }

    /// Bits of a sample in the file.
    pub(super) fn bits(&self) -> u64 {
        self.odd.map_or(8 * self.bytes() as u64, Stored::bits)
    }

    /// Whether bytes of several stand in the order of a big-endian file.
    pub(super) fn is_big_endian(&self) -> bool {
        self.big_endian && self.odd.is_none()
    }

    /// Appends `count` samples of a row as they are worked with, of such as no machine has; `is_grey` of bits that are shades of grey.
    pub(super) fn widen(&self, row: &[u8], count: usize, is_grey: bool, bytes: &mut Vec<u8>) {
        let Some(stored) = self.odd else { return };
        let whole = stored.odd(row, self.big_endian, count);
        match self.sample_type {
            SampleType::U8 if is_grey => bytes.extend(whole.map(|number| self.shade(number as u32))),
            SampleType::U8 => bytes.extend(whole.map(|number| number as u8)),
            SampleType::U16 => bytes.extend(whole.flat_map(|number| (number as u16).to_le_bytes())),
            _ => bytes.extend(whole.flat_map(|number| (number as f32).to_le_bytes())),
        }
    }

    /// A number of less than a byte as a shade of grey.
    fn shade(&self, number: u32) -> u8 {
        let most = (1u32 << self.bits().min(8)) - 1;
        (number * 255 / most) as u8
    }

    /// The byte as which a number of the file is shown, of samples of bytes that are shades of grey; `None` of one that they cannot have.
    pub(super) fn shown(&self, number: f64) -> Option<u8> {
        let most = f64::from((1u32 << self.bits().min(8)) - 1);
        let is_one =
            self.sample_type == SampleType::U8 && number.fract() == 0.0 && (0.0..=most).contains(&number);
        is_one.then(|| self.shade(number as u32))
    }

    /// The smallest and largest whole number that a sample can be, of those of up to 16 bits.
    pub(super) fn limits(&self) -> Option<[i32; 2]> {
        match self.sample_type {
            SampleType::U8 => Some([0, 255]),
            SampleType::I8 => Some([-128, 127]),
            SampleType::U16 => Some([0, 65_535]),
            SampleType::I16 => Some([-32_768, 32_767]),
            _ => None,
        }
    }

    fn whole<const N: usize>(&self, texel: &[u8], channel: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&texel[N * channel..N * channel + N]);
        if self.is_big_endian() {
            bytes.reverse();
        }
        bytes
    }

    /// A sample of one or two bytes.
    pub(super) fn short(&self, texel: &[u8], channel: usize) -> u16 {
        match self.bytes() {
            1 => u16::from(texel[channel]),
            _ => u16::from_le_bytes(self.whole(texel, channel)),
        }
    }

    /// A sample of any type, in single precision.
    fn number(&self, texel: &[u8], channel: usize) -> f32 {
        match self.sample_type {
            SampleType::U8 => f32::from(texel[channel]),
            SampleType::I8 => f32::from(texel[channel] as i8),
            SampleType::U16 => f32::from(u16::from_le_bytes(self.whole(texel, channel))),
            SampleType::I16 => f32::from(i16::from_le_bytes(self.whole(texel, channel))),
            SampleType::F16 => f32::from(f16::from_le_bytes(self.whole(texel, channel))),
            SampleType::U32 => u32::from_le_bytes(self.whole(texel, channel)) as f32,
            SampleType::I32 => i32::from_le_bytes(self.whole(texel, channel)) as f32,
            SampleType::F32 => f32::from_le_bytes(self.whole(texel, channel)),
            SampleType::U64 => u64::from_le_bytes(self.whole(texel, channel)) as f32,
            SampleType::I64 => i64::from_le_bytes(self.whole(texel, channel)) as f32,
            SampleType::F64 => f64::from_le_bytes(self.whole(texel, channel)) as f32,
        }
    }

    /// The largest number that alpha can be.
    fn opaque(&self) -> f32 {
        match (self.odd, self.limits()) {
            (Some(odd), _) if self.sample_type != SampleType::F32 => ((1u64 << odd.bits()) - 1) as f32,
            (_, Some([_, most])) => most as f32,
            (_, None) if matches!(self.sample_type, SampleType::U32) => u32::MAX as f32,
            (_, None) if matches!(self.sample_type, SampleType::I32) => i32::MAX as f32,
            _ => 1.0,
        }
    }
}

/// Where the colours of an unpacked texel are, and what hides it.
#[derive(Debug)]
pub(super) struct Channels {
    pub(super) colours: Vec<usize>,
    pub(super) alpha: Option<usize>,
    /// Whether the colours were multiplied by alpha.
    pub(super) is_multiplied: bool,
    /// Value of all colour channels where there is no picture.
    pub(super) void: Option<f64>,
}

/// A texel whose colours were multiplied by its alpha, as they were before. A colour above alpha cannot be such a product: files of some programs say that theirs are and do not
/// mean it, and stay as they are.
fn divided([r, g, b, alpha]: [u8; 4]) -> [u8; 4] {
    if alpha == 0 || r.max(g).max(b) > alpha {
        return [r, g, b, alpha];
    }
    let [r, g, b] = [r, g, b].map(|c| ((u32::from(c) * 255 + u32::from(alpha) / 2) / u32::from(alpha)) as u8);
    [r, g, b, alpha]
}

impl Channels {
    fn is_void(&self, number: impl Fn(usize) -> f64) -> bool {
        self.void.is_some_and(|void| self.colours.iter().all(|channel| number(*channel) == void))
    }

    /// The largest number of the colours in samples of 16 bits, but for those that mean nothing.
    pub(super) fn peak_of(&self, samples: &Samples, bytes: &[u8], channels: usize) -> u16 {
        let void = self.void.filter(|void| void.fract() == 0.0).map(|void| void as i64);
        let texels = bytes.chunks_exact(channels * samples.bytes());
        // What nobody sees does not count.
        let seen = texels.filter(|texel| self.alpha.is_none_or(|alpha| samples.short(texel, alpha) > 0));
        let numbers =
            seen.flat_map(|texel| self.colours.iter().map(|channel| samples.short(texel, *channel)));
        numbers.filter(|number| Some(i64::from(*number)) != void).max().unwrap_or(0)
    }

    /// Turns samples, `channels` a texel, into RGBA. Those of 16 bits make use of `bits` of them.
    pub(super) fn paint(
        &self,
        paint: &Paint,
        samples: &Samples,
        bytes: &[u8],
        channels: usize,
        bits: u32,
        rgba: &mut [[u8; 4]],
    ) {
        let size = samples.bytes();
        if channels == 3 && size == 1 && self.void.is_none() && self.colours[..] == [0, 1, 2] {
            for (to, [r, g, b]) in rgba.iter_mut().zip(bytes.as_chunks::<3>().0) {
                *to = [*r, *g, *b, 255];
            }
            return;
        }
        let at = |i: usize| self.colours.get(i).copied().unwrap_or(0);
        let whole = samples.odd.map_or(16, |odd| odd.bits() as u32);
        for (to, from) in rgba.iter_mut().zip(bytes.chunks_exact(channels * size)) {
            // Beyond the bits in use lies what is hidden anyway.
            let shown = |channel: usize, bits: u32| match size {
                1 => from[channel],
                _ => upper_eight(samples.short(from, channel), bits),
            };
            let byte = |i: usize| shown(at(i), bits);
            *to = match paint {
                Paint::Grey => [byte(0), byte(0), byte(0), 255],
                Paint::InverseGrey => [255 - byte(0), 255 - byte(0), 255 - byte(0), 255],
                Paint::Rgb | Paint::YCbCr => [byte(0), byte(1), byte(2), 255],
                Paint::Cmyk => {
                    let [c, m, y, k] = [0, 1, 2, 3].map(|i| 255 - u32::from(shown(at(i), whole)));
                    let [r, g, b] = [c, m, y].map(|ink| (ink * k / 255) as u8);
                    [r, g, b, 255]
                }
                Paint::Palette(colours) => match colours.get(usize::from(samples.short(from, at(0)))) {
                    Some([r, g, b]) => [*r, *g, *b, 255],
                    None => [0; 4],
                },
            };
            if let Some(alpha) = self.alpha {
                to[3] = shown(alpha, whole);
                if self.is_multiplied {
                    *to = divided(*to);
                }
            }
            if self.is_void(|channel| f64::from(samples.short(from, channel))) {
                to[3] = 0;
            }
        }
    }

    /// Turns samples, `channels` a texel, into numbers.
    pub(super) fn numbers(&self, samples: &Samples, bytes: &[u8], channels: usize, texels: &mut [Numbers]) {
        let at = |i: usize| self.colours.get(i).or(self.colours.first()).copied().unwrap_or(0);
        // As the samples, which are in single precision.
        let rounded = self.void.map(|void| f64::from(void as f32));
        for (to, from) in texels.iter_mut().zip(bytes.chunks_exact(channels * samples.bytes())) {
            let number = |i: usize| samples.number(from, at(i));
            let [red, green, blue] = [0, 1, 2].map(number);
            let alpha = self.alpha.map_or(255.0, |alpha| {
                (samples.number(from, alpha) / samples.opaque() * 255.0).clamp(0.0, 255.0)
            });
            let share = if self.is_multiplied && alpha > 0.0 { alpha / 255.0 } else { 1.0 };
            *to = [red / share, green / share, blue / share, alpha];
            if rounded.is_some_and(|void| [red, green, blue].iter().all(|number| f64::from(*number) == void))
            {
                *to = [f32::NAN; 4];
            }
        }
    }
}
