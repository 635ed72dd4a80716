//! Painted pictures as a whole: all levels as texels, all tiles as blocks.

use super::open_bytes;
use std::collections::HashMap;
use std::sync::Arc;
use terrasoar_layout::imagery::{ImageryShape, PaintedSection, Painter, TileId, decode_tile};

/// A colour of sRGB in linear light, by the standard's own formulas.
pub fn linear(byte: f64) -> f64 {
    let value = byte / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

pub fn srgb(intensity: f64) -> f64 {
    255.0
        * if intensity <= 0.003_130_8 { intensity * 12.92 } else { 1.055 * intensity.powf(1.0 / 2.4) - 0.055 }
}

pub fn painter_of(bytes: Vec<u8>) -> Painter {
    Painter::open(Arc::new(open_bytes(bytes).unwrap())).unwrap().expect("imagery")
}

/// A level, rows from the south.
#[derive(Debug, Clone, PartialEq)]
pub struct Canvas {
    pub wide: i32,
    pub high: i32,
    pub texels: Vec<[u8; 4]>,
}

impl Canvas {
    pub fn size(&self) -> [u32; 2] {
        [self.wide as u32, self.high as u32]
    }

    /// Beyond the picture its outermost texels.
    pub fn at(&self, x: i32, y: i32) -> [u8; 4] {
        self.texels[(y.clamp(0, self.high - 1) * self.wide + x.clamp(0, self.wide - 1)) as usize]
    }
}

/// Everything that is seen of a picture.
#[derive(Debug, PartialEq)]
pub struct Seen {
    pub shape: ImageryShape,
    pub levels: Vec<Canvas>,
    /// Tiles as they are handed out, and decoded; empty where absent.
    tiles: HashMap<TileId, (Vec<u8>, Vec<[u8; 4]>)>,
}

/// A block's place in its tile, its place in the level, its texels before and after.
pub type BlockPair = ([i32; 2], [i32; 2], [[u8; 4]; 16], [[u8; 4]; 16]);

impl Seen {
    pub fn of(painter: &Painter) -> Self {
        let shape = painter.shape();
        let mut tiles = HashMap::new();
        for id in shape.ids() {
            let mut bytes = Vec::new();
            let texels = match painter.read_tile(id, &mut bytes).unwrap() {
                true => decode_tile(shape.format, &bytes).unwrap().as_chunks::<4>().0.to_vec(),
                false => Vec::new(),
            };
            tiles.insert(id, (bytes, texels));
        }
        let levels = (0..shape.levels).map(|level| {
            let [wide, high] = shape.level_texels(level).map(|side| side as i32);
            let texel = |x: i32, y: i32| {
                let id = TileId { level, x: x as u32 / 504, y: y as u32 / 504 };
                let place = (y % 504 + 4) * 512 + x % 504 + 4;
                tiles[&id].1.get(place as usize).copied().unwrap_or_default()
            };
            let texels =
                (0..high).flat_map(|y| (0..wide).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
            Canvas { wide, high, texels }
        });
        let levels = levels.collect();
        Self { shape, levels, tiles }
    }

    /// Texels of a block of a tile.
    pub fn block(&self, id: TileId, place: [i32; 2]) -> [[u8; 4]; 16] {
        let texels = &self.tiles[&id].1;
        std::array::from_fn(|i| {
            let at = (4 * place[1] as usize + i / 4) * 512 + 4 * place[0] as usize + i % 4;
            texels.get(at).copied().unwrap_or_default()
        })
    }

    /// Texels of a block of a level in the tile that covers it.
    pub fn home_block(&self, level: u32, block: [i32; 2]) -> [[u8; 4]; 16] {
        let id = TileId { level, x: block[0] as u32 / 126, y: block[1] as u32 / 126 };
        self.block(id, block.map(|b| b % 126 + 1))
    }

    /// All stored blocks of a tile in two states of a picture.
    pub fn blocks<'s>(before: &'s Self, after: &'s Self, id: TileId) -> impl Iterator<Item = BlockPair> + 's {
        let [across, up] = before.shape.covered_texels(id).map(|side| (side + 8).div_ceil(4) as i32);
        (0..up).flat_map(move |y| (0..across).map(move |x| [x, y])).map(move |place| {
            let block = [126 * id.x as i32 + place[0] - 1, 126 * id.y as i32 + place[1] - 1];
            (place, block, before.block(id, place), after.block(id, place))
        })
    }

    /// Mean colour of the texels that a tile covers.
    pub fn mean(&self, id: TileId) -> [f64; 4] {
        let canvas = &self.levels[id.level as usize];
        let [wide, high] = self.shape.covered_texels(id).map(|side| side as i32);
        let mut sums = [0.0; 4];
        for (x, y) in (0..high).flat_map(|y| (0..wide).map(move |x| (x, y))) {
            let texel = canvas.at(504 * id.x as i32 + x, 504 * id.y as i32 + y).map(f64::from);
            let alpha = texel[3] / 255.0;
            (0..3).for_each(|c| sums[c] += linear(texel[c]) * alpha);
            sums[3] += alpha;
        }
        let [r, g, b, a] = sums;
        if a == 0.0 {
            return [0.0; 4];
        }
        [srgb(r / a), srgb(g / a), srgb(b / a), 255.0 * a / f64::from(wide * high)]
    }
}

/// A file with a section behind its end, and the other header slot leading to it.
pub fn written(mut file: Vec<u8>, section: &PaintedSection) -> Vec<u8> {
    let generation =
        |file: &[u8], slot: usize| u32::from_le_bytes(file[slot + 0x1c..slot + 0x20].try_into().unwrap());
    let is_whole = |file: &[u8], slot: usize| {
        crc32fast::hash(&file[slot..slot + 0xffc]).to_le_bytes() == file[slot + 0xffc..slot + 4096]
    };
    let current = (0..2)
        .map(|i| 4096 * i)
        .filter(|slot| is_whole(&file, *slot))
        .max_by_key(|slot| generation(&file, *slot))
        .unwrap();
    file.resize(section.place.offset as usize, 0);
    file.extend_from_slice(&section.bytes);
    let mut header = file[current..current + 4096].to_vec();
    header[0x1c..0x20].copy_from_slice(&(generation(&file, current) + 1).to_le_bytes());
    header[0x88..0x90].copy_from_slice(&(file.len() as u64).to_le_bytes());
    header[0x90..0x98].copy_from_slice(&section.place.offset.to_le_bytes());
    header[0x98..0xa0].copy_from_slice(&section.place.bytes.to_le_bytes());
    let sum = crc32fast::hash(&header[..0xffc]);
    header[0xffc..].copy_from_slice(&sum.to_le_bytes());
    file[4096 - current..8192 - current].copy_from_slice(&header);
    file
}
