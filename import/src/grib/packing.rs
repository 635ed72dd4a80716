//! The numbers of a field (sections 5 and 7), one after the other: packed plainly, in groups, as reals, or by a codec for pictures or telemetry.
//!
//! A height is `(R + number * 2^E) / 10^D`; here are the numbers. What PNG, JPEG 2000 and CCSDS hold must be as many numbers as the field has. Memory: some kibibytes; of a codec the packed bytes and what it works
//! with, of JPEG 2000 the whole field.

use super::Fault;
use super::bits::Bits;
use super::ccsds::Ccsds;
use super::complex::Complex;
use super::fields::Part;
use super::section::Section;
use crate::jpeg2000::{self, Source, Stream, Trouble};
use std::fs::File;
use std::io::Cursor;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::file::disk::read_at;
use terrasoar_layout::portable::pow;

/// Longest packed field of a codec.
const MOST_PACKED: u64 = 1 << 31;
/// Rows that a decoder of PNG holds, bytes of a pixel, and bytes beside them, at most.
const PNG_ROWS: u64 = 8;
const PNG_PIXEL: u64 = 4;
const PNG_CHUNKS: u64 = 1 << 20;
/// Bits of a number that a decoder of JPEG 2000 keeps exactly.
const MOST_JPEG_BITS: u32 = 24;

/// How numbers are packed.
#[derive(Debug)]
pub(super) struct Packing {
    section: Section,
    method: Method,
    bits: u32,
    /// Where JPEG 2000 has its numbers, once it was looked at.
    stream: Option<Stream>,
    /// Pixels of a row of PNG, once it was looked at.
    row: u64,
    /// Numbers that are packed.
    pub(super) points: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Method {
    Constant,
    Simple,
    Complex,
    Reals,
    Jpeg2000,
    Png,
    Ccsds,
}

impl Packing {
    /// Of section 5.
    pub(super) fn of(section: Section) -> Result<Self, Fault> {
        let template = section.u16(10);
        let (method, name, least) = match template {
            0 => (Method::Simple, "simple", 21),
            2 => (Method::Complex, "complex", 47),
            3 => (Method::Complex, "complex", 49),
            4 => (Method::Reals, "reals", 12),
            40 | 40_000 => (Method::Jpeg2000, "JPEG 2000", 23),
            41 | 40_010 => (Method::Png, "PNG", 21),
            42 => (Method::Ccsds, "CCSDS", 25),
            61 => return Err(Fault::Unsupported("logarithms of its numbers are packed".into())),
            _ => return Err(Fault::Unsupported(format!("its numbers are packed by template 5.{template}"))),
        };
        if !section.reaches(least) {
            return Err(Fault::Damaged("what it says of its packing is cut short"));
        }
        let bits = match method {
            Method::Reals => match section.u8(12) {
                1 => 32,
                2 => 64,
                _ => return Err(Fault::Unsupported("its reals are neither of 32 nor of 64 bits".into())),
            },
            _ => u32::from(section.u8(20)),
        };
        if bits > if method == Method::Reals { 64 } else { 32 } {
            return Err(Fault::Unsupported(format!("its numbers have {bits} bits ({name} packing)")));
        }
        let method = if bits == 0 && method != Method::Complex { Method::Constant } else { method };
        if method == Method::Jpeg2000 && bits > MOST_JPEG_BITS {
            return Err(Fault::Unsupported(format!("JPEG 2000 of {bits} bits a number loses some of them")));
        }
        let this = Self { points: section.u32(6).into(), section, method, bits, stream: None, row: 0 };
        if !this.reference().is_finite() || !this.scale().is_finite() || this.scale() == 0.0 {
            return Err(Fault::Damaged("its numbers are scaled beyond what there is"));
        }
        Ok(this)
    }

    /// What it is called.
    pub(super) fn name(&self) -> &'static str {
        match self.method {
            Method::Constant => "one number",
            Method::Simple => "simple packing",
            Method::Complex if self.section.u16(10) == 3 => "complex packing with differences",
            Method::Complex => "complex packing",
            Method::Reals => "reals",
            Method::Jpeg2000 => "JPEG 2000",
            Method::Png => "PNG",
            Method::Ccsds => "CCSDS",
        }
    }

