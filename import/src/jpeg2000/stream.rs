//! The main header of a stream and the places of its tiles (ISO/IEC 15444-1, annex A), and a stream of one tile made of them.
//!
//! Cost: the main header, and one read of 12 bytes a part of a tile. Held are the header and 24 bytes a part.

use super::{Source, Trouble, damaged};

/// A bare stream begins so: its start, and the marker of the size.
pub(super) const START: &[u8] = b"\xff\x4f\xff\x51";
/// Longest main header; most are some hundred bytes.
const MAX_HEADER_BYTES: usize = 4 << 20;
/// Parts of tiles, at most.
const MAX_PARTS: usize = 1 << 20;
/// Tiles of a picture, at most; the standard has two bytes for their number.
const MAX_TILES: u64 = 65_535;
/// Memory of a block of code and of a precinct in the decoder, with what belongs to them, and of a layer of a block.
const BLOCK_BYTES: u64 = 320;
const LAYER_BYTES: u64 = 24;

const SIZE: u16 = 0xff51;
const STYLE: u16 = 0xff52;
const STYLE_OF_CHANNEL: u16 = 0xff53;
const PACKED_HEADERS: u16 = 0xff60;
const TILE_PART: u16 = 0xff90;
const DATA: u16 = 0xff93;
const END: u16 = 0xffd9;

/// A part of a tile.
#[derive(Debug, Clone, Copy)]
struct Part {
    tile: u32,
    at: u64,
    length: u64,
}

/// How channels are coded, as far as it costs memory.
#[derive(Debug, Clone, Copy)]
struct Style {
    layers: u64,
    /// Exponents of the smallest block's sides, and of the smallest precinct's.
    block: [u32; 2],
    precinct: [u32; 2],
}

/// A stream whose tiles can be decoded one by one.
#[derive(Debug)]
pub(crate) struct Stream {
    /// Far and near corner of the image on the reference grid, size of a tile and the corner of the first.
    far: [u32; 2],
    near: [u32; 2],
    tile: [u32; 2],
    first: [u32; 2],
    /// Bytes that describe the channels.
    channels: Vec<u8>,
    /// Segments of the main header but for the size.
    header: Vec<u8>,
    /// In the order of tiles.
    parts: Vec<Part>,
    block_bytes: f64,
    longest: u64,
}

fn half(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 2).map_or(0, |b| u32::from(u16::from_be_bytes([b[0], b[1]])))
}

fn word(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).map_or(0, |b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]))
}

impl Style {
    /// Of the segment of a style, from behind its length: of all channels, or of one.
    fn read(segment: &[u8], of_one: bool) -> Option<Self> {
        let (flags, layers, at) = if of_one {
            // Of up to 256 channels the number is a byte.
            (*segment.get(1)?, 1, 2)
        } else {
            (*segment.first()?, half(segment, 2).max(1), 5)
        };
        let levels = u32::from(*segment.get(at)?);
        let block = [*segment.get(at + 1)?, *segment.get(at + 2)?].map(|side| u32::from(side & 15) + 2);
        let mut precinct = [15; 2];
        if flags & 1 == 1 {
            for (level, byte) in segment.get(at + 5..)?.iter().take(levels as usize + 1).enumerate() {
                // But for the coarsest level the precinct is halved in each of three bands.
                let halved = u32::from(level > 0);
                let sides = [u32::from(byte & 15), u32::from(byte >> 4)];
                precinct = [0, 1].map(|i| precinct[i].min(sides[i].saturating_sub(halved)));
            }
        }
        let block = [0, 1].map(|i| block[i].min(precinct[i]));
        Some(Self { layers: u64::from(layers), block, precinct })
    }

    /// Memory of a decoder a sample of a tile, beside the samples.
    fn bytes_a_sample(&self) -> f64 {
        let area = |sides: [u32; 2]| f64::from(1u32 << (sides[0] + sides[1]).min(30));
        let block = (BLOCK_BYTES + LAYER_BYTES * self.layers) as f64;
        // A third more for the coarser levels, and as much again for blocks that are cut at the rims of small bands.
        2.7 * (block / area(self.block) + BLOCK_BYTES as f64 / area(self.precinct))
    }
}

