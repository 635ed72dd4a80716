//! A terrain file of a large square that has no pages.

use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::testing::{Counts, reseal, seeds};

/// A square of so many samples a side in records of the kind that the seed of this name has, all of them absent: three pages and a root of zeros. Also, how many leaves, or nodes, the root lists.
pub fn absent_square(seed: &str, side: u32) -> (Vec<u8>, usize) {
    let mut bytes = seeds().into_iter().find(|known| known.name == seed).unwrap().files.terrain;
    bytes.truncate(3 * PAGE_BYTES);
    let per_page = (PAGE_BYTES >> 1 >> bytes[0x011]) as u64;
    let k = (side - 1).ilog2();
    let records = 4 + 5 * ((1u64 << (2 * k)) - 1) / 3;
    let leaves = records.div_ceil(per_page).div_ceil(if k > 17 { 65_536 } else { 256 }) as usize;
    bytes.resize(3 * PAGE_BYTES + (16 * leaves).next_multiple_of(PAGE_BYTES), 0);
    let length = bytes.len() as u64;
    for at in [0x014, 0x018] {
        bytes[at..at + 4].copy_from_slice(&side.to_le_bytes());
    }
    bytes[0x078..0x07c].copy_from_slice(&3u32.to_le_bytes());
    bytes[0x088..0x090].copy_from_slice(&length.to_le_bytes());
    reseal(&mut bytes, Counts::Settle);
    (bytes, leaves)
}
