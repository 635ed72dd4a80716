//! Texels to blocks.
//!
//! Opaque blocks are encoded by Intel's ISPC kernels (crate intel_tex_2: feature `ispc`, on the targets it has kernels for). BC1 blocks with transparent texels,
//! which those kernels cannot do, and all blocks on other targets are encoded by texpresso's range fit. BC1 has one bit of alpha: texels of less than
//! half are transparent. Cost: 510 MB of RGB a second and core with the kernels, 23 without.

use super::shape::TileFormat;
use crate::error::LayoutError;
use crate::remedy::Remedy;
use texpresso::{Algorithm, COLOUR_WEIGHTS_UNIFORM, Format, Params};

/// Alpha below which a texel of BC1 is transparent.
const OPAQUE_ALPHA: u8 = 128;

/// Texels of a tile, sides multiples of 4.
#[derive(Debug, Clone, Copy)]
pub(super) struct Texels<'t> {
    pub(super) side: [u32; 2],
    /// Red, green, blue, alpha, a byte each, rows from the south.
    pub(super) rgba: &'t [u8],
}

impl TileFormat {
    /// Whether this build makes tiles of this format, so that a picture in it can be painted.
    pub fn can_be_made(self) -> bool {
        check_format(self).is_ok()
    }
}

/// Refuses a format that this build cannot encode.
pub(super) fn check_format(format: TileFormat) -> Result<(), LayoutError> {
    if format == TileFormat::Bc7 && !ispc::IS_HERE {
        return Err(LayoutError::Usage(
            "this build has no encoder for bc7; take bc1 or raw, or build terrasoar with the feature ispc"
                .into(),
        )
        .mended_by(Remedy::TileFormat));
    }
    Ok(())
}

/// Whether nothing of a texel with that alpha would be seen in the format.
pub(super) fn is_transparent(format: TileFormat, alpha: u8) -> bool {
    match format {
        TileFormat::Bc1 => alpha < OPAQUE_ALPHA,
        TileFormat::Bc7 | TileFormat::Rgba8 => alpha == 0,
    }
}

/// The tile as it is stored.
pub(super) fn encode(format: TileFormat, texels: Texels<'_>) -> Vec<u8> {
    let is_opaque = texels.rgba.iter().skip(3).step_by(4).all(|alpha| *alpha == 255);
    match format {
        TileFormat::Rgba8 => texels.rgba.to_vec(),
        TileFormat::Bc7 => ispc::bc7(texels, is_opaque),
        TileFormat::Bc1 if !ispc::IS_HERE => {
            let mut blocks = vec![0; format.stored_bytes(texels.side)];
            for_blocks(texels, &mut blocks, fit);
            blocks
        }
        TileFormat::Bc1 => {
            let mut blocks = ispc::bc1(texels);
            if !is_opaque {
                for_blocks(texels, &mut blocks, |texels, block| {
                    if texels.iter().any(|texel| texel[3] < OPAQUE_ALPHA) {
                        fit(texels, block);
                    }
                });
            }
            blocks
        }
    }
}

/// The 16 texels of a block, rows from the south.
pub(super) type BlockTexels = [[u8; 4]; 16];