    /// The smallest type that holds the numbers.
    pub(super) fn sample_type(&self) -> SampleType {
        match self.method {
            Method::Reals if self.bits == 32 => SampleType::F32,
            Method::Reals => SampleType::F64,
            // Differences may lead to any number.
            Method::Complex => SampleType::I32,
            _ if self.bits <= 8 => SampleType::U8,
            _ if self.bits <= 16 => SampleType::U16,
            _ => SampleType::U32,
        }
    }

    /// Units a number.
    pub(super) fn scale(&self) -> f64 {
        if matches!(self.method, Method::Reals | Method::Constant) {
            return 1.0;
        }
        pow(2.0, self.section.i16(16).into()) / self.tens()
    }

    /// Units at number 0.
    pub(super) fn reference(&self) -> f64 {
        if self.method == Method::Reals { 0.0 } else { self.section.f32(12) / self.tens() }
    }

    fn tens(&self) -> f64 {
        pow(10.0, self.section.i16(18).into())
    }

    /// Memory that unpacking takes, of so many packed bytes.
    pub(super) fn memory_bytes(&self, packed: u64) -> u64 {
        match self.method {
            Method::Jpeg2000 => {
                let work = self.stream.as_ref().map_or(0, Stream::tile_bytes);
                work.saturating_add(self.points.saturating_mul(4))
            }
            Method::Png => packed
                .saturating_add(self.row.saturating_mul(PNG_ROWS * PNG_PIXEL))
                .saturating_add(PNG_CHUNKS),
            _ => 0,
        }
    }

    /// Looks at the head of the numbers, where they have one.
    pub(super) fn look(&mut self, file: &File, [from, to]: Part) -> Result<(), Fault> {
        if self.method == Method::Jpeg2000 {
            let stream = Stream::read(Source::File(file), from, to - from).map_err(of_jpeg)?;
            let [wide, high] = stream.texels().map(u64::from);
            if wide * high != self.points || stream.channels() != 1 {
                return Err(Fault::Damaged(
                    "its JPEG 2000 picture is not of as many numbers as the field has",
                ));
            }
            self.stream = Some(stream);
        }
        if self.method == Method::Png {
            let mut head = [0; 24];
            if to - from < head.len() as u64 {
                return Err(ENDED);
            }
            read_at(file, &mut head, from)?;
            self.row = u32::from_be_bytes([16, 17, 18, 19].map(|i: usize| head[i])).into();
        }
        Ok(())
    }

    /// Begins to unpack the numbers in a part of a file.
    pub(super) fn begin<'f>(&'f self, file: &'f File, part: Part) -> Result<Numbers<'f>, Fault> {
        Ok(match self.method {
            Method::Constant => Numbers::Constant,
            Method::Simple => Numbers::Simple(Bits::new(file, part[0], part[1]), self.bits),
            Method::Reals => Numbers::Reals(Bits::new(file, part[0], part[1]), self.bits),
            Method::Complex => {
                Numbers::Complex(Box::new(Complex::new(file, &self.section, part, self.points)?))
            }
            Method::Jpeg2000 => {
                let stream = self.stream.as_ref().ok_or(ENDED)?;
                Numbers::Decoded(jpeg_2000(file, stream)?.into_iter())
            }
            Method::Png => Numbers::Png(Box::new(png(packed(file, part)?, self.points, self.bits)?)),
            Method::Ccsds => {
                let bits = Bits::new(file, part[0], part[1]);
                Numbers::Ccsds(Box::new(Ccsds::new(bits, &self.section, self.bits)?))
            }
        })
    }
}

/// The bytes of a part.
fn packed(file: &File, [from, to]: Part) -> Result<Vec<u8>, Fault> {
    if to - from > MOST_PACKED {
        return Err(Fault::Unsupported("its packed numbers are longer than 2 GiB".into()));
    }
    let mut bytes = vec![0; (to - from) as usize];
    read_at(file, &mut bytes, from)?;
    Ok(bytes)
}

