//! A large baseline JPEG some rows at a time, where decoders want all of it.
//!
//! Its coefficients are read in order and copied, with other codes, into rows of blocks that stand for themselves ([`entropy`]). Some such rows with a header of their height are
//! a small JPEG, which jpeg-decoder decodes; a row more on each side is decoded and dropped, so that chroma between them is as in the whole. Bands are decoded in parallel. Memory: the
//! bands at work. Cost: the copying, by one thread, and a quarter more of decoding.
//!
//! Progressive pictures, and those whose channels come one after the other, are decoded as a whole elsewhere: of them all rows depend on all of the file.

mod entropy;

use entropy::{Bits, Codes, Out, Trouble, copy_block, tables};
use jpeg_decoder::Decoder;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::io::Read;

/// Rows of texels of a band, about.
const BAND_ROWS: u32 = 128;
/// Memory that the bands at work may take together, unless one takes more.
const MOST_BYTES: u64 = 160 << 20;
/// Longest header, and how much of it each band may carry.
const MAX_HEADER_BYTES: usize = 16 << 20;
const MAX_KEPT_BYTES: usize = 256 << 10;

/// Why there are no more rows.
#[derive(Debug)]
pub(crate) enum NoRows {
    Io(std::io::Error),
    Damaged,
    /// It is of a kind that is not read some rows at a time.
    Other,
}

impl From<Trouble> for NoRows {
    fn from(trouble: Trouble) -> Self {
        match trouble {
            Trouble::Io(error) => Self::Io(error),
            Trouble::Damaged => Self::Damaged,
        }
    }
}

impl From<std::io::Error> for NoRows {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => Self::Damaged,
            _ => Self::Io(error),
        }
    }
}

/// A channel: its sampling and its codes.
struct Channel {
    id: u8,
    blocks: u32,
    first: usize,
    others: usize,
    before: [i32; 2],
}

/// The shape of a picture in blocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    size: [u32; 2],
    /// Units of blocks across and down, and the height of one in texels.
    units: [u32; 2],
    unit_high: u32,
    channels: u64,
    /// Rows of units in a band.
    band: u32,
}

impl Shape {
    /// Of a picture whose channels are sampled so (across and down).
    pub(crate) fn new(size: [u32; 2], sampling: &[[u64; 2]]) -> Self {
        let most = |i: usize| sampling.iter().map(|factors| factors[i] as u32).max().unwrap_or(1);
        // A single channel has units of one block, whatever its sampling.
        let unit = if sampling.len() == 1 { [8; 2] } else { [8 * most(0), 8 * most(1)] };
        let units = [0, 1].map(|i| size[i].div_ceil(unit[i]));
        let band = (BAND_ROWS / unit[1]).max(1);
        Self { size, units, unit_high: unit[1], channels: sampling.len() as u64, band }
    }

    /// Memory that a band takes while it is decoded: its header, coefficients, planes, texels, and texels that wait.
    fn band_bytes(&self) -> u64 {
        let rows = u64::from((self.band + 2) * self.unit_high);
        (u64::from(self.size[0]) + 64) * rows * self.channels * 4 + MAX_KEPT_BYTES as u64
    }

    /// Bands decoded at once.
    fn at_once(&self) -> u32 {
        let fit = (MOST_BYTES / self.band_bytes().max(1)).max(1);
        fit.min(rayon::current_num_threads() as u64) as u32
    }

    /// Memory that reading all rows takes.
    pub(crate) fn memory_bytes(&self) -> u64 {
        self.band_bytes().saturating_mul(u64::from(self.at_once()) + 1).saturating_add(1 << 20)
    }
}