impl Stream {
    /// Reads the main header of the stream of `length` bytes that lies at `at`, and where its tiles are.
    pub(crate) fn read(source: Source<'_>, at: u64, length: u64) -> Result<Self, Trouble> {
        let end = at.saturating_add(length);
        let mut this = Self {
            far: [0; 2],
            near: [0; 2],
            tile: [0; 2],
            first: [0; 2],
            channels: Vec::new(),
            header: Vec::new(),
            parts: Vec::new(),
            block_bytes: 0.0,
            longest: 0,
        };
        if source.array::<4>(at)? != *START {
            return Err(damaged("it does not begin as a JPEG 2000 stream does"));
        }
        let mut place = at + 2;
        loop {
            let head: [u8; 4] = source.array(place)?;
            let (marker, segment) = (half(&head, 0) as u16, half(&head, 2) as usize);
            if marker == TILE_PART {
                break;
            }
            if segment < 2 || this.header.len() + segment > MAX_HEADER_BYTES {
                return Err(damaged("its header has no end"));
            }
            let bytes = source.vec(place, segment + 2)?;
            place += segment as u64 + 2;
            match marker {
                SIZE => this.size(&bytes)?,
                PACKED_HEADERS => {
                    return Err(Trouble::Unsupported("the headers of its packets lie before its tiles"));
                }
                // What counts tiles, comments, and where parts are: not so of one tile.
                0xff55 | 0xff57 | 0xff63 | 0xff64 => {}
                _ => {
                    this.style(marker, &bytes[4..])?;
                    this.header.extend(bytes);
                }
            }
        }
        if this.channels.is_empty() {
            return Err(damaged("its header says no size"));
        }
        this.find_parts(source, place, end)?;
        Ok(this)
    }

    fn size(&mut self, bytes: &[u8]) -> Result<(), Trouble> {
        let pair = |at: usize| [word(bytes, at), word(bytes, at + 4)];
        (self.far, self.near, self.tile, self.first) = (pair(6), pair(14), pair(22), pair(30));
        let channels = half(bytes, 38) as usize;
        let specified = bytes.get(40..40 + 3 * channels).unwrap_or_default();
        let is_sound = (0..2).all(|i| {
            self.near[i] < self.far[i]
                && self.first[i] <= self.near[i]
                && self.tile[i] > 0
                && u64::from(self.first[i]) + u64::from(self.tile[i]) > u64::from(self.near[i])
                && self.far[i] <= i32::MAX as u32
        });
        if !is_sound || channels == 0 || specified.is_empty() {
            return Err(damaged("its header declares a size that makes no picture"));
        }
        if channels > 64 {
            return Err(Trouble::Unsupported("it has more than 64 channels"));
        }
        self.channels = specified.to_vec();
        let [across, down] = self.tiles().map(u64::from);
        if across * down > MAX_TILES {
            return Err(damaged("it declares more tiles than a picture can have"));
        }
        Ok(())
    }

    fn style(&mut self, marker: u16, segment: &[u8]) -> Result<(), Trouble> {
        if !matches!(marker, STYLE | STYLE_OF_CHANNEL) {
            return Ok(());
        }
        let style = Style::read(segment, marker == STYLE_OF_CHANNEL);
        let style = style.ok_or_else(|| damaged("its header is damaged"))?;
        self.block_bytes = self.block_bytes.max(style.bytes_a_sample());
        Ok(())
    }

    fn find_parts(&mut self, source: Source<'_>, mut place: u64, end: u64) -> Result<(), Trouble> {
        let [across, down] = self.tiles();
        while place.saturating_add(12) <= end {
            let head: [u8; 12] = source.array(place)?;
            if half(&head, 0) as u16 != TILE_PART {
                break;
            }
            let (tile, length) = (half(&head, 4), u64::from(word(&head, 6)));
            // A length of zero is the rest of the stream, up to its end mark.
            let length = if length == 0 { end - place } else { length };
            if tile >= across * down || length < 14 || place.saturating_add(length) > end {
                return Err(damaged("a part of a tile lies outside of the stream, which may be cut short"));
            }
            if self.parts.len() == MAX_PARTS {
                return Err(Trouble::Unsupported("its tiles are cut into more than a million parts"));
            }
            self.parts.push(Part { tile, at: place, length });
            place += length;
        }
        self.parts.sort_by_key(|part| part.tile);
        let mut lengths = vec![0u64; (across * down) as usize];
        self.parts.iter().for_each(|part| lengths[part.tile as usize] += part.length);
        if let Some(missing) = lengths.iter().position(|length| *length == 0) {
            return Err(Trouble::Damaged(format!(
                "tile {missing} of {} is missing; the file may be cut short",
                lengths.len()
            )));
        }
        self.longest = lengths.into_iter().max().unwrap_or(0);
        Ok(())
    }

    /// Columns and rows of the picture.
    pub(crate) fn texels(&self) -> [u32; 2] {
        [0, 1].map(|i| self.far[i] - self.near[i])
    }

    /// Tiles across and down.
    pub(crate) fn tiles(&self) -> [u32; 2] {
        [0, 1].map(|i| (self.far[i] - self.first[i]).div_ceil(self.tile[i]))
    }

    /// Near and far corner of a tile on the reference grid.
    fn corners(&self, tile: u32) -> [[u32; 2]; 2] {
        let across = self.tiles()[0];
        let number = [tile % across, tile / across];
        let low = [0, 1].map(|i| self.first[i] + number[i] * self.tile[i]);
        // The last may reach beyond what 32 bits hold.
        let high = [0, 1].map(|i| low[i].saturating_add(self.tile[i]).min(self.far[i]));
        [[0, 1].map(|i| low[i].max(self.near[i])), high]
    }

    /// Columns and rows of a tile.
    pub(crate) fn tile_size(&self, tile: u32) -> [u32; 2] {
        let [near, far] = self.corners(tile);
        [far[0] - near[0], far[1] - near[1]]
    }

