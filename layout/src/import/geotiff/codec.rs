//! Unpacks a chunk: LZW, DEFLATE, ZSTD and PackBits, from bytes in memory to bytes in memory.
//!
//! A chunk must yield at least the bytes asked for; what it holds beyond them (rows below the image, a
//! missing end code) does not matter, as writers differ in both. The `tiff` crate (0.11.3) is not used: it
//! refuses sound LZW tiles at the right edge ("no lzw end code found" in `int16-tiles-lzw-p2.tif` of the
//! fixtures), and inverts "white is zero" heights. Cost: the codec's.

use std::io::Read;

use flate2::{Decompress, FlushDecompress, Status};
use weezl::{BitOrder, LzwStatus};

use super::chunks::Compression;

/// Fills `unpacked` from `packed`; an error says what is wrong with the bytes.
pub(super) fn unpack(compression: Compression, packed: &[u8], unpacked: &mut [u8]) -> Result<(), String> {
    let wanted = unpacked.len();
    let got = match compression {
        Compression::None => copy(packed, unpacked),
        Compression::Deflate => inflate(packed, unpacked)?,
        Compression::Lzw => lzw(packed, unpacked)?,
        Compression::Zstd => zstd(packed, unpacked)?,
        Compression::PackBits => pack_bits(packed, unpacked),
    };
    if got < wanted {
        return Err(format!("it unpacks to {got} bytes where {wanted} are needed"));
    }
    Ok(())
}

fn copy(packed: &[u8], unpacked: &mut [u8]) -> usize {
    let length = packed.len().min(unpacked.len());
    unpacked[..length].copy_from_slice(&packed[..length]);
    length
}

fn inflate(packed: &[u8], unpacked: &mut [u8]) -> Result<usize, String> {
    let mut decoder = Decompress::new(true);
    loop {
        // Neither total exceeds its slice's length.
        let (read, written) = (decoder.total_in() as usize, decoder.total_out() as usize);
        if written == unpacked.len() {
            return Ok(written);
        }
        let status = decoder
            .decompress(&packed[read..], &mut unpacked[written..], FlushDecompress::None)
            .map_err(|error| format!("its DEFLATE stream is damaged ({error})"))?;
        let moved = decoder.total_in() as usize > read || decoder.total_out() as usize > written;
        if status == Status::StreamEnd || !moved {
            return Ok(decoder.total_out() as usize);
        }
    }
}

fn lzw(packed: &[u8], unpacked: &mut [u8]) -> Result<usize, String> {
    let mut decoder = weezl::decode::Configuration::with_tiff_size_switch(BitOrder::Msb, 8)
        .with_yield_on_full_buffer(true)
        .build();
    let (mut read, mut written) = (0, 0);
    while written < unpacked.len() {
        let step = decoder.decode_bytes(&packed[read..], &mut unpacked[written..]);
        read += step.consumed_in;
        written += step.consumed_out;
        match step.status {
            Ok(LzwStatus::Ok) => {}
            Ok(LzwStatus::Done | LzwStatus::NoProgress) => break,
            Err(_) => return Err("its LZW stream is damaged".into()),
        }
    }
    Ok(written)
}

fn zstd(packed: &[u8], unpacked: &mut [u8]) -> Result<usize, String> {
    let damaged = |error: std::io::Error| format!("its ZSTD stream is damaged ({error})");
    let mut decoder = zstd::stream::read::Decoder::with_buffer(packed).map_err(damaged)?;
    let mut written = 0;
    while written < unpacked.len() {
        match decoder.read(&mut unpacked[written..]) {
            Ok(0) => break,
            Ok(count) => written += count,
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => break,
            Err(error) => return Err(damaged(error)),
        }
    }
    Ok(written)
}

/// Runs of a count byte: 0..127 so many and one literal bytes, -1..-127 one byte so many times and one.
fn pack_bits(packed: &[u8], unpacked: &mut [u8]) -> usize {
    let (mut read, mut written) = (0, 0);
    while written < unpacked.len() {
        let Some(count) = packed.get(read) else { break };
        let count = *count as i8;
        read += 1;
        let room = unpacked.len() - written;
        if count >= 0 {
            let rest = &packed[read..];
            let length = (count as usize + 1).min(room).min(rest.len());
            unpacked[written..written + length].copy_from_slice(&rest[..length]);
            read += length;
            written += length;
            if length == 0 {
                break;
            }
        } else if count != i8::MIN {
            let Some(byte) = packed.get(read) else { break };
            let length = (1 + usize::from(count.unsigned_abs())).min(room);
            unpacked[written..written + length].fill(*byte);
            read += 1;
            written += length;
        }
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pack_bits_of_the_specification() {
        // The example of Apple's technical note 1023.
        let packed =
            [0xfe, 0xaa, 0x02, 0x80, 0x00, 0x2a, 0xfd, 0xaa, 0x03, 0x80, 0x00, 0x2a, 0x22, 0xf7, 0xaa];
        let mut unpacked = [0; 24];
        unpack(Compression::PackBits, &packed, &mut unpacked).unwrap();
        assert_eq!(unpacked[..10], [0xaa, 0xaa, 0xaa, 0x80, 0, 0x2a, 0xaa, 0xaa, 0xaa, 0xaa]);
        assert_eq!(unpacked[14..], [0xaa; 10]);
        let error = unpack(Compression::PackBits, &packed[..9], &mut unpacked).unwrap_err();
        assert!(error.contains("10 bytes where 24"), "{error}");
    }

    #[test]
    fn streams_cut_short_say_so() {
        for compression in [Compression::Deflate, Compression::Lzw, Compression::Zstd, Compression::None] {
            for packed in [&[][..], &[0x78], &[0x28, 0xb5, 0x2f, 0xfd]] {
                assert!(unpack(compression, packed, &mut [0; 100]).is_err(), "{compression:?} {packed:?}");
            }
        }
    }
}