/// Encodes blocks one by one: what becomes of a block depends on its own texels alone, not on those that it is encoded with. `out` is filled with
/// [`TileFormat::block_bytes`] each; `strip` is room to work in.
pub(super) fn encode_blocks(
    format: TileFormat,
    blocks: &[BlockTexels],
    strip: &mut Vec<u8>,
    out: &mut Vec<u8>,
) {
    out.clear();
    out.resize(blocks.len() * format.block_bytes(), 0);
    let places = out.chunks_exact_mut(format.block_bytes());
    let is_opaque = |block: &BlockTexels| block.iter().all(|texel| texel[3] == 255);
    match format {
        TileFormat::Rgba8 => {
            places.zip(blocks).for_each(|(place, block)| place.copy_from_slice(block.as_flattened()));
        }
        TileFormat::Bc1 if !ispc::IS_HERE => places.zip(blocks).for_each(|(place, block)| fit(block, place)),
        TileFormat::Bc1 => {
            ispc::bc1_into(stripped(blocks.iter(), blocks.len(), strip), out);
            let places = out.chunks_exact_mut(format.block_bytes());
            for (place, block) in places.zip(blocks).filter(|(_, block)| !is_opaque(block)) {
                if block.iter().any(|texel| texel[3] < OPAQUE_ALPHA) {
                    fit(block, place);
                }
            }
        }
        TileFormat::Bc7 => {
            // The kernel has one setting for blocks with alpha and one for those without.
            let opaque = blocks.iter().filter(|block| is_opaque(block)).count();
            if opaque == 0 || opaque == blocks.len() {
                ispc::bc7_into(stripped(blocks.iter(), blocks.len(), strip), opaque > 0, out);
                return;
            }
            for (wanted, count) in [(true, opaque), (false, blocks.len() - opaque)] {
                let some = blocks.iter().filter(|block| is_opaque(block) == wanted);
                let made = ispc::bc7(stripped(some, count, strip), wanted);
                let places = out.chunks_exact_mut(format.block_bytes()).zip(blocks);
                let places = places.filter(|(_, block)| is_opaque(block) == wanted);
                for ((place, _), made) in places.zip(made.chunks_exact(format.block_bytes())) {
                    place.copy_from_slice(made);
                }
            }
        }
    }
}

/// `count` blocks side by side, as the kernels take them.
fn stripped<'s, 'b>(
    blocks: impl Iterator<Item = &'b BlockTexels>,
    count: usize,
    strip: &'s mut Vec<u8>,
) -> Texels<'s> {
    strip.clear();
    strip.resize(count * 64, 0);
    for (i, block) in blocks.enumerate() {
        for (row, texels) in block.chunks_exact(4).enumerate() {
            let at = (row * count + i) * 16;
            strip[at..at + 16].copy_from_slice(texels.as_flattened());
        }
    }
    Texels { side: [4 * count as u32, 4], rgba: strip }
}

/// One block of BC1 by range fit.
fn fit(texels: &BlockTexels, block: &mut [u8]) {
    let params = Params {
        algorithm: Algorithm::RangeFit,
        weights: COLOUR_WEIGHTS_UNIFORM,
        weigh_colour_by_alpha: false,
    };
    Format::Bc1.compress_block_masked(*texels, 0xffff, params, block);
}

/// Hands every block and its texels to `work`.
fn for_blocks(texels: Texels<'_>, blocks: &mut [u8], mut work: impl FnMut(&BlockTexels, &mut [u8])) {
    let across = texels.side[0] as usize / 4;
    let (rgba, _) = texels.rgba.as_chunks::<4>();
    for (i, block) in blocks.chunks_exact_mut(TileFormat::Bc1.block_bytes()).enumerate() {
        let corner = i / across * 16 * across + i % across * 4;
        let texels = std::array::from_fn(|t| rgba[corner + t / 4 * 4 * across + t % 4]);
        work(&texels, block);
    }
}

/// Intel's kernels, where there are any.
#[cfg(all(
    feature = "ispc",
    any(
        all(target_os = "linux", target_env = "gnu"),
        target_os = "macos",
        all(target_os = "windows", target_env = "msvc")
    ),
    any(target_arch = "x86_64", target_arch = "aarch64")
))]
mod ispc {
    use super::Texels;
    use intel_tex_2::{RgbaSurface, bc1, bc7};

    pub(super) const IS_HERE: bool = true;

    #[expect(unsafe_code, reason = "the only place where a library can be named; it declares nothing")]
    // SAFETY: the block is empty. The crate's archives hold a C++ object and do not name the library it needs.
    #[cfg_attr(target_os = "linux", link(name = "stdc++"))]
    #[cfg_attr(target_os = "macos", link(name = "c++"))]
    unsafe extern "C" {}

