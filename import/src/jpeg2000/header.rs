//! The box of headers of a JP2 file (ISO/IEC 15444-1, annex I.5.3): what its channels mean, and a palette.
//!
//! Invariant: outside of this module channels are counted as they stand in the file. The decoder puts them in the order of their colours, and in no order where it does not know a kind; so
//! it is given a box of kinds ("cdef") that is made here, which it knows, and its order is undone. Cost: a pass over the boxes, and a copy of them.

use super::part::next;
use super::{Source, Stream, Trouble, damaged};

/// Colours of a palette, at most (table I.13 of the standard).
const MAX_COLOURS: usize = 1024;
/// Channels that a palette makes, at most; a stream has as many.
const MAX_CHANNELS: usize = 64;
/// Memory of a colour of a palette in the decoder, beside 8 bytes a channel.
const COLOUR_BYTES: u64 = 64;

/// What channels mean.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Colours {
    Grey,
    Rgb,
    Cmyk,
    /// The file does not say.
    #[default]
    Unknown,
}

/// What a JP2 file says of its channels; of a bare stream nothing.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// The box as the decoder is given it; empty in a bare stream.
    pub(super) bytes: Vec<u8>,
    pub(crate) colours: Colours,
    /// Channels in the order in which the decoder gives them: colours, and then others. Empty if it is that of the file.
    pub(super) order: Vec<usize>,
    pub(crate) alpha: Option<usize>,
    /// Channels that a palette makes, if there is one.
    pub(crate) palette: Option<usize>,
    /// Colours of the palette.
    entries: u64,
}

impl Header {
    /// Of the content of the box of headers, in front of `stream`.
    pub(super) fn read(content: &[u8], stream: &Stream) -> Result<Self, Trouble> {
        let mut this = Self::default();
        let (mut kinds, mut map) = (None, None);
        let source = Source::Memory(content);
        let end = content.len() as u64;
        let mut kept = Vec::with_capacity(content.len() + 64);
        let mut at = 0;
        while at + 8 <= end {
            let found = next(source, at, end)?;
            let inside = &content[found.at as usize..found.end as usize];
            match &found.kind {
                // Of several systems the first that is known by a number counts.
                b"colr" if this.colours == Colours::Unknown && inside.first() == Some(&1) => {
                    this.colours = match inside.get(3..7) {
                        Some([0, 0, 0, 12 | 13]) => Colours::Cmyk,
                        Some([0, 0, 0, 17]) => Colours::Grey,
                        Some([0, 0, 0, 16 | 18 | 20]) => Colours::Rgb,
                        Some([0, 0, 0, 14 | 19]) => {
                            return Err(Trouble::Unsupported("its colours are in CIE Lab"));
                        }
                        _ => Colours::Unknown,
                    };
                }
                b"pclr" => this.read_palette(inside)?,
                b"cmap" => map = Some(inside),
                b"cdef" if kinds.is_none() => kinds = Some(inside),
                _ => {}
            }
            if &found.kind != b"cdef" {
                kept.extend(((inside.len() + 8) as u32).to_be_bytes());
                kept.extend(found.kind);
                kept.extend(inside);
            }
            at = found.end.max(at + 8);
        }
        if this.palette.is_some() && stream.is_signed() {
            return Err(Trouble::Unsupported("the places in its palette have signs"));
        }
        if let (Some(columns), Some(map)) = (this.palette, map) {
            this.palette = Some(mapped(map, columns, stream)?);
        }
        if let Some(kinds) = kinds {
            this.put_in_order(kinds, this.palette.unwrap_or(stream.channels()));
            kept.extend(this.kinds());
        }
        this.bytes.reserve_exact(kept.len() + 8);
        this.bytes.extend(((kept.len() + 8) as u32).to_be_bytes());
        this.bytes.extend(b"jp2h");
        this.bytes.extend(kept);
        Ok(this)
    }

