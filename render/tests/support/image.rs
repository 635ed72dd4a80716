//! Images by formula, their tiles as they are or in blocks, and what a filter must make of them.

use terrasoar_layout::imagery::{BORDER_TEXELS, INNER_TEXELS, ImageryShape, TILE_TEXELS, TileFormat, TileId};
use terrasoar_render::{Renderer, TerrainShape, View};

use super::scene::Scene;

/// A texel: sRGB and straight alpha.
pub type Texel = [u8; 4];

/// An image whose texels are a function of level, column and row.
pub struct Image {
    pub shape: ImageryShape,
    texel: Box<dyn Fn(u32, i64, i64) -> Texel>,
}

impl Image {
    pub fn new(shape: ImageryShape, texel: impl Fn(u32, i64, i64) -> Texel + 'static) -> Self {
        Self { shape, texel: Box::new(texel) }
    }

    /// Fields with ways between them, a lake that is not in the image, and ground that it does not reach in the east.
    pub fn fields(terrain: &TerrainShape) -> Self {
        let over = Self::shape_over(terrain, 5.0);
        let shape = ImageryShape { texels: [over.texels[0] * 3 / 4, over.texels[1]], ..over };
        let at = |u: f64, v: f64| -> [f64; 4] {
            let (i, j) = ((u / 230.0).floor(), ((v + 0.3 * u) / 170.0).floor());
            let across = [u - 230.0 * i, v + 0.3 * u - 170.0 * j];
            if (u - 1750.0).hypot(v - 2350.0) < 330.0 {
                return [0.0; 4];
            }
            if across.iter().any(|a| *a < 16.0) {
                return [0.45, 0.40, 0.33, 1.0];
            }
            let kind = (i * 12.9898 + j * 78.233).sin() * 43_758.545_3;
            let furrow = 1.0 + 0.12 * (across[0] / 9.0).sin();
            let [r, g, b] = [[0.10, 0.19, 0.05], [0.25, 0.24, 0.08], [0.20, 0.12, 0.06], [0.05, 0.10, 0.04]]
                [(kind.rem_euclid(1.0) * 4.0) as usize % 4];
            [r * furrow, g * furrow, b * furrow, 1.0]
        };
        Self::new(shape, move |level, x, y| {
            let size_m = 5.0 * f64::from(1 << level);
            // Sixteen places of a texel.
            let mut sum = [0.0; 4];
            for n in 0..16 {
                let [u, v] =
                    [(x, n % 4), (y, n / 4)].map(|(c, s)| (c as f64 + (f64::from(s) + 0.5) / 4.0) * size_m);
                for (s, part) in sum.iter_mut().zip(at(u, v)) {
                    *s += part / 16.0;
                }
            }
            let [r, g, b] = [0, 1, 2].map(|i| encoded(sum[i] / sum[3].max(1e-9)).round() as u8);
            [r, g, b, (255.0 * sum[3]).round() as u8]
        })
    }

    /// As many texels as cover a terrain at `texel_m`, from its south-west corner, with all levels.
    pub fn shape_over(terrain: &TerrainShape, texel_m: f64) -> ImageryShape {
        let extent = |i: usize| f64::from(terrain.samples[i] - 1) * terrain.spacing_m[i];
        ImageryShape {
            format: TileFormat::Rgba8,
            texels: [0, 1].map(|i| (extent(i) / texel_m).ceil() as u32),
            levels: 32,
            origin_m: [0.0; 2],
            texel_m: [texel_m; 2],
        }
    }

    /// A texel of a level; beyond the edge the nearest inside.
    pub fn texel(&self, level: u32, x: i64, y: i64) -> Texel {
        let last = |n: u32| i64::from(n.div_ceil(1 << level)) - 1;
        (self.texel)(level, x.clamp(0, last(self.shape.texels[0])), y.clamp(0, last(self.shape.texels[1])))
    }

    /// The bytes of a tile in the shape's format.
    pub fn tile(&self, id: TileId) -> Vec<u8> {
        let first = |t: u32| i64::from(t * INNER_TEXELS) - i64::from(BORDER_TEXELS);
        let [x0, y0] = [first(id.x), first(id.y)];
        let side = i64::from(TILE_TEXELS);
        let texel = |x, y| self.texel(id.level, x0 + x, y0 + y);
        if self.shape.format == TileFormat::Rgba8 {
            return (0..side * side).flat_map(|n| texel(n % side, n / side)).collect();
        }
        let blocks = side / 4;
        (0..blocks * blocks)
            .flat_map(|n| {
                let [x, y] = [4 * (n % blocks), 4 * (n / blocks)];
                let block = std::array::from_fn(|i| texel(x + i as i64 % 4, y + i as i64 / 4));
                match self.shape.format {
                    TileFormat::Bc7 => encode_bc7(block).to_vec(),
                    _ => encode_bc1(block).to_vec(),
                }
            })
            .collect()
    }