    /// Column and row of the picture where a tile begins.
    pub(crate) fn tile_at(&self, tile: u32) -> [u32; 2] {
        let [near, _] = self.corners(tile);
        [near[0] - self.near[0], near[1] - self.near[1]]
    }

    /// Channels in the stream.
    pub(crate) fn channels(&self) -> usize {
        self.channels.len() / 3
    }

    /// Whether a channel has a sign.
    pub(crate) fn is_signed(&self) -> bool {
        (0..self.channels()).any(|channel| self.has_sign(channel))
    }

    /// Whether this channel has a sign.
    pub(crate) fn has_sign(&self, channel: usize) -> bool {
        self.channels.get(3 * channel).is_some_and(|bits| bits & 0x80 != 0)
    }

    /// Bits of the widest channel.
    pub(crate) fn bits(&self) -> u8 {
        self.channels.chunks_exact(3).map(|channel| (channel[0] & 0x7f) + 1).max().unwrap_or(8)
    }

    /// Bits of a channel, if there is such a one.
    pub(super) fn bits_of(&self, channel: usize) -> Option<u8> {
        self.channels.get(3 * channel).map(|bits| (bits & 0x7f) + 1)
    }

    /// Texels of the largest tile.
    pub(crate) fn largest_tile(&self) -> u64 {
        let texels = self.texels();
        [0, 1].map(|i| u64::from(self.tile[i].min(texels[i]))).iter().product()
    }

    /// Memory that decoding the largest tile takes at most: its stream twice and the header with it, samples of all channels in the decoder and here, and what the decoder works with.
    pub(crate) fn tile_bytes(&self) -> u64 {
        self.tile_bytes_of(self.channels())
    }

    /// As [`Self::tile_bytes`], where a palette makes so many channels.
    pub(super) fn tile_bytes_of(&self, made: usize) -> u64 {
        let texels = self.largest_tile();
        let channels = self.channels() as u64;
        // Those of the stream are kept until those of the palette are made.
        let own = if made == self.channels() { 0 } else { channels };
        let samples = texels.saturating_mul(4 * (2 * (made as u64).max(channels) + own + 4));
        let blocks = (texels as f64 * channels as f64 * self.block_bytes) as u64;
        samples
            .saturating_add(blocks)
            .saturating_add(2 * self.longest + 3 * self.header.len() as u64 + (1 << 16))
    }

    /// The stream of one tile.
    pub(super) fn cut(&self, source: Source<'_>, tile: u32) -> Result<Vec<u8>, Trouble> {
        let [near, far] = self.corners(tile);
        let across = self.tiles()[0];
        let first = [tile % across, tile / across];
        let first = [0, 1].map(|i| self.first[i] + first[i] * self.tile[i]);
        let mut bytes = START.to_vec();
        bytes.extend((38 + self.channels.len() as u16).to_be_bytes());
        bytes.extend([0, 0]);
        for pair in [far, near, self.tile, first] {
            pair.iter().for_each(|number| bytes.extend(number.to_be_bytes()));
        }
        bytes.extend((self.channels.len() as u16 / 3).to_be_bytes());
        bytes.extend(&self.channels);
        bytes.extend(&self.header);
        let from = self.parts.partition_point(|part| part.tile < tile);
        for part in self.parts[from..].iter().take_while(|part| part.tile == tile) {
            let start = bytes.len();
            bytes.extend(source.vec(part.at, part.length as usize)?);
            // It is the first tile here, and its length is stated.
            bytes[start + 4..start + 6].fill(0);
            let mut length = part.length;
            if word(&bytes, start + 6) == 0 && bytes.ends_with(&END.to_be_bytes()) {
                bytes.truncate(bytes.len() - 2);
                length -= 2;
            }
            let length = u32::try_from(length).map_err(|_| damaged("a part of a tile is too long"))?;
            bytes[start + 6..start + 10].copy_from_slice(&length.to_be_bytes());
            self.check_part(&bytes[start..])?;
        }
        bytes.extend(END.to_be_bytes());
        Ok(bytes)
    }

    /// That the header of a part of a tile asks for no more memory than the main header does.
    fn check_part(&self, part: &[u8]) -> Result<(), Trouble> {
        let mut at = 12;
        while half(part, at) as u16 != DATA {
            let (marker, length) = (half(part, at) as u16, half(part, at + 2) as usize);
            let segment = part.get(at + 4..at + 2 + length.max(2));
            let segment = segment.ok_or_else(|| damaged("the header of a tile has no end"))?;
            if matches!(marker, STYLE | STYLE_OF_CHANNEL) {
                let style = Style::read(segment, marker == STYLE_OF_CHANNEL);
                let style = style.ok_or_else(|| damaged("the header of a tile is damaged"))?;
                if style.bytes_a_sample() > self.block_bytes {
                    return Err(Trouble::Unsupported(
                        "a tile is cut into smaller blocks than the header says",
                    ));
                }
            }
            at += 2 + length.max(2);
        }
        Ok(())
    }
}
