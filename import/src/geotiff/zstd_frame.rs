//! What a ZSTD stream needs in memory, from its first bytes (RFC 8878, section 3.1.1).
//!
//! A stream looks back over a window of what it has already unpacked, and names the window's size first. Encoders that do not know how much data will come name
//! the largest window of their level, up to 128 MiB, even for a chunk of a few KiB. So a short chunk whose window is larger than itself is unpacked at once, where no window
//! is needed ([`unpack_whole`]); a long one has the window that it asks for, which counts against the memory allowed.

use super::zstd_codec;

/// Bytes at the begin of a chunk that tell its window.
pub(super) const HEAD_BYTES: usize = 18;

/// Magic number of a frame.
const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Window in bytes that the frame that begins with `head` needs; `None` if this is no frame, or the head of one is cut.
pub(super) fn window(head: &[u8]) -> Option<u64> {
    let (descriptor, rest) = head.strip_prefix(&MAGIC)?.split_first()?;
    let is_single_segment = descriptor & 0x20 != 0;
    let id_bytes = [0, 1, 2, 4][usize::from(descriptor & 3)];
    let content_bytes = match descriptor >> 6 {
        0 => usize::from(is_single_segment),
        exponent => 1 << exponent,
    };
    let (window, rest) = if is_single_segment {
        (u64::MAX, rest)
    } else {
        let (byte, rest) = rest.split_first()?;
        let base = 1u64 << (10 + (byte >> 3));
        (base + base / 8 * u64::from(byte & 7), rest)
    };
    let content = rest.get(id_bytes..id_bytes + content_bytes)?;
    let content = match content.len() {
        0 => u64::MAX,
        2 => 256 + u64::from(u16::from_le_bytes([content[0], content[1]])),
        _ => content.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)),
    };
    Some(window.min(content))
}

/// Unpacks the first frame of `packed` without a window, into `unpacked`, which has room for all of it and needs `wanted` bytes.
pub(super) fn unpack_whole(packed: &[u8], unpacked: &mut [u8], wanted: usize) -> Result<(), String> {
    let got =
        zstd_codec::unpack_frame(packed, unpacked).ok_or_else(|| "its ZSTD stream is damaged".to_owned())?;
    if got < wanted {
        return Err(format!("it ends {} bytes too early", wanted - got));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::zstd_frame::{unpack_whole, window};
    use std::io::Write;

    /// As writers of TIFF make them: the level's window, and nothing of the length.
    fn streamed(level: i32, bytes: &[u8]) -> Vec<u8> {
        let mut encoder = zstd::Encoder::new(Vec::new(), level).unwrap();
        encoder.write_all(bytes).unwrap();
        encoder.flush().unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn heads_tell_the_window() {
        let bytes = vec![7u8; 100_000];
        assert_eq!(window(&zstd::bulk::compress(&bytes, 3).unwrap()), Some(100_000));
        assert_eq!(window(&zstd::bulk::compress(&bytes[..300], 3).unwrap()), Some(300));
        assert_eq!(window(&zstd::bulk::compress(&bytes[..9], 3).unwrap()), Some(9));
        assert_eq!(window(&streamed(22, &bytes)), Some(128 << 20));
        assert_eq!(window(&streamed(3, &bytes)), Some(2 << 20));
        assert_eq!([window(b""), window(b"\x28\xb5\x2f\xfd"), window(b"no frame at all...")], [None; 3]);
    }

    #[test]
    fn a_short_chunk_of_a_large_window_needs_none() {
        let bytes: Vec<u8> = (0..30_000u32).map(|i| (i * i / 99) as u8).collect();
        let mut packed = streamed(22, &bytes);
        packed.extend_from_slice(b"left behind");
        let mut unpacked = vec![0; bytes.len()];
        unpack_whole(&packed, &mut unpacked, bytes.len()).unwrap();
        assert_eq!(unpacked, bytes);
        // The last strip of an image is shorter than the others.
        unpacked.resize(50_000, 0);
        unpack_whole(&packed, &mut unpacked, bytes.len()).unwrap();
        assert!(unpack_whole(&packed, &mut unpacked, 30_001).unwrap_err().contains("1 bytes too early"));
        assert!(unpack_whole(&packed[..packed.len() / 2], &mut unpacked, 1).is_err());
    }
}
