//! Unpacks a chunk: LZW, DEFLATE, ZSTD and PackBits, a few rows at a time.
//!
//! A chunk must yield at least the bytes asked for. What it holds beyond them (rows below the image) does not matter, nor does a
//! missing end code, because writers differ in both. An [`Unpacker`] reads and writes piece by piece. So its memory does not depend on how long a
//! chunk is: it holds the codec's own state, and for ZSTD a window ([`super::zstd_frame`]). The `tiff` crate (0.11.3) is not used: it
//! refuses sound LZW tiles at the right edge ("no lzw end code found" in `int16-tiles-lzw-p2.tif` of the
//! fixtures), and inverts "white is zero" heights. Cost: the codec's.

use std::io::BufRead;

use flate2::{Decompress, FlushDecompress, Status};
use weezl::{BitOrder, LzwStatus};

use super::chunks::Compression;
use super::failure::{Failure, damaged};
use super::zstd_codec;
use super::zstd_frame;

/// A chunk on its way from `input`, which ends where the chunk does.
pub(super) struct Unpacker<R> {
    input: R,
    state: State,
}

enum State {
    Copy,
    Deflate(Box<Decompress>),
    Lzw(Box<weezl::decode::Decoder>),
    Zstd(Box<zstd_codec::Stream>),
    PackBits(Run),
}

/// Where a stream of PackBits stands.
#[derive(Debug, Clone, Copy)]
enum Run {
    /// A count comes next.
    Count,
    /// So many bytes follow as they are.
    Bytes(usize),
    /// The byte that is repeated so many times comes next.
    Byte(usize),
    /// A byte is repeated so many times more.
    Repeated(u8, usize),
}

impl<R: BufRead> Unpacker<R> {
    /// Begins a chunk; a stream of ZSTD that needs a window of more than `window` bytes is refused as damaged.
    pub(super) fn new(compression: Compression, input: R, window: u64) -> Result<Self, Failure> {
        let state = match compression {
            Compression::None => State::Copy,
            Compression::Deflate => State::Deflate(Box::new(Decompress::new(true))),
            Compression::Lzw => State::Lzw(Box::new(
                weezl::decode::Configuration::with_tiff_size_switch(BitOrder::Msb, 8)
                    .with_yield_on_full_buffer(true)
                    .build(),
            )),
            Compression::Zstd => State::Zstd(Box::new(zstd_codec::Stream::new(window)?)),
            Compression::PackBits => State::PackBits(Run::Count),
            Compression::Lerc(_) => return Err(damaged("LERC is not unpacked piece by piece")),
            Compression::JpegXl => return Err(damaged("JPEG XL is not unpacked piece by piece")),
        };
        Ok(Self { input, state })
    }

    /// Fills `unpacked` with the next bytes, all of it.
    pub(super) fn fill(&mut self, unpacked: &mut [u8]) -> Result<(), Failure> {
        let mut written = 0;
        while written < unpacked.len() {
            let (read, wrote, ended) = self.step(&mut unpacked[written..])?;
            self.input.consume(read);
            written += wrote;
            if wrote == 0 && (ended || read == 0) {
                return Err(Failure::Damaged(format!(
                    "it ends {} bytes too early",
                    unpacked.len() - written
                )));
            }
        }
        Ok(())
    }

    /// All that is left, `most` bytes of it at most.
    pub(super) fn rest(&mut self, most: usize) -> Result<Vec<u8>, Failure> {
        let mut unpacked = Vec::new();
        loop {
            let written = unpacked.len();
            if written == most {
                return Err(damaged("it is longer than its samples can be"));
            }
            unpacked.resize(most.min((2 * written).max(1 << 16)), 0);
            let (read, wrote, ended) = self.step(&mut unpacked[written..])?;
            self.input.consume(read);
            unpacked.truncate(written + wrote);
            if ended || (wrote == 0 && read == 0) {
                return Ok(unpacked);
            }
        }
    }

    /// One step of the codec: bytes read and written, and whether the stream has ended.
    fn step(&mut self, unpacked: &mut [u8]) -> Result<(usize, usize, bool), Failure> {
        let Self { input, state } = self;
        let packed = input.fill_buf()?;
        match state {
            State::Copy => {
                let count = packed.len().min(unpacked.len());
                unpacked[..count].copy_from_slice(&packed[..count]);
                Ok((count, count, false))
            }
            State::Deflate(decoder) => {
                let (read, written) = (decoder.total_in(), decoder.total_out());
                let status = decoder
                    .decompress(packed, unpacked, FlushDecompress::None)
                    .map_err(|_| damaged("its DEFLATE stream is damaged"))?;
                // Neither grows by more than a slice's length.
                let (read, written) =
                    ((decoder.total_in() - read) as usize, (decoder.total_out() - written) as usize);
                Ok((read, written, status == Status::StreamEnd))
            }
            State::Lzw(decoder) => {
                let step = decoder.decode_bytes(packed, unpacked);
                match step.status {
                    Ok(status) => {
                        Ok((step.consumed_in, step.consumed_out, matches!(status, LzwStatus::Done)))
                    }
                    Err(_) => Err(damaged("its LZW stream is damaged")),
                }
            }
            // It takes from the input itself.
            State::Zstd(stream) => Ok((0, stream.fill(input, unpacked)?, false)),
            State::PackBits(run) => {
                let (read, written) = pack_bits(run, packed, unpacked);
                Ok((read, written, false))
            }
        }
    }
}

