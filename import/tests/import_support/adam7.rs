//! An interlaced PNG, which the encoder of crate `png` cannot write.

use std::io::Write;

/// First column, step between columns, first row, step between rows of each pass.
const PASSES: [[usize; 4]; 7] =
    [[0, 8, 0, 8], [4, 8, 0, 8], [0, 4, 4, 8], [2, 4, 0, 4], [0, 2, 2, 4], [1, 2, 0, 2], [0, 1, 1, 2]];

/// A PNG of `sides` pixels, `bytes` for each pixel, of colour type `color` and `depth` bits a channel, interlaced.
pub(crate) fn interlaced_png(sides: [usize; 2], color: u8, depth: u8, pixels: &[Vec<u8>]) -> Vec<u8> {
    let [wide, high] = sides;
    let mut rows = Vec::new();
    for [left, across, top, down] in PASSES {
        for row in (top..high).step_by(down).filter(|_| left < wide) {
            rows.push(0);
            (left..wide).step_by(across).for_each(|col| rows.extend(&pixels[row * wide + col]));
        }
    }
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(&rows).unwrap();
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8; 4], data: &[u8]| {
        png.extend((data.len() as u32).to_be_bytes());
        let begins = png.len();
        png.extend(name);
        png.extend(data);
        let sum = crc32fast::hash(&png[begins..]);
        png.extend(sum.to_be_bytes());
    };
    let [w, h] = sides.map(|side| (side as u32).to_be_bytes());
    chunk(b"IHDR", &[&w[..], &h, &[depth, color, 0, 0, 1]].concat());
    chunk(b"IDAT", &packed.finish().unwrap());
    chunk(b"IEND", &[]);
    png
}
