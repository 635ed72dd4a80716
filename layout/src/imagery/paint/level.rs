//! One level painted, or made anew from the finer one. Blocks are decoded and texels changed; blocks in which a texel changed are encoded and put into all tiles that hold them.
//!
//! **The rule for coarser levels.** The pyramid was filtered from texels before they were encoded. These are no longer there, so a texel over a changed one becomes the mean of the four
//! below it as they are decoded now, in linear light and weighted by alpha. Texels over unchanged ones stay as they are decoded; only what shares a block
//! of 4 x 4 with a changed one is encoded a second time. A block whose blocks below are all as they were before all paint is put back, byte for byte.
//!
//! Blocks of a level do not depend on each other, so they are encoded many at a time in any order.

use super::super::encode::{BlockTexels, encode_blocks, is_transparent};
use super::super::linear::{TABLES, mean};
use super::super::shape::{ImageryShape, TileFormat, TileId};
use super::blocks::{Grid, Marks, Rect};
use super::cache::Cache;
use super::operation::{Brush, Region};
use std::collections::HashMap;
use std::sync::Arc;

/// Blocks encoded at once.
const BATCH: usize = 4096;

/// Tiles as they were before all paint, which a batch restores blocks from; none where absent.
pub(super) type Originals = HashMap<TileId, Option<Arc<Vec<u8>>>>;

/// Room to work in, and what has been changed.
#[derive(Debug, Default)]
pub(super) struct Work {
    /// Texels changed in the level last worked on, and in the one under way.
    finer: Marks,
    marks: Marks,
    blocks: Vec<[i32; 2]>,
    texels: Vec<BlockTexels>,
    strip: Vec<u8>,
    encoded: Vec<u8>,
    /// Blocks changed in the level under way.
    changed: Option<Rect>,
    /// Tiles changed in the batch.
    pub(super) tiles: Vec<TileId>,
    pub(super) batch: u64,
}

/// A level under way.
pub(super) struct Level<'p> {
    pub(super) shape: &'p ImageryShape,
    pub(super) grid: Grid,
    pub(super) cache: &'p mut Cache,
    pub(super) work: &'p mut Work,
    pub(super) originals: &'p Originals,
}