/// The numbers of a field.
pub(super) enum Numbers<'f> {
    Constant,
    Simple(Bits<'f>, u32),
    Reals(Bits<'f>, u32),
    Complex(Box<Complex<'f>>),
    Decoded(std::vec::IntoIter<f32>),
    Png(Box<Png>),
    Ccsds(Box<Ccsds<'f>>),
}

impl Numbers<'_> {
    /// The next number; NaN where it is missing.
    pub(super) fn next(&mut self) -> Result<f64, Fault> {
        Ok(match self {
            Self::Constant => 0.0,
            Self::Simple(bits, width) => bits.number(*width)?.into(),
            Self::Reals(bits, 32) => f32::from_bits(bits.number(32)?).into(),
            Self::Reals(bits, _) => {
                let high = u64::from(bits.number(32)?);
                f64::from_bits(high << 32 | u64::from(bits.number(32)?))
            }
            Self::Complex(complex) => complex.next()?,
            Self::Decoded(numbers) => numbers.next().ok_or(ENDED)?.into(),
            Self::Png(png) => png.next()?,
            Self::Ccsds(ccsds) => ccsds.next()?,
        })
    }
}

const ENDED: Fault = Fault::Damaged("its numbers end early");

fn of_jpeg(trouble: Trouble) -> Fault {
    match trouble {
        Trouble::Io(source) => Fault::Io(source),
        Trouble::Damaged(_) => Fault::Damaged("its JPEG 2000 stream is damaged"),
        Trouble::Unsupported(what) => Fault::Unsupported(format!("of its JPEG 2000 stream {what}")),
    }
}

/// The samples of a picture of one channel.
fn jpeg_2000(file: &File, stream: &Stream) -> Result<Vec<f32>, Fault> {
    let ([wide, high], tiles) = (stream.texels(), stream.tiles());
    let decode = |tile: u32| {
        let mut channels =
            jpeg2000::decode_tile(Source::File(file), stream, tile, &jpeg2000::Header::default())
                .map_err(of_jpeg)?;
        channels.pop().map(|(samples, _)| samples).ok_or(ENDED)
    };
    if tiles == [1, 1] {
        return decode(0);
    }
    let mut all = vec![0.0; wide as usize * high as usize];
    for tile in 0..tiles[0] * tiles[1] {
        let ([col, row], [across, _]) = (stream.tile_at(tile), stream.tile_size(tile));
        for (line, samples) in decode(tile)?.chunks_exact(across as usize).enumerate() {
            let at = (row as usize + line) * wide as usize + col as usize;
            all[at..at + samples.len()].copy_from_slice(samples);
        }
    }
    Ok(all)
}

/// A PNG whose pixels are numbers.
pub(super) struct Png {
    reader: png::Reader<Cursor<Vec<u8>>>,
    row: Vec<u8>,
    /// The next bit of the row, and how many a pixel has.
    at: usize,
    bits: usize,
    wide: usize,
}

fn png(packed: Vec<u8>, points: u64, bits: u32) -> Result<Png, Fault> {
    let fault = |_| Fault::Damaged("its PNG stream is damaged");
    let mut decoder = png::Decoder::new(Cursor::new(packed));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let header = decoder.read_header_info().map_err(fault)?;
    let pixel = header.color_type.samples() * header.bit_depth as usize;
    let (wide, high) = (header.width as usize, header.height);
    if wide as u64 * u64::from(high) != points || pixel < bits as usize || pixel > 32 || header.interlaced {
        return Err(Fault::Damaged("its PNG is not of such numbers as the field has"));
    }
    decoder.set_limits(png::Limits { bytes: PNG_CHUNKS as usize + wide * PNG_PIXEL as usize });
    let reader = decoder.read_info().map_err(fault)?;
    Ok(Png { reader, row: Vec::new(), at: 0, bits: pixel, wide })
}

impl Png {
    fn next(&mut self) -> Result<f64, Fault> {
        if self.at >= self.wide * self.bits || self.row.is_empty() {
            let row = self.reader.next_row().map_err(|_| Fault::Damaged("its PNG stream is damaged"))?;
            let row = row.ok_or(ENDED)?.data();
            self.row.clear();
            self.row.extend_from_slice(row);
            self.at = 0;
        }
        let (byte, bit) = (self.at / 8, self.at % 8);
        self.at += self.bits;
        if self.bits < 8 {
            let held = self.row.get(byte).ok_or(ENDED)?;
            return Ok((held >> (8 - bit - self.bits) & ((1 << self.bits) - 1)).into());
        }
        let bytes = self.row.get(byte..byte + self.bits / 8).ok_or(ENDED)?;
        Ok(bytes.iter().fold(0u32, |number, byte| number << 8 | u32::from(*byte)).into())
    }
}
