//! Header and tag directory of an uncompressed GeoTIFF whose rows of heights, or tiles of colour, follow without a gap.
//!
//! Nothing depends on the samples, so the header can be written first and the rest streamed after it.
//! Files beyond 4 GiB are BigTIFF. Layout: header, directory, values that do not fit into it, rows or tiles.

use super::HEIGHT_SCALE;
use crate::tiff_tags::{CLASSIC_BYTES, LONG, LONG8, SHORT, Tags};
use terrasoar_layout::dem::HorizontalUnit;
use terrasoar_layout::file::header::Header;

/// What heights call their reference system.
const CITATION: &str = "Terrasoar synthetic terrain, local metres|";
/// What pictures call theirs.
const COLOUR_CITATION: &str = "Terrasoar synthetic colour|";

/// Bytes of a strip, about.
const STRIP_BYTES: u64 = 1 << 17;

/// The bytes before the first row of a grid of `size` x `size` 16-bit samples.
pub(super) fn header(size: u32, spacing_m: f64) -> Vec<u8> {
    let row_bytes = u64::from(size) * 2;
    let big = row_bytes * u64::from(size) > CLASSIC_BYTES;
    let rows_per_strip = (STRIP_BYTES / row_bytes).clamp(1, u64::from(size));
    let strips = u64::from(size).div_ceil(rows_per_strip);
    let strip_rows = |strip: u64| rows_per_strip.min(u64::from(size) - strip * rows_per_strip);
    let place = if big { LONG8 } else { LONG };
    let sizes: Vec<u64> = (0..strips).map(|strip| strip_rows(strip) * row_bytes).collect();

    let mut tags = Tags::new(big);
    tags.numbers(256, LONG, &[u64::from(size)]);
    tags.numbers(257, LONG, &[u64::from(size)]);
    tags.numbers(258, SHORT, &[16]);
    tags.numbers(259, SHORT, &[1]);
    tags.numbers(262, SHORT, &[1]);
    tags.numbers(277, SHORT, &[1]);
    tags.numbers(278, LONG, &[rows_per_strip]);
    tags.numbers(279, place, &sizes);
    tags.numbers(339, SHORT, &[1]);
    tags.reals(33550, &[spacing_m, spacing_m, 0.0]);
    // The first sample is the north-west corner, `PixelIsPoint`; the south-west one is the origin.
    tags.reals(33922, &[0.0, 0.0, 0.0, 0.0, f64::from(size - 1) * spacing_m, 0.0]);
    tags.numbers(
        34735,
        SHORT,
        &[
            [1, 1, 0, 5],
            [1024, 0, 1, 1],
            [1025, 0, 1, 2],
            [1026, 34737, CITATION.len() as u64, 0],
            [3072, 0, 1, 32767],
            [3076, 0, 1, 9001],
        ]
        .concat(),
    );
    tags.text(34737, CITATION);
    tags.text(
        42112,
        &format!(
            "<GDALMetadata>\n  <Item name=\"SCALE\" sample=\"0\" role=\"scale\">{HEIGHT_SCALE}</Item>\n  \
             <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">m</Item>\n</GDALMetadata>\n"
        ),
    );

    with_places(tags, 273, &sizes)
}

/// The bytes before the first tile of an RGB picture of `texels` (east, north) in tiles of `side` texels: it covers the terrain of `terrain`, `fine`
/// texels a sample, in the terrain's reference system, or in metres from its south-west sample.
pub(super) fn colour_header(texels: [u32; 2], side: u32, terrain: &Header, fine: u32) -> Vec<u8> {
    let [dx, dy] = terrain.grid.spacing_m();
    let samples = terrain.sample_to_crs.unwrap_or([0.0, dx, 0.0, 0.0, 0.0, dy]);
    // A texel east is a share of a sample east; a row south one of a sample south, from the north-west sample.
    let north = f64::from(terrain.grid.samples()[1] - 1);
    let [x, xe, xn, y, ye, yn] = samples;
    let share = 1.0 / f64::from(fine);
    let [east, south] = [[xe * share, ye * share], [-xn * share, -yn * share]];
    let corner = [x + xn * north, y + yn * north];
    let place = [
        [east[0], south[0], 0.0, corner[0]],
        [east[1], south[1], 0.0, corner[1]],
        [0.0; 4],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let degrees = terrain.crs_unit == HorizontalUnit::Degree;
    let code = u64::from(terrain.epsg.filter(|code| *code <= 65535).unwrap_or(32767));
    let unit = match terrain.crs_unit {
        HorizontalUnit::Degree => [2054, 0, 1, 9102],
        HorizontalUnit::Foot => [3076, 0, 1, 9002],
        HorizontalUnit::UsSurveyFoot => [3076, 0, 1, 9003],
        HorizontalUnit::Unknown | HorizontalUnit::Metre => [3076, 0, 1, 9001],
    };
    let [model, system] = if degrees { [2, 2048] } else { [1, 3072] };
    let mut keys = vec![[1024, 0, 1, model], [1025, 0, 1, 1], [1026, 34737, COLOUR_CITATION.len() as u64, 0]];
    keys.extend([[system, 0, 1, code], unit]);
    keys.sort_unstable();
    keys.insert(0, [1, 1, 0, keys.len() as u64]);
    placed_colour_header(texels, side, &place.concat(), &keys.concat())
}

/// As [`colour_header`], of a picture that lies where these 16 numbers of a transformation and these keys of a reference system say.
pub(super) fn placed_colour_header(texels: [u32; 2], side: u32, place: &[f64], keys: &[u64]) -> Vec<u8> {
    let tiles = texels.map(|texels| u64::from(texels.div_ceil(side)));
    let sizes = vec![u64::from(side).pow(2) * 3; (tiles[0] * tiles[1]) as usize];
    let big = sizes.iter().sum::<u64>() > CLASSIC_BYTES;

    let mut tags = Tags::new(big);
    tags.numbers(256, LONG, &[u64::from(texels[0])]);
    tags.numbers(257, LONG, &[u64::from(texels[1])]);
    tags.numbers(258, SHORT, &[8, 8, 8]);
    tags.numbers(259, SHORT, &[1]);
    tags.numbers(262, SHORT, &[2]);
    tags.numbers(277, SHORT, &[3]);
    tags.numbers(284, SHORT, &[1]);
    tags.numbers(322, LONG, &[u64::from(side)]);
    tags.numbers(323, LONG, &[u64::from(side)]);
    tags.numbers(325, if big { LONG8 } else { LONG }, &sizes);
    tags.numbers(339, SHORT, &[1, 1, 1]);
    tags.reals(34264, place);
    tags.numbers(34735, SHORT, keys);
    tags.text(34737, COLOUR_CITATION);
    with_places(tags, 324, &sizes)
}

/// The bytes of a file before its strips or tiles of `sizes`, whose places go into `tag`. These follow from the length of what stands before, which they do not change.
fn with_places(mut tags: Tags, tag: u16, sizes: &[u64]) -> Vec<u8> {
    let kind = if tags.is_big() { LONG8 } else { LONG };
    tags.numbers(tag, kind, sizes);
    let start = tags.file().len() as u64;
    let places: Vec<u64> = sizes
        .iter()
        .scan(start, |next, size| {
            let place = *next;
            *next += size;
            Some(place)
        })
        .collect();
    tags.numbers(tag, kind, &places);
    tags.file()
}