impl Level<'_> {
    /// Lets a brush over texels of level 0. Returns the blocks that changed.
    pub(super) fn paint(&mut self, brush: &Brush, texels: Rect) -> Option<Rect> {
        let blocks = texels.shrunk(4);
        self.begin(blocks);
        let (origin_m, texel_m) = (self.shape.origin_m, self.shape.texel_m);
        let format = self.shape.format;
        for block in blocks.places() {
            let Some(mut new) = self.texels(block) else { continue };
            let mut bits = 0;
            for [u, v] in inside(self.grid.inside(block)) {
                let at = [4 * block[0] + u as i32, 4 * block[1] + v as i32];
                if !texels.contains(at) {
                    continue;
                }
                let centre_m =
                    [0, 1].map(|axis| origin_m[axis] + (f64::from(at[axis]) + 0.5) * texel_m[axis]);
                let texel = &mut new[4 * v + u];
                let painted = brush.texel(at, centre_m, *texel);
                bits |= u16::from(change(format, texel, painted)) << (4 * v + u);
            }
            self.add(block, new, bits);
        }
        self.finish()
    }

    /// Puts the blocks of level 0 back that `region` touches. Returns those that changed.
    pub(super) fn restore(&mut self, region: &Region, texels: Rect) -> Option<Rect> {
        let blocks = texels.shrunk(4);
        self.begin(blocks);
        let (origin_m, texel_m) = (self.shape.origin_m, self.shape.texel_m);
        for block in blocks.places() {
            let is_touched = inside(self.grid.inside(block)).any(|at| {
                region.contains([0, 1].map(|axis| {
                    origin_m[axis] + (f64::from(4 * block[axis] + at[axis] as i32) + 0.5) * texel_m[axis]
                }))
            });
            if is_touched && is_differing(self.grid, self.cache, block) {
                self.put_back(block);
            }
        }
        self.finish()
    }

    /// Makes the texels over changed ones of the finer level anew, which was worked on last and in which `below` changed. `puts_back` if there may be
    /// blocks over none that differ from the picture before all paint. Returns the blocks that changed.
    pub(super) fn coarsen(&mut self, finer: Grid, below: Rect, puts_back: bool) -> Option<Rect> {
        std::mem::swap(&mut self.work.finer, &mut self.work.marks);
        let blocks = below.shrunk(2);
        self.begin(blocks);
        for block in blocks.places() {
            // The four below in order, and what changed in them.
            let four: [[i32; 2]; 4] =
                std::array::from_fn(|i| [2 * block[0] + i as i32 % 2, 2 * block[1] + i as i32 / 2]);
            let changed = four.map(|block| self.work.finer.get(block));
            if changed == [0; 4] {
                continue;
            }
            let is_there = |b: &[i32; 2]| b[0] < finer.blocks[0] && b[1] < finer.blocks[1];
            if puts_back && !four.iter().any(|b| is_there(b) && is_differing(finer, self.cache, *b)) {
                // Means of what is below would not be the old texels, which were filtered before anything was encoded.
                if is_differing(self.grid, self.cache, block) {
                    self.put_back(block);
                }
                continue;
            }
            let Some(new) = self.texels(block) else { continue };
            let (new, bits) = self.means(finer, block, four, changed, new);
            self.add(block, new, bits);
        }
        self.finish()
    }

    /// The texels of a block with those over changed ones made anew, and which of them are others now.
    fn means(
        &self,
        finer: Grid,
        block: [i32; 2],
        four: [[i32; 2]; 4],
        changed: [u16; 4],
        mut texels: BlockTexels,
    ) -> (BlockTexels, u16) {
        let format = self.shape.format;
        let mut bits = 0;
        for (i, below) in four.into_iter().enumerate().filter(|(i, _)| changed[*i] != 0) {
            let (id, place) = finer.home(below);
            let Some(tile) = self.cache.get(id) else { continue };
            let below_texels = tile.texels(place);
            let [wide, high] = finer.inside(below);
            for [s, t] in inside(self.grid.inside(block)).filter(|[s, t]| s / 2 + t / 2 * 2 == i) {
                let [west, south] = [s % 2 * 2, t % 2 * 2];
                // The last of an odd row stands for two.
                let [east, north] = [(west + 1).min(wide - 1), (south + 1).min(high - 1)];
                let places =
                    [[west, south], [east, south], [west, north], [east, north]].map(|[u, v]| 4 * v + u);
                if places.iter().all(|place| changed[i] >> place & 1 == 0) {
                    continue;
                }
                let linear = mean(places.map(|place| TABLES.linear(below_texels[place])));
                let texel = &mut texels[4 * t + s];
                bits |= u16::from(change(format, texel, TABLES.srgb(linear))) << (4 * t + s);
            }
        }
        (texels, bits)
    }

    fn begin(&mut self, blocks: Rect) {
        self.work.marks.clear(blocks);
        self.work.changed = None;
    }

    fn texels(&self, block: [i32; 2]) -> Option<BlockTexels> {
        let (id, place) = self.grid.home(block);
        self.cache.get(id).map(|tile| tile.texels(place))
    }

    fn note(&mut self, block: [i32; 2], bits: u16) {
        self.work.marks.set(block, bits);
        let all = self.work.changed.get_or_insert(Rect { from: block, to: block });
        for axis in [0, 1] {
            all.from[axis] = all.from[axis].min(block[axis]);
            all.to[axis] = all.to[axis].max(block[axis]);
        }
    }

    /// Has a block of the picture encoded, if any of its texels changed, and those around the picture that repeat these.
    fn add(&mut self, block: [i32; 2], mut texels: BlockTexels, bits: u16) {
        if bits == 0 {
            return;
        }
        self.note(block, bits);
        let [wide, high] = self.grid.inside(block);
        let repeated = |texels: &BlockTexels, [dx, dy]: [i32; 2]| -> BlockTexels {
            std::array::from_fn(|i| texels[source_of(i, [dx, dy], [wide, high])])
        };
        texels = repeated(&texels, [0, 0]);
        self.work.blocks.push(block);
        self.work.texels.push(texels);
        for step in self.grid.ring(block) {
            if (0..16).any(|i| bits >> source_of(i, step, [wide, high]) & 1 == 1) {
                self.work.blocks.push([block[0] + step[0], block[1] + step[1]]);
                self.work.texels.push(repeated(&texels, step));
            }
        }
        if self.work.blocks.len() >= BATCH {
            self.encode();
        }
    }

    /// Encodes what has gathered.
    fn encode(&mut self) {
        let Work { blocks, texels, strip, encoded, tiles, batch, .. } = &mut *self.work;
        encode_blocks(self.shape.format, texels, strip, encoded);
        for (block, bytes) in blocks.iter().zip(encoded.chunks_exact(self.shape.format.block_bytes())) {
            for (id, place) in self.grid.holders(*block) {
                let Some(tile) = self.cache.get_mut(id) else { continue };
                tile.put(place, bytes, true);
                if tile.changed_in != *batch {
                    tile.changed_in = *batch;
                    tiles.push(id);
                }
            }
        }
        blocks.clear();
        texels.clear();
    }

    fn finish(&mut self) -> Option<Rect> {
        if !self.work.blocks.is_empty() {
            self.encode();
        }
        self.work.changed
    }

    /// Puts a block of the picture back as it was before all paint, and those around the picture that repeat it.
    fn put_back(&mut self, block: [i32; 2]) {
        self.note(block, u16::MAX);
        let ring = self.grid.ring(block).map(|step| [block[0] + step[0], block[1] + step[1]]);
        for (id, place) in std::iter::once(block).chain(ring).flat_map(|block| self.grid.holders(block)) {
            let (Some(tile), Some(original)) = (self.cache.get_mut(id), self.originals.get(&id)) else {
                continue;
            };
            if !tile.is_differing(place) {
                continue;
            }
            let bytes = tile.block_of(original.as_ref().map(|bytes| &bytes[..]), place);
            tile.put(place, &bytes, false);
            if tile.differing_count == 0 && original.is_none() {
                tile.vanish();
            }
            if tile.changed_in != self.work.batch {
                tile.changed_in = self.work.batch;
                self.work.tiles.push(id);
            }
        }
    }
}