    /// Linear light and alpha at a place in texels of a level from its corner, between the four nearest texels.
    pub fn bilinear(&self, level: u32, at: [f64; 2]) -> [f64; 4] {
        let [x, y] = at.map(|a| a - 0.5);
        let [i, j] = [x.floor(), y.floor()];
        let mut sum = [0.0; 4];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = (1.0 - (x - i - f64::from(dx)).abs()) * (1.0 - (y - j - f64::from(dy)).abs());
            let texel = self.texel(level, i as i64 + i64::from(dx), j as i64 + i64::from(dy));
            for (s, linear) in sum.iter_mut().zip(linear_of(texel)) {
                *s += weight * linear;
            }
        }
        sum
    }
}

/// What hardware makes of a texel.
pub fn linear_of([r, g, b, a]: Texel) -> [f64; 4] {
    let linear = |c: u8| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    [linear(r), linear(g), linear(b), f64::from(a) / 255.0]
}

/// The code of linear light, as a real number from 0 to 255.
pub fn encoded(linear: f64) -> f64 {
    255.0 * if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// A colour that blocks of two colours hold exactly.
pub fn in_565([r, g, b]: [u8; 3]) -> Texel {
    let five = |c: u8| (c >> 3) << 3 | c >> 5;
    [five(r), (g >> 2) << 2 | g >> 6, five(b), 255]
}

/// A block of at most two opaque colours, of those that [`in_565`] makes, and transparent texels.
fn encode_bc1(texels: [Texel; 16]) -> [u8; 8] {
    let code = |t: &Texel| u16::from(t[0] >> 3) << 11 | u16::from(t[1] >> 2) << 5 | u16::from(t[2] >> 3);
    let opaque = || texels.iter().filter(|t| t[3] > 127).map(code);
    let [low, high] = [opaque().min().unwrap_or(0), opaque().max().unwrap_or(0)];
    assert!(opaque().all(|c| c == low || c == high), "more than two colours in a block");
    // The smaller first means that index 3 is transparent.
    let indices = (0..).zip(&texels).fold(0_u32, |bits, (i, t)| {
        bits | if t[3] <= 127 { 3 } else { u32::from(code(t) != low) } << (2 * i)
    });
    let mut block = [0; 8];
    block[..2].copy_from_slice(&low.to_le_bytes());
    block[2..4].copy_from_slice(&high.to_le_bytes());
    block[4..].copy_from_slice(&indices.to_le_bytes());
    block
}

/// A block of one colour of odd numbers: mode 6, both ends of seven bits alike and the bit that ends them 1.
fn encode_bc7(texels: [Texel; 16]) -> [u8; 16] {
    let colour = texels[0];
    assert!(texels.iter().all(|t| *t == colour) && colour.iter().all(|c| c % 2 == 1), "{texels:?}");
    let mut bits = 1_u128 << 6;
    for (i, channel) in colour.iter().enumerate() {
        let end = u128::from(channel >> 1);
        bits |= (end | end << 7) << (7 + 14 * i);
    }
    (bits | 3 << 63).to_le_bytes()
}

/// Puts an image on the terrain, in a pool of so many tiles.
pub fn drape(scene: &mut Scene<'_>, image: &Image, tiles: u64) {
    let bytes = tiles * image.shape.format.tile_bytes() as u64;
    scene.renderer.set_imagery(&image.shape, image.shape.format, bytes).unwrap();
}

/// Gives the tiles that the view wants and lacks, at most so many, except some. Returns how many were taken.
pub fn give(
    renderer: &mut Renderer,
    image: &Image,
    view: &View,
    most: usize,
    except: impl Fn(TileId) -> bool,
) -> usize {
    let wanted = renderer.want_imagery(view, usize::MAX).to_vec();
    let asked = wanted.into_iter().filter(|t| !except(*t)).take(most);
    asked.filter(|tile| renderer.give_imagery(*tile, &image.tile(*tile)).unwrap() > 0).count()
}
