//! Bytes packed as TIFF packs them.

use super::tiff::{DEFLATE, LZW, PACK_BITS, ZSTD};

/// The bytes packed as TIFF packs them.
pub(crate) fn packed(compression: u16, bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    match compression {
        DEFLATE => {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::new(6));
            encoder.write_all(bytes).unwrap();
            encoder.finish().unwrap()
        }
        LZW => weezl::encode::Encoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8).encode(bytes).unwrap(),
        ZSTD => zstd::bulk::compress(bytes, 3).unwrap(),
        // Runs of 128 equal bytes, or as many as there are.
        PACK_BITS => bytes
            .chunk_by(|a, b| a == b)
            .flat_map(|run| run.chunks(128))
            .flat_map(|run| match run.len() {
                1 => [0, run[0]],
                length => [(1i32 - length as i32) as u8, run[0]],
            })
            .collect(),
        _ => bytes.to_vec(),
    }
}