/// All that a stream of ZSTD unpacks to, `most` bytes of it at most; `None` where it is damaged or longer.
pub(crate) fn unpack_zstd(packed: &[u8], most: usize) -> Option<Vec<u8>> {
    Unpacker::new(Compression::Zstd, packed, most as u64).ok()?.rest(most).ok()
}

/// Fills `unpacked` with the first bytes of a chunk that is in memory and unpacks to `whole` bytes.
pub(super) fn unpack(
    compression: Compression,
    packed: &[u8],
    unpacked: &mut [u8],
    whole: usize,
) -> Result<(), Failure> {
    let window = (whole as u64).next_power_of_two().max(1 << 17);
    if compression == Compression::Zstd && zstd_frame::window(packed).is_some_and(|asked| asked > window) {
        let mut all = vec![0; whole.max(unpacked.len())];
        zstd_frame::unpack_whole(packed, &mut all, unpacked.len()).map_err(Failure::Damaged)?;
        unpacked.copy_from_slice(&all[..unpacked.len()]);
        return Ok(());
    }
    Unpacker::new(compression, packed, window)?.fill(unpacked)
}

/// Runs of a count byte: 0..127 so many and one literal bytes, -1..-127 one byte so many times and one. Gives the bytes read and written.
fn pack_bits(run: &mut Run, packed: &[u8], unpacked: &mut [u8]) -> (usize, usize) {
    let (mut read, mut written) = (0, 0);
    while written < unpacked.len() {
        let room = unpacked.len() - written;
        if let Run::Repeated(byte, left) = *run {
            let length = left.min(room);
            unpacked[written..written + length].fill(byte);
            written += length;
            *run = if left > length { Run::Repeated(byte, left - length) } else { Run::Count };
            continue;
        }
        let rest = &packed[read..];
        let Some(first) = rest.first() else { break };
        match *run {
            Run::Count => {
                let count = *first as i8;
                *run = match count {
                    0.. => Run::Bytes(count as usize + 1),
                    i8::MIN => Run::Count,
                    _ => Run::Byte(1 + usize::from(count.unsigned_abs())),
                };
                read += 1;
            }
            Run::Bytes(left) => {
                let length = left.min(room).min(rest.len());
                unpacked[written..written + length].copy_from_slice(&rest[..length]);
                read += length;
                written += length;
                *run = if left > length { Run::Bytes(left - length) } else { Run::Count };
            }
            Run::Byte(times) => {
                *run = Run::Repeated(*first, times);
                read += 1;
            }
            Run::Repeated(..) => {}
        }
    }
    (read, written)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unpacks pieces of `piece` bytes from input that comes in such pieces too.
    fn unpack(
        compression: Compression,
        packed: &[u8],
        unpacked: &mut [u8],
        piece: usize,
    ) -> Result<(), Failure> {
        let mut unpacker =
            Unpacker::new(compression, std::io::BufReader::with_capacity(piece, packed), 1 << 23)?;
        unpacked.chunks_mut(piece).try_for_each(|part| unpacker.fill(part))
    }

    #[test]
    fn pack_bits_of_the_specification() {
        // The example of Apple's technical note 1023.
        let packed =
            [0xfe, 0xaa, 0x02, 0x80, 0x00, 0x2a, 0xfd, 0xaa, 0x03, 0x80, 0x00, 0x2a, 0x22, 0xf7, 0xaa];
        for piece in 1..20 {
            let mut unpacked = [0; 24];
            unpack(Compression::PackBits, &packed, &mut unpacked, piece).unwrap();
            assert_eq!(unpacked[..10], [0xaa, 0xaa, 0xaa, 0x80, 0, 0x2a, 0xaa, 0xaa, 0xaa, 0xaa]);
            assert_eq!(unpacked[14..], [0xaa; 10]);
            let error = unpack(Compression::PackBits, &packed[..9], &mut unpacked, 24).unwrap_err();
            assert!(
                matches!(&error, Failure::Damaged(words) if words.contains("14 bytes too early")),
                "{error:?}"
            );
        }
    }

    #[test]
    fn streams_cut_short_say_so() {
        for compression in [Compression::Deflate, Compression::Lzw, Compression::Zstd, Compression::None] {
            for packed in [&[][..], &[0x78], &[0x28, 0xb5, 0x2f, 0xfd]] {
                for piece in [1, 7, 100] {
                    let failure = unpack(compression, packed, &mut [0; 100], piece).unwrap_err();
                    assert!(matches!(failure, Failure::Damaged(_)), "{compression:?} {packed:?} {failure:?}");
                }
            }
        }
    }

    #[test]
    fn pieces_make_the_whole() {
        let whole: Vec<u8> = (0..50_000u32).map(|i| (i / 7 * (i / 400)) as u8).collect();
        let deflated = {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
            std::io::Write::write_all(&mut encoder, &whole).unwrap();
            encoder.finish().unwrap()
        };
        let lzw = weezl::encode::Encoder::with_tiff_size_switch(BitOrder::Msb, 8).encode(&whole).unwrap();
        let zstd = zstd::encode_all(&whole[..], 3).unwrap();
        for (compression, packed) in
            [(Compression::Deflate, deflated), (Compression::Lzw, lzw), (Compression::Zstd, zstd)]
        {
            for piece in [1, 333, 4096, 1 << 20] {
                let mut unpacked = vec![0; whole.len()];
                unpack(compression, &packed, &mut unpacked, piece).unwrap();
                assert!(unpacked == whole, "{compression:?} {piece}");
                // One byte more than there is.
                unpacked.push(0);
                assert!(
                    unpack(compression, &packed, &mut unpacked, piece).is_err(),
                    "{compression:?} {piece}"
                );
            }
        }
    }
}
