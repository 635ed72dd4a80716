//! One tile in memory as it is stored, and which of its blocks differ from the picture before all paint.
//!
//! Its bytes may be shared with code that shows them. A tile that is painted while its bytes are shared is copied first.

use super::super::encode::{BlockTexels, encode_blocks, is_transparent};
use super::super::linear::TABLES;
use super::super::shape::{BORDER_TEXELS, ImageryShape, TILE_TEXELS, TileFormat, TileId};
use super::super::{decode, reader};
use std::sync::Arc;

/// Blocks a side of a whole tile.
const SIDE_BLOCKS: usize = (TILE_TEXELS / 4) as usize;

/// Bytes of one block; of Rgba8 of its 16 texels.
pub(super) type BlockBytes = [u8; 64];

/// A tile as it is after painting, apart from its painter: any thread may make texels of it.
#[derive(Debug, Clone)]
pub struct PaintedTile {
    format: TileFormat,
    stored: [u32; 2],
    bytes: Option<Arc<Vec<u8>>>,
}

impl PaintedTile {
    /// Fills `texels` as [`Imagery::read_tile`](super::super::Imagery::read_tile) does; false if nothing of the tile would be seen.
    pub fn read(&self, texels: &mut Vec<u8>) -> bool {
        texels.clear();
        let Some(bytes) = &self.bytes else { return false };
        texels.reserve(self.format.tile_bytes());
        texels.extend_from_slice(bytes);
        reader::widen(self.format, self.stored, texels);
        true
    }
}

/// A tile in a painter.
#[derive(Debug, Clone)]
pub(super) struct Tile {
    format: TileFormat,
    /// Texels stored a side.
    stored: [u32; 2],
    /// None while the tile is absent.
    bytes: Option<Arc<Vec<u8>>>,
    /// One bit a block that differs from the picture before all paint; none in it while empty.
    differing: Vec<u64>,
    pub(super) differing_count: u32,
    /// Whether it was painted since its bytes were last given away to be written.
    pub(super) is_painted: bool,
    /// Whether bytes were given away that are not known to be in the file.
    pub(super) is_unwritten: bool,
    /// When it was last of use.
    pub(super) last_used: u64,
    /// Number of the batch that changed it last.
    pub(super) changed_in: u64,
}

impl Tile {
    pub(super) fn new(shape: &ImageryShape, id: TileId, bytes: Option<Vec<u8>>) -> Self {
        Self {
            format: shape.format,
            stored: shape.stored_texels(id),
            bytes: bytes.map(Arc::new),
            differing: Vec::new(),
            differing_count: 0,
            is_painted: false,
            is_unwritten: false,
            last_used: 0,
            changed_in: 0,
        }
    }

    /// Notes which blocks differ from those of the tile before all paint.
    pub(super) fn compare(&mut self, original: Option<&[u8]>) {
        let [across, up] = self.stored.map(|side| side as i32 / 4);
        for place in (0..up).flat_map(|y| (0..across).map(move |x| [x, y])) {
            if self.block(place) != self.block_of(original, place) {
                self.mark(place, true);
            }
        }
    }

    pub(super) fn shared(&self) -> PaintedTile {
        PaintedTile { format: self.format, stored: self.stored, bytes: self.bytes.clone() }
    }

    pub(super) fn bytes(&self) -> Option<&Arc<Vec<u8>>> {
        self.bytes.as_ref()
    }

    /// The bytes of a block.
    pub(super) fn block(&self, place: [i32; 2]) -> BlockBytes {
        self.block_of(self.bytes.as_ref().map(|bytes| &bytes[..]), place)
    }

    /// The bytes of a block of another tile of the same shape.
    pub(super) fn block_of(&self, bytes: Option<&[u8]>, place: [i32; 2]) -> BlockBytes {
        let mut block = [0; 64];
        match bytes {
            None => block = transparent(self.format),
            Some(bytes) => {
                for (at, part) in self.parts(place) {
                    block[part.clone()].copy_from_slice(&bytes[at..at + part.len()]);
                }
            }
        }
        block
    }

    /// The texels of a block.
    pub(super) fn texels(&self, place: [i32; 2]) -> BlockTexels {
        if self.bytes.is_none() {
            return [[0; 4]; 16];
        }
        decode::decode_block(self.format, &self.block(place)[..self.format.block_bytes()])
    }

    /// Puts bytes into a block, which differs from the picture before all paint or not.
    pub(super) fn put(&mut self, place: [i32; 2], block: &[u8], is_differing: bool) {
        if self.bytes.is_none() {
            self.bytes = Some(Arc::new(self.all_transparent()));
        }
        let parts = self.parts(place);
        if let Some(bytes) = &mut self.bytes {
            let bytes = Arc::make_mut(bytes);
            for (at, part) in parts {
                bytes[at..at + part.len()].copy_from_slice(&block[part]);
            }
        }
        self.is_painted = true;
        self.mark(place, is_differing);
    }

    pub(super) fn is_differing(&self, place: [i32; 2]) -> bool {
        let bit = bit_of(place);
        self.differing.get(bit / 64).is_some_and(|word| word >> (bit % 64) & 1 == 1)
    }

