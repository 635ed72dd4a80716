//! TIFF of luma and chroma as they are, in strips or tiles, packed or not.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use super::tiff::{DATA_AT, DEFLATE, LZW, RAW, longs, rationals, shorts, tiff};
use std::io::Write;

/// Columns and rows: no multiples of any step.
pub(crate) const SIZE: [u32; 2] = [37, 29];

/// How a picture is stored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chroma {
    pub(crate) steps: [u32; 2],
    compression: u16,
    /// Columns and rows of a tile, or rows of a strip.
    tile: Option<[u32; 2]>,
    strip: u32,
    /// Whether coefficients and codes of black and white are stated that are not the usual ones.
    pub(crate) is_stated: bool,
}

pub(crate) fn all() -> Vec<Chroma> {
    let steps = [[1, 1], [2, 1], [2, 2], [1, 2], [4, 1], [4, 2], [4, 4]];
    let ways = [
        (RAW, None, 29, false),
        (LZW, None, 8, true),
        (DEFLATE, Some([32, 16]), 0, false),
        (RAW, Some([16, 32]), 0, true),
    ];
    let of = |steps| {
        ways.map(|(compression, tile, strip, is_stated)| Chroma {
            steps,
            compression,
            tile,
            strip,
            is_stated,
        })
    };
    steps.into_iter().flat_map(of).collect()
}

impl Chroma {
    pub(crate) fn is_tiled(&self) -> bool {
        self.tile.is_some()
    }
}

/// The codes of a texel's luma, and of its unit's chroma.
pub(crate) fn codes(chroma: Chroma, col: u32, row: u32) -> [u8; 3] {
    let [across, down] = chroma.steps;
    let (unit, line) = (col / across, row / down);
    [30 + 5 * col + row, 40 + 11 * unit + 3 * line, 1000 - 4 * unit - 5 * line].map(|code| code as u8)
}

/// Red, green and blue by the formulas of TIFF 6.0, section 21.
pub(crate) fn colours(chroma: Chroma, codes: [u8; 3]) -> [f64; 3] {
    let [y, cb, cr] = codes.map(f64::from);
    let ([of_red, of_green, of_blue], y, full) = match chroma.is_stated {
        true => ([0.2126, 0.7152, 0.0722], (y - 16.0) * 255.0 / 219.0, 127.0 / 112.0),
        false => ([0.299, 0.587, 0.114], y, 1.0),
    };
    let red = (cr - 128.0) * full * (2.0 - 2.0 * of_red) + y;
    let blue = (cb - 128.0) * full * (2.0 - 2.0 * of_blue) + y;
    [red, (y - of_blue * blue - of_red * red) / of_green, blue].map(|colour| colour.clamp(0.0, 255.0))
}

fn pack(compression: u16, bytes: &[u8]) -> Vec<u8> {
    match compression {
        LZW => weezl::encode::Encoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8).encode(bytes).unwrap(),
        DEFLATE => {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            encoder.write_all(bytes).unwrap();
            encoder.finish().unwrap()
        }
        _ => bytes.to_vec(),
    }
}

pub(crate) fn file(chroma: Chroma) -> Vec<u8> {
    let [across, down] = chroma.steps;
    let [wide, high] = chroma.tile.unwrap_or([SIZE[0], chroma.strip]);
    let (mut data, mut places, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
    for top in (0..SIZE[1]).step_by(high as usize) {
        for left in (0..SIZE[0]).step_by(wide as usize) {
            let rows = if chroma.tile.is_some() { high } else { high.min(SIZE[1] - top) };
            let mut bytes = Vec::new();
            for (line, unit) in (0..rows.div_ceil(down))
                .flat_map(|line| (0..wide.div_ceil(across)).map(move |unit| (line, unit)))
            {
                let [col, row] = [left + unit * across, top + line * down];
                let texels = (0..down).flat_map(|y| (0..across).map(move |x| (x, y)));
                bytes.extend(texels.map(|(x, y)| codes(chroma, col + x, row + y)[0]));
                bytes.extend(&codes(chroma, col, row)[1..]);
            }
            let packed = pack(chroma.compression, &bytes);
            places.push(DATA_AT + data.len() as u32);
            lengths.push(packed.len() as u32);
            data.extend(packed);
        }
    }
    let mut tags = vec![
        longs(256, &[SIZE[0]]),
        longs(257, &[SIZE[1]]),
        shorts(258, &[8; 3]),
        shorts(259, &[chroma.compression]),
        shorts(262, &[6]),
        shorts(277, &[3]),
        shorts(284, &[1]),
        shorts(530, &chroma.steps.map(|step| step as u16)),
    ];
    match chroma.tile {
        Some([wide, high]) => {
            tags.extend([longs(322, &[wide]), longs(323, &[high]), longs(324, &places), longs(325, &lengths)])
        }
        None => tags.extend([longs(278, &[high]), longs(273, &places), longs(279, &lengths)]),
    }
    if chroma.is_stated {
        tags.push(rationals(529, &[[2126, 10_000], [7152, 10_000], [722, 10_000]]));
        tags.push(rationals(532, &[[16, 1], [235, 1], [128, 1], [240, 1], [128, 1], [240, 1]]));
    }
    tiff(false, tags, &data)
}