/// Whether any copy of a block differs from the picture before all paint.
fn is_differing(grid: Grid, cache: &Cache, block: [i32; 2]) -> bool {
    grid.holders(block).any(|(id, place)| cache.get(id).is_some_and(|tile| tile.is_differing(place)))
}

/// Places of a block's texels of the picture.
fn inside([wide, high]: [usize; 2]) -> impl Iterator<Item = [usize; 2]> {
    (0..high).flat_map(move |v| (0..wide).map(move |u| [u, v]))
}

/// Which texel of a block is the i-th of the block so many steps from it, where both repeat the picture's outermost texels.
fn source_of(i: usize, [dx, dy]: [i32; 2], [wide, high]: [usize; 2]) -> usize {
    let source = |at: usize, step: i32, end: usize| match step {
        0 => at.min(end - 1),
        1 => end - 1,
        _ => 0,
    };
    4 * source(i / 4, dy, high) + source(i % 4, dx, wide)
}

/// Gives a texel a new colour, as far as the format can hold it. Whether anything else is seen then.
fn change(format: TileFormat, texel: &mut [u8; 4], new: [u8; 4]) -> bool {
    let is_seen = !is_transparent(format, new[3]);
    if new == *texel || !is_seen && is_transparent(format, texel[3]) {
        return false;
    }
    let [r, g, b, a] = new;
    let alpha = if format == TileFormat::Bc1 { 255 } else { a };
    let new = if is_seen { [r, g, b, alpha] } else { [0; 4] };
    let is_other = new != *texel;
    *texel = new;
    is_other
}