/// Rows of a picture.
pub(crate) struct JpegRows<R> {
    shape: Shape,
    /// What comes before the scan in each band, and where the height stands in it.
    header: Vec<u8>,
    height_at: usize,
    codes: [Option<Codes>; 8],
    channels: Vec<Channel>,
    bits: Bits<R>,
    /// Units between marks of restart, or 0, and how many are left.
    interval: u32,
    left: u32,
    /// Copied rows of units, the first of which is numbered `first`.
    copied: VecDeque<Vec<u8>>,
    first: u32,
    /// Bands that were handed out.
    next_band: u32,
    /// Texels that wait to be handed out.
    waiting: VecDeque<Vec<u8>>,
    at: usize,
}

impl<R: Read + Sync> JpegRows<R> {
    /// Reads the header of a picture of `shape`.
    pub(crate) fn begin(mut input: R, shape: Shape) -> Result<Self, NoRows> {
        let mut header = vec![0xff, 0xd8];
        let mut codes: [Option<Codes>; 8] = std::array::from_fn(|_| None);
        let (mut height_at, mut interval) = (0, 0);
        let mut frame: Vec<(u8, u32)> = Vec::new();
        let mut read = 0;
        let mut two = [0; 2];
        input.read_exact(&mut two)?;
        loop {
            let mut byte = [0];
            input.read_exact(&mut byte)?;
            if byte[0] != 0xff {
                return Err(NoRows::Damaged);
            }
            while byte[0] == 0xff {
                input.read_exact(&mut byte)?;
            }
            input.read_exact(&mut two)?;
            let length = usize::from(u16::from_be_bytes(two)).checked_sub(2).ok_or(NoRows::Damaged)?;
            let mut segment = vec![0; length];
            input.read_exact(&mut segment)?;
            read += length;
            if read > MAX_HEADER_BYTES {
                return Err(NoRows::Damaged);
            }
            let mut keep = |segment: &[u8]| {
                header.extend([0xff, byte[0], two[0], two[1]]);
                header.extend(segment);
                (header.len() <= MAX_KEPT_BYTES).then_some(header.len() - segment.len()).ok_or(NoRows::Other)
            };
            match byte[0] {
                0xc0 | 0xc1 => {
                    let at = keep(&segment)?;
                    height_at = at + 1;
                    let size = [3, 1].map(|at| {
                        segment.get(at..at + 2).map_or(0, |b| u32::from(u16::from_be_bytes([b[0], b[1]])))
                    });
                    let each = segment.get(6..).unwrap_or_default().chunks_exact(3);
                    frame = each.map(|c| (c[0], u32::from(c[1] >> 4) * u32::from(c[1] & 15))).collect();
                    if size != shape.size || segment[0] != 8 || frame.len() as u64 != shape.channels {
                        return Err(NoRows::Other);
                    }
                }
                0xc4 => declare(&segment, &mut codes).ok_or(NoRows::Damaged)?,
                0xdd => {
                    interval = segment.get(..2).map_or(0, |b| u32::from(u16::from_be_bytes([b[0], b[1]])))
                }
                // Quantisation, and what says how colours are meant.
                0xdb | 0xe0 | 0xee => drop(keep(&segment)?),
                0xda => {
                    let channels = scan(&segment, &frame).ok_or(NoRows::Other)?;
                    header.extend(tables());
                    header.extend([0xff, 0xdd, 0, 4]);
                    header.extend((u16::try_from(shape.units[0]).map_err(|_| NoRows::Other)?).to_be_bytes());
                    header.extend([0xff, 0xda, 0, 6 + 2 * channels.len() as u8, channels.len() as u8]);
                    header.extend(channels.iter().flat_map(|channel| [channel.id, 0]));
                    header.extend([0, 63, 0]);
                    return Ok(Self {
                        shape,
                        header,
                        height_at,
                        codes,
                        channels,
                        bits: Bits::new(input),
                        interval,
                        left: interval,
                        copied: VecDeque::new(),
                        first: 0,
                        next_band: 0,
                        waiting: VecDeque::new(),
                        at: 0,
                    });
                }
                0xc2..=0xcf => return Err(NoRows::Other),
                _ => {}
            }
        }
    }