    fn mark(&mut self, place: [i32; 2], is_differing: bool) {
        if self.is_differing(place) == is_differing {
            return;
        }
        self.differing.resize(SIDE_BLOCKS * SIDE_BLOCKS / 64, 0);
        let bit = bit_of(place);
        self.differing[bit / 64] ^= 1 << (bit % 64);
        self.differing_count = if is_differing { self.differing_count + 1 } else { self.differing_count - 1 };
    }

    /// Makes it absent again, as it was before all paint.
    pub(super) fn vanish(&mut self) {
        self.bytes = None;
    }

    /// Where the parts of a block lie in the tile, and in the block.
    fn parts(&self, [x, y]: [i32; 2]) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> + use<> {
        let (x, y) = (x as usize, y as usize);
        let across = self.stored[0] as usize / 4;
        let (rows, bytes) = match self.format {
            TileFormat::Bc1 | TileFormat::Bc7 => (1, self.format.block_bytes()),
            TileFormat::Rgba8 => (4, 16),
        };
        (0..rows).map(move |row| (((y * rows + row) * across + x) * bytes, row * bytes..(row + 1) * bytes))
    }

    fn all_transparent(&self) -> Vec<u8> {
        let block = transparent(self.format);
        let blocks = self.stored.map(|side| side as usize / 4).iter().product();
        // Of Rgba8 all is zero, so the order of rows does not matter.
        block[..self.format.block_bytes()].repeat(blocks)
    }

    /// Mean colour of the texels that the tile covers, as the directory has it; `None` if nothing of the tile is seen. Decodes all of it.
    pub(super) fn average(&self, covered: [u32; 2]) -> Option<[u8; 4]> {
        self.bytes.as_ref()?;
        let mut sums = [0u64; 4];
        let mut is_seen = false;
        let [across, up] = self.stored.map(|side| side as i32 / 4);
        let inside = |axis: usize, at: i32| {
            (BORDER_TEXELS as i32..(BORDER_TEXELS + covered[axis]) as i32).contains(&at)
        };
        for [x, y] in (0..up).flat_map(|y| (0..across).map(move |x| [x, y])) {
            let texels = self.texels([x, y]);
            for (i, texel) in (0..).zip(texels) {
                is_seen |= !is_transparent(self.format, texel[3]);
                if inside(0, 4 * x + i % 4) && inside(1, 4 * y + i / 4) {
                    let linear = TABLES.linear(texel);
                    sums.iter_mut().zip(linear).for_each(|(sum, value)| *sum += u64::from(value));
                }
            }
        }
        let count = u64::from(covered[0]) * u64::from(covered[1]);
        is_seen.then(|| TABLES.srgb(sums.map(|sum| ((sum + count / 2) / count) as u16)))
    }
}

fn bit_of([x, y]: [i32; 2]) -> usize {
    y as usize * SIDE_BLOCKS + x as usize
}

/// A block of which nothing is seen.
fn transparent(format: TileFormat) -> BlockBytes {
    let mut block = [0; 64];
    match format {
        TileFormat::Rgba8 => {}
        // Two equal colours and the index of no colour sixteen times.
        TileFormat::Bc1 => block[4..8].fill(0xff),
        TileFormat::Bc7 => {
            let mut made = Vec::new();
            encode_blocks(format, &[[[0; 4]; 16]], &mut Vec::new(), &mut made);
            block[..made.len()].copy_from_slice(&made);
        }
    }
    block
}

#[cfg(test)]
mod tests {
    use super::super::super::encode::check_format;
    use super::*;

    #[test]
    fn blocks_go_where_they_belong_and_absent_tiles_are_transparent() {
        for format in [TileFormat::Bc1, TileFormat::Bc7, TileFormat::Rgba8] {
            if check_format(format).is_err() {
                continue;
            }
            let shape = ImageryShape::new(format, [30, 9], [0.0; 2], [1.0; 2]);
            let id = TileId { level: 0, x: 0, y: 0 };
            let mut tile = Tile::new(&shape, id, None);
            assert_eq!((tile.texels([3, 1]), tile.average([30, 9])), ([[0; 4]; 16], None));
            let mut made = Vec::new();
            let texels = std::array::from_fn(|i| [200, 100, (i / 4 * 60) as u8, 255]);
            encode_blocks(format, &[texels], &mut Vec::new(), &mut made);
            let old = tile.block([9, 4]);
            tile.put([9, 4], &made, true);
            assert_eq!(tile.bytes().unwrap().len(), format.stored_bytes(shape.stored_texels(id)));
            assert_eq!((tile.block([9, 4])[..made.len()].to_vec(), tile.differing_count), (made, 1));
            for place in [[8, 4], [9, 3], [0, 0]] {
                assert!(
                    tile.texels(place).iter().all(|texel| is_transparent(format, texel[3])),
                    "{format:?}"
                );
                assert!(!tile.is_differing(place));
            }
            let before = tile.shared();
            tile.put([9, 4], &old, false);
            assert_eq!((tile.differing_count, tile.average([30, 9])), (0, None));
            let mut whole = Vec::new();
            assert!(before.read(&mut whole) && whole.len() == format.tile_bytes());
        }
    }
}