    /// What the decoder would pass over, or show wrongly, is refused.
    fn read_palette(&mut self, content: &[u8]) -> Result<(), Trouble> {
        let broken = || damaged("its palette is damaged");
        let [high, low, columns, rest @ ..] = content else { return Err(broken()) };
        let (entries, columns) = (usize::from(u16::from_be_bytes([*high, *low])), usize::from(*columns));
        let depths = rest.get(..columns).ok_or_else(broken)?;
        if depths.iter().any(|bits| bits & 0x7f >= 8) {
            return Err(Trouble::Unsupported("its palette is of colours of more than 8 bits a channel"));
        }
        if depths.iter().any(|bits| bits & 0x80 != 0) {
            return Err(Trouble::Unsupported("its palette is of signed numbers"));
        }
        if columns > MAX_CHANNELS {
            return Err(Trouble::Unsupported("its palette makes more than 64 channels"));
        }
        if entries > MAX_COLOURS || entries * columns == 0 || rest.len() < columns + entries * columns {
            return Err(broken());
        }
        (self.palette, self.entries) = (Some(columns), entries as u64);
        Ok(())
    }

    /// Finds which channel is which colour, and alpha, of `count` channels.
    fn put_in_order(&mut self, content: &[u8], count: usize) {
        let number = |bytes: &[u8]| u16::from_be_bytes([bytes[0], bytes[1]]);
        // A channel that is not spoken of is a colour in its turn.
        let mut said: Vec<[u16; 2]> = (1..=count as u16).map(|colour| [0, colour]).collect();
        // Number, kind and colour of each channel.
        for channel in content.get(2..).unwrap_or_default().chunks_exact(6).rev() {
            if let Some(said) = said.get_mut(usize::from(number(channel))) {
                *said = [number(&channel[2..]), number(&channel[4..])];
            }
        }
        let mut alphas = (0..count).filter(|channel| matches!(said[*channel][0], 1 | 2));
        self.alpha = alphas.next().filter(|_| alphas.next().is_none());
        self.order = (0..count).collect();
        self.order.sort_by_key(|channel| match said[*channel] {
            // A colour of none, or of the whole picture, comes behind those that have a number.
            [0, colour] => (0, colour.wrapping_sub(1).min(u16::MAX - 1)),
            _ => (1, 0),
        });
    }

    /// A box of kinds that puts channels in the order of this one: all are colours of numbers.
    fn kinds(&self) -> Vec<u8> {
        let mut bytes = ((10 + 6 * self.order.len()) as u32).to_be_bytes().to_vec();
        bytes.extend(b"cdef");
        bytes.extend((self.order.len() as u16).to_be_bytes());
        for (place, channel) in (1u16..).zip(&self.order) {
            bytes.extend([*channel as u16, 0, place].into_iter().flat_map(u16::to_be_bytes));
        }
        bytes
    }

    /// Of `count` channels colours in their order, and then others.
    pub(crate) fn in_order(&self, count: usize) -> impl Iterator<Item = usize> {
        let order: Vec<usize> = if self.order.is_empty() { (0..count).collect() } else { self.order.clone() };
        order.into_iter()
    }

    /// Memory that a decoder takes for the headers: the box in a file of its own, its profile several times, and its palette twice.
    pub(super) fn bytes(&self) -> u64 {
        let palette = self.entries * (COLOUR_BYTES + 8 * self.palette.unwrap_or(0) as u64);
        5 * self.bytes.len() as u64 + 2 * palette
    }
}

/// How many channels a map of channels makes of a stream's and of the columns of a palette.
fn mapped(map: &[u8], columns: usize, stream: &Stream) -> Result<usize, Trouble> {
    let channels = map.chunks_exact(4);
    let count = channels.len();
    if count == 0 || count > MAX_CHANNELS || !channels.remainder().is_empty() {
        return Err(damaged("the channels of its palette are damaged"));
    }
    for channel in channels {
        let bits = stream.bits_of(usize::from(u16::from_be_bytes([channel[0], channel[1]])));
        let bits = bits.filter(|_| channel[2] == 0 || usize::from(channel[3]) < columns);
        let bits = bits.ok_or_else(|| damaged("its palette has fewer channels than are asked of it"))?;
        if channel[2] == 0 && bits > 8 {
            return Err(Trouble::Unsupported("a channel beside its palette is of more than 8 bits"));
        }
    }
    Ok(count)
}