    fn surface(texels: Texels<'_>) -> RgbaSurface<'_> {
        let [width, height] = texels.side;
        RgbaSurface { data: texels.rgba, width, height, stride: width * 4 }
    }

    pub(super) fn bc1(texels: Texels<'_>) -> Vec<u8> {
        bc1::compress_blocks(&surface(texels))
    }

    pub(super) fn bc1_into(texels: Texels<'_>, blocks: &mut [u8]) {
        bc1::compress_blocks_into(&surface(texels), blocks);
    }

    fn settings(is_opaque: bool) -> bc7::EncodeSettings {
        if is_opaque { bc7::opaque_very_fast_settings() } else { bc7::alpha_very_fast_settings() }
    }

    pub(super) fn bc7(texels: Texels<'_>, is_opaque: bool) -> Vec<u8> {
        bc7::compress_blocks(&settings(is_opaque), &surface(texels))
    }

    pub(super) fn bc7_into(texels: Texels<'_>, is_opaque: bool, blocks: &mut [u8]) {
        bc7::compress_blocks_into(&settings(is_opaque), &surface(texels), blocks);
    }
}

#[cfg(not(all(
    feature = "ispc",
    any(
        all(target_os = "linux", target_env = "gnu"),
        target_os = "macos",
        all(target_os = "windows", target_env = "msvc")
    ),
    any(target_arch = "x86_64", target_arch = "aarch64")
)))]
mod ispc {
    use super::Texels;

    pub(super) const IS_HERE: bool = false;

    pub(super) fn bc1(_: Texels<'_>) -> Vec<u8> {
        Vec::new()
    }

    pub(super) fn bc1_into(_: Texels<'_>, _: &mut [u8]) {}

    pub(super) fn bc7(_: Texels<'_>, _: bool) -> Vec<u8> {
        Vec::new()
    }

    pub(super) fn bc7_into(_: Texels<'_>, _: bool, _: &mut [u8]) {}
}

#[cfg(test)]
mod tests {
    use super::super::decode_tile;
    use super::*;

    const SIDE: u32 = 512;

    fn tile(mut texel: impl FnMut(u32, u32) -> [u8; 4]) -> Vec<u8> {
        (0..SIDE * SIDE).flat_map(|i| texel(i % SIDE, i / SIDE)).collect()
    }

    fn psnr_db(a: &[u8], b: &[u8]) -> f64 {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
        10.0 * (255.0 * 255.0 * a.len() as f64 / sum).log10()
    }

    #[test]
    fn smooth_colours_come_back() {
        let wave = |x: u32, y: u32, f: f64| ((f64::from(x) * f).sin() + (f64::from(y) * f).cos()) * 20.0;
        let rgba = tile(|x, y| {
            [
                (120.0 + wave(x, y, 0.05)) as u8,
                (100.0 + wave(x, y, 0.06)) as u8,
                (80.0 + wave(x, y, 0.04)) as u8,
                255,
            ]
        });
        let texels = Texels { side: [SIDE, SIDE], rgba: &rgba };
        for (format, wanted_db) in
            [(TileFormat::Bc1, 40.0), (TileFormat::Bc7, 45.0), (TileFormat::Rgba8, 99.0)]
        {
            if check_format(format).is_err() {
                continue;
            }
            let back = decode_tile(format, &encode(format, texels)).unwrap();
            let found = psnr_db(&rgba, &back);
            assert!(found >= wanted_db, "{format:?}: {found:.1} dB");
            // BC7 may store an alpha of 255 as 254.
            assert!(back.chunks_exact(4).all(|texel| texel[3] >= 254), "{format:?}");
        }
    }

    #[test]
    fn half_transparent_blocks_keep_their_holes() {
        let hole = |x: u32, y: u32| (x * 7 + y * 3) % 11 < 4;
        let rgba = tile(|x, y| {
            if hole(x, y) {
                [0; 4]
            } else {
                [(x / 2) as u8, 90, (y / 2) as u8, if x > 256 { 255 } else { 140 }]
            }
        });
        let texels = Texels { side: [SIDE, SIDE], rgba: &rgba };
        for format in [TileFormat::Bc1, TileFormat::Bc7] {
            if check_format(format).is_err() {
                continue;
            }
            let back = decode_tile(format, &encode(format, texels)).unwrap();
            for (i, texel) in (0..).zip(back.chunks_exact(4)) {
                let (x, y) = (i % SIDE, i / SIDE);
                assert_eq!(is_transparent(TileFormat::Bc1, texel[3]), hole(x, y), "{format:?} {x} {y}");
            }
        }
    }
}
