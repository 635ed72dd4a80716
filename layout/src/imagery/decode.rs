//! Tiles as plain RGBA, for devices without block compression and for tests. Blocks are decoded by bcdec_rs.

use super::encode::BlockTexels;
use super::shape::{TILE_TEXELS, TileFormat};

/// The texels of a whole tile as red, green, blue, alpha, a byte each, rows from the south: 1,048,576 bytes. `None` if `tile` has not
/// the length of a tile of the format.
pub fn decode_tile(format: TileFormat, tile: &[u8]) -> Option<Vec<u8>> {
    if tile.len() != format.tile_bytes() {
        return None;
    }
    let decode: fn(&[u8], &mut [u8], usize) = match format {
        TileFormat::Rgba8 => return Some(tile.to_vec()),
        TileFormat::Bc1 => bcdec_rs::bc1,
        TileFormat::Bc7 => bcdec_rs::bc7,
    };
    let pitch = TILE_TEXELS as usize * 4;
    let across = TILE_TEXELS as usize / 4;
    let mut texels = vec![0; TileFormat::Rgba8.tile_bytes()];
    for (i, block) in tile.chunks_exact(format.block_bytes()).enumerate() {
        let at = i / across * 4 * pitch + i % across * 16;
        decode(block, &mut texels[at..], pitch);
    }
    Some(texels)
}

/// The 16 texels of one block as it is stored, rows from the south; of Rgba8 of its 64 bytes.
pub(super) fn decode_block(format: TileFormat, block: &[u8]) -> BlockTexels {
    let mut texels = [[0; 4]; 16];
    match format {
        TileFormat::Rgba8 => texels.as_flattened_mut().copy_from_slice(block),
        TileFormat::Bc1 => bcdec_rs::bc1(block, texels.as_flattened_mut(), 16),
        TileFormat::Bc7 => bcdec_rs::bc7(block, texels.as_flattened_mut(), 16),
    }
    texels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_land_where_they_belong() {
        assert!(decode_tile(TileFormat::Bc1, &[0; 8]).is_none());
        let mut tile = vec![0; TileFormat::Bc1.tile_bytes()];
        // Block 5, 2: red where the index is 0 and transparent where it is 3, in the block's first row.
        let at = (2 * 128 + 5) * 8;
        tile[at..at + 8].copy_from_slice(&[0x00, 0xf8, 0x00, 0xf8, 0b1100_1100, 0, 0, 0]);
        let texels = decode_tile(TileFormat::Bc1, &tile).unwrap();
        let texel = |x: usize, y: usize| &texels[(y * 512 + x) * 4..][..4];
        assert_eq!(texel(20, 8), [255, 0, 0, 255]);
        assert_eq!(texel(21, 8), [0, 0, 0, 0]);
        assert_eq!(texel(21, 9), [255, 0, 0, 255]);
        assert_eq!(texel(24, 8), [0, 0, 0, 255]);
    }
}
