//! JPEG 2000 (ISO/IEC 15444-1), tile by tile: a tile with the headers it needs is a small picture of its own, which hayro-jpeg2000 decodes.
//!
//! [`boxes`] finds the stream in a JP2 file, [`header`] what its channels mean, [`stream`] where each tile lies in it, [`place`] what is said of the ground. Coordinates of a stream are absolute: a header whose image is cut to one tile describes exactly that
//! tile. So memory is for tiles at work, not for the picture, and tiles are decoded in parallel. A picture of one tile is decoded as a whole. Every size is
//! checked before memory is taken for it ([`Jp2::tile_bytes`]).

mod boxes;
mod header;
mod part;
mod place;
mod stream;

pub(crate) use boxes::Jp2;
pub(crate) use header::{Colours, Header};
pub(crate) use stream::Stream;

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};
use std::fs::File;
use terrasoar_layout::file::disk::read_at;

/// Why there is no picture.
#[derive(Debug)]
pub(crate) enum Trouble {
    Io(std::io::Error),
    Damaged(String),
    Unsupported(&'static str),
}

impl From<std::io::Error> for Trouble {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => damaged("it is cut short"),
            _ => Self::Io(error),
        }
    }
}

fn damaged(problem: &str) -> Trouble {
    Trouble::Damaged(problem.to_owned())
}

/// Where the bytes are.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Source<'a> {
    File(&'a File),
    Memory(&'a [u8]),
}

impl Source<'_> {
    fn read(self, at: u64, bytes: &mut [u8]) -> std::io::Result<()> {
        match self {
            Self::File(file) => read_at(file, bytes, at),
            Self::Memory(all) => {
                let from = usize::try_from(at).ok().and_then(|at| all.get(at..at.checked_add(bytes.len())?));
                bytes.copy_from_slice(from.ok_or(std::io::ErrorKind::UnexpectedEof)?);
                Ok(())
            }
        }
    }

    fn array<const N: usize>(self, at: u64) -> std::io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.read(at, &mut bytes)?;
        Ok(bytes)
    }

    fn vec(self, at: u64, length: usize) -> std::io::Result<Vec<u8>> {
        let mut bytes = vec![0; length];
        self.read(at, &mut bytes)?;
        Ok(bytes)
    }
}

/// A channel of a tile: as many samples as the tile has texels, and how many bits they are of.
pub(crate) type Channel = (Vec<f32>, u8);

/// Whether a file of these first bytes is JPEG 2000, in a JP2 file or bare.
pub(crate) fn is_jpeg2000(head: &[u8]) -> bool {
    head.starts_with(boxes::SIGNATURE) || head.starts_with(stream::START)
}

/// Decodes a tile: its channels as they stand in the file, or as a palette makes them. `header` is that of a JP2 file.
pub(crate) fn decode_tile(
    source: Source<'_>,
    stream: &Stream,
    tile: u32,
    header: &Header,
) -> Result<Vec<Channel>, Trouble> {
    let cut = stream.cut(source, tile)?;
    let wrapped = if header.bytes.is_empty() { cut } else { boxes::wrap(&header.bytes, &cut) };
    let failed = |_| damaged("its JPEG 2000 stream is damaged, or of a kind that is not read");
    let image = Image::new(&wrapped, &DecodeSettings::default()).map_err(failed)?;
    let wanted = stream.tile_size(tile);
    if [image.width(), image.height()] != wanted {
        return Err(Trouble::Unsupported("its channels are all sampled at another step than its texels"));
    }
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(failed)?;
    let count = wanted[0] as usize * wanted[1] as usize;
    let mut channels: Vec<Channel> = decoded
        .components()
        .iter()
        .enumerate()
        .map(|(place, channel)| {
            let (bits, samples) = (channel.bit_depth(), channel.samples());
            let is_signed = stream.has_sign(header.order.get(place).copied().unwrap_or(place));
            let [low, high] = limits(bits, is_signed);
            // The decoder puts half of the range on all numbers, which the standard does on those without a sign (annex G.1.2).
            let shift = if is_signed { low } else { 0.0 };
            // Rounded and within its bits, whatever a lossy stream makes of it.
            let number = |sample: &f32| (sample + shift).round().clamp(low, high);
            (samples.iter().map(number).collect(), bits)
        })
        .collect();
    if channels.is_empty() || channels.iter().any(|(samples, _)| samples.len() != count) {
        return Err(damaged("a channel has another size than the picture"));
    }
    if !header.order.is_empty() {
        if channels.len() != header.order.len() {
            return Err(damaged("it has another number of channels than its header says"));
        }
        let mut places: Vec<(usize, Channel)> = header.order.iter().copied().zip(channels).collect();
        places.sort_by_key(|(channel, _)| *channel);
        channels = places.into_iter().map(|(_, channel)| channel).collect();
    }
    Ok(channels)
}

/// The smallest and largest number of so many bits.
pub(crate) fn limits(bits: u8, is_signed: bool) -> [f32; 2] {
    let all = (1u64 << bits.min(38)) as f32;
    if is_signed { [-all / 2.0, all / 2.0 - 1.0] } else { [0.0, all - 1.0] }
}