    /// Copies the next row of units.
    fn copy_row(&mut self) -> Result<(), NoRows> {
        let mut out = Out::default();
        self.channels.iter_mut().for_each(|channel| channel.before[1] = 0);
        for _ in 0..self.shape.units[0] {
            if self.interval > 0 && self.left == 0 {
                self.bits.restart()?;
                self.left = self.interval;
                self.channels.iter_mut().for_each(|channel| channel.before[0] = 0);
            }
            self.left = self.left.saturating_sub(1);
            for channel in &mut self.channels {
                let codes = [&self.codes[channel.first], &self.codes[channel.others]];
                let [Some(first), Some(others)] = codes else { return Err(NoRows::Damaged) };
                for _ in 0..channel.blocks {
                    copy_block(&mut self.bits, &mut out, [first, others], &mut channel.before)?;
                }
            }
        }
        self.bits.check()?;
        out.end();
        self.copied.push_back(out.bytes);
        Ok(())
    }

    /// Decodes the bands that come next.
    fn more(&mut self) -> Result<(), NoRows> {
        let (band, down) = (self.shape.band, self.shape.units[1]);
        let last_band = down.div_ceil(band);
        let bands = self.next_band..last_band.min(self.next_band + self.shape.at_once());
        if bands.is_empty() {
            return Err(NoRows::Damaged);
        }
        let end = down.min(bands.end * band + 1);
        while self.first + (self.copied.len() as u32) < end {
            self.copy_row()?;
        }
        let this = &*self;
        let decoded: Vec<Vec<u8>> = bands
            .clone()
            .into_par_iter()
            .map(|number| this.decode(number).ok_or(NoRows::Damaged))
            .collect::<Result<_, _>>()?;
        self.waiting.extend(decoded);
        self.next_band = bands.end;
        let keep = (bands.end * band).saturating_sub(1);
        while self.first < keep && self.copied.pop_front().is_some() {
            self.first += 1;
        }
        Ok(())
    }

    /// The texels of a band.
    fn decode(&self, number: u32) -> Option<Vec<u8>> {
        let Shape { size, units, unit_high, .. } = self.shape;
        let band = self.shape.band;
        let wanted = [number * band, units[1].min((number + 1) * band)];
        let around = [wanted[0].saturating_sub(1), units[1].min(wanted[1] + 1)];
        let top = around[0] * unit_high;
        let high = size[1].min(around[1] * unit_high) - top;
        let mut bytes = self.header.clone();
        bytes[self.height_at..self.height_at + 2].copy_from_slice(&(high as u16).to_be_bytes());
        for (mark, row) in (0u8..).zip(around[0]..around[1]) {
            if mark > 0 {
                bytes.extend([0xff, 0xd0 + (mark - 1) % 8]);
            }
            bytes.extend(self.copied.get((row - self.first) as usize)?);
        }
        bytes.extend([0xff, 0xd9]);
        let texels = Decoder::new(&bytes[..]).decode().ok()?;
        let pitch = size[0] as usize * self.shape.channels as usize;
        let rows =
            [wanted[0] * unit_high - top, size[1].min(wanted[1] * unit_high) - top].map(|row| row as usize);
        texels.get(rows[0] * pitch..rows[1] * pitch).map(<[u8]>::to_vec)
    }

    /// The next texels, as many as fit, as the decoder gives them.
    pub(crate) fn read(&mut self, mut texels: &mut [u8]) -> Result<(), NoRows> {
        while !texels.is_empty() {
            let Some(front) = self.waiting.front() else {
                self.more()?;
                continue;
            };
            let count = texels.len().min(front.len() - self.at);
            let (now, later) = texels.split_at_mut(count);
            now.copy_from_slice(&front[self.at..self.at + count]);
            self.at += count;
            texels = later;
            if self.at == front.len() {
                self.waiting.pop_front();
                self.at = 0;
            }
        }
        Ok(())
    }
}

/// Takes the codes of a segment: first ones are in the first four places.
fn declare(mut segment: &[u8], codes: &mut [Option<Codes>; 8]) -> Option<()> {
    while let Some((kind, rest)) = segment.split_first() {
        let counts: &[u8; 16] = rest.get(..16)?.try_into().ok()?;
        let total: usize = counts.iter().map(|count| usize::from(*count)).sum();
        let values = rest.get(16..16 + total)?;
        let place = usize::from(kind >> 4) * 4 + usize::from(kind & 15);
        *codes.get_mut(place).filter(|_| kind & 15 < 4)? = Some(Codes::new(counts, values)?);
        segment = &rest[16 + total..];
    }
    Some(())
}

/// The channels of a scan, which must be all of the frame, in its order.
fn scan(segment: &[u8], frame: &[(u8, u32)]) -> Option<Vec<Channel>> {
    let count = usize::from(*segment.first()?);
    if count != frame.len() || count == 0 {
        return None;
    }
    let each = segment.get(1..1 + 2 * count)?.chunks_exact(2).zip(frame);
    each.map(|(said, (id, blocks))| {
        let blocks = if count == 1 { 1 } else { *blocks };
        let (first, others) = (usize::from(said[1] >> 4), usize::from(said[1] & 15));
        (said[0] == *id && first < 4 && others < 4 && (1..=16).contains(&blocks)).then_some(Channel {
            id: *id,
            blocks,
            first,
            others: 4 + others,
            before: [0; 2],
        })
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jpeg_frame::JpegFrame;

    fn fixture(name: &str) -> Vec<u8> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/image_fixtures");
        std::fs::read(format!("{folder}/{name}.jpg")).unwrap()
    }

    fn shape(jpeg: &[u8], band: u32) -> Option<Shape> {
        Some(Shape { band, ..JpegFrame::read(jpeg).unwrap().in_rows()? })
    }

    fn read(jpeg: &[u8], shape: Shape, step: usize) -> Result<Vec<u8>, NoRows> {
        let mut rows = JpegRows::begin(jpeg, shape)?;
        let mut all = vec![0; shape.size[0] as usize * shape.size[1] as usize * shape.channels as usize];
        all.chunks_mut(step).try_for_each(|part| rows.read(part))?;
        Ok(all)
    }

    #[test]
    fn bands_joined_are_the_picture() {
        for jpeg in ["baseline", "grey", "cmyk", "restart"].map(fixture) {
            let jpeg = &jpeg[..];
            let whole = Decoder::new(jpeg).decode().unwrap();
            for (band, step) in [(1, 7), (2, 1000), (3, 216), (100, 1 << 20)] {
                let shape = shape(jpeg, band).unwrap();
                assert!(read(jpeg, shape, step).unwrap() == whole, "{band} {shape:?}");
            }
        }
        assert!(shape(&fixture("progressive"), 1).is_none());
    }

    #[test]
    fn streams_cut_or_changed_end_in_an_answer() {
        for sound in ["baseline", "restart"].map(fixture) {
            let shape = shape(&sound, 1).unwrap();
            let mut wrong = 0;
            for at in 0..sound.len() {
                let mut changed = sound.clone();
                changed[at] ^= 0x5a;
                wrong += u32::from(read(&changed, shape, 999).is_err());
                wrong += u32::from(read(&sound[..at], shape, 999).is_err());
            }
            assert!(wrong > sound.len() as u32, "{wrong}");
        }
    }

    #[test]
    fn a_mark_of_restart_must_stand_where_the_header_says() {
        let sound = fixture("restart");
        let shape = shape(&sound, 1).unwrap();
        let marks: Vec<usize> = (0..sound.len() - 1)
            .filter(|at| sound[*at] == 0xff && matches!(sound[at + 1], 0xd0..=0xd7))
            .collect();
        assert!(marks.len() > 5, "{marks:?}");
        for at in marks {
            let missing = [&sound[..at], &sound[at + 2..]].concat();
            assert!(matches!(read(&missing, shape, 999), Err(NoRows::Damaged)), "{at}");
        }
    }
}
