//! What paint must make of a picture: whole decoded levels painted texel by texel, and all that is compared with them.

use super::drape::{draped, land};
use super::paint::{Canvas, Seen, linear, painter_of, srgb};
use terrasoar_layout::imagery::{
    DrapeOptions, Extent, Fill, MemoryImage, Paint, Region, Scorch, TileFormat, TileId,
};

pub const FORMATS: [TileFormat; 3] = [TileFormat::Bc1, TileFormat::Bc7, TileFormat::Rgba8];
/// Three tiles by two, not a whole number of blocks; two levels more.
pub const SIZE: [u32; 2] = [1102, 531];

/// A file with a picture of 1 m a texel, or nothing if this build cannot make its blocks.
pub fn file(format: TileFormat, image: MemoryImage, [wide, high]: [u32; 2]) -> Option<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let extent = Some(Extent::Metres([0.0, 0.0, f64::from(wide), f64::from(high)]));
    let options = DrapeOptions::default().format(format).extent(extent);
    match draped(&path, image, &options) {
        Ok(_) => Some(std::fs::read(path).unwrap()),
        Err(error) => {
            assert!(format == TileFormat::Bc7 && error.to_string().contains("encoder"), "{error}");
            None
        }
    }
}

pub fn wave(x: u32, y: u32, f: f64) -> u8 {
    ((f64::from(x) * f).sin() * 45.0 + (f64::from(y) * f * 0.7).cos() * 45.0 + 130.0) as u8
}

pub fn smooth(has_alpha: bool) -> MemoryImage {
    MemoryImage::from_fn(SIZE, |x, y| {
        // Whole tiles, blocks in part, and single texels.
        let is_hole = x < 530 && y > 15 || x > 700 && (x / 37 + y / 29) % 4 == 0;
        let alpha = if has_alpha && is_hole { 0 } else { 255 };
        [wave(x, y, 0.02), wave(x, y, 0.021), wave(x, y, 0.018), alpha]
    })
}

pub fn disc(east: f64, north: f64, radius_m: f64) -> Region {
    Region::Disc { centre_m: [east, north], radius_m }
}

pub fn fill(region: Region, colour: [u8; 3], opacity: f64, falloff_m: f64) -> Paint {
    Paint::Fill(Fill { region, colour, opacity, falloff_m })
}

pub fn scorch(east: f64, north: f64, radius_m: f64) -> Paint {
    Paint::Scorch(Scorch { centre_m: [east, north], radius_m, direction_deg: 40.0, strength: 0.9 })
}

pub const EVERYTHING: Region = Region::Rect { from_m: [-10.0, -10.0], to_m: [5000.0, 5000.0] };

/// What level 0 ought to be: paint on plain texels that are the picture's as they are decoded.
pub fn finest_reference(before: &Canvas, format: TileFormat, paint: &Paint) -> Canvas {
    let size = before.size();
    let image = MemoryImage::from_fn(size, |x, y| before.at(x as i32, (size[1] - 1 - y) as i32));
    let mut painter = painter_of(file(TileFormat::Rgba8, image, size).unwrap());
    painter.paint(&[*paint]).unwrap();
    let mut canvas = Seen::of(&painter).levels.swap_remove(0);
    if format == TileFormat::Bc1 {
        canvas.texels.iter_mut().for_each(|t| {
            *t = if t[3] < 128 { [0; 4] } else { [t[0], t[1], t[2], 255] };
        });
    }
    canvas
}

/// A canvas as the encoder leaves it.
pub fn encoded(canvas: &Canvas, format: TileFormat) -> Canvas {
    let size = canvas.size();
    let image = MemoryImage::from_fn(size, |x, y| canvas.at(x as i32, (size[1] - 1 - y) as i32));
    Seen::of(&painter_of(file(format, image, size).unwrap())).levels.swap_remove(0)
}

/// Root of the mean square difference of a block of two canvases, colours weighted by how much of them is seen: the colour of a nearly transparent texel, which
/// comes from next to nothing, is rounded by whole steps.
pub fn difference(a: &Canvas, b: &Canvas, [bx, by]: [i32; 2]) -> f64 {
    let mut sum = 0.0;
    for (x, y) in (0..4).flat_map(|v| (0..4).map(move |u| (4 * bx + u, 4 * by + v))) {
        let (a, b) = (a.at(x, y), b.at(x, y));
        let seen = f64::from(a[3].max(b[3])) / 255.0;
        let weight = |c: usize| if c == 3 { 1.0 } else { seen };
        sum += (0..4).map(|c| (weight(c) * f64::from(a[c].abs_diff(b[c]))).powi(2)).sum::<f64>();
    }
    (sum / 64.0).sqrt()
}

/// Checks what one paint made of a picture.
pub fn check(before: &Seen, after: &Seen, changed: &[TileId], paint: &Paint) {
    let format = before.shape.format;
    let mut reference = finest_reference(&before.levels[0], format, paint);
    let mut may: Vec<bool> =
        reference.texels.iter().zip(&before.levels[0].texels).map(|(a, b)| a != b).collect();
    for level in 0..before.shape.levels {
        let (old, new) = (&before.levels[level as usize], &after.levels[level as usize]);
        // Half seen: a block of BC1 has to choose, and rounding does.
        let mut ties = vec![false; old.texels.len()];
        if level > 0 {
            let below = &after.levels[level as usize - 1];
            let mut over = vec![false; old.texels.len()];
            reference = old.clone();
            for y in 0..old.high {
                for x in 0..old.wide {
                    let four = [(0, 0), (1, 0), (0, 1), (1, 1)]
                        .map(|(dx, dy)| [(2 * x + dx).min(below.wide - 1), (2 * y + dy).min(below.high - 1)]);
                    if four.iter().any(|[x, y]| may[(y * below.wide + x) as usize]) {
                        over[(y * old.wide + x) as usize] = true;
                        let mut mean = [0.0; 4];
                        for texel in four.map(|[x, y]| below.at(x, y).map(f64::from)) {
                            let alpha = texel[3] / 255.0;
                            (0..3).for_each(|c| mean[c] += linear(texel[c]) * alpha / 4.0);
                            mean[3] += alpha / 4.0;
                        }
                        let alpha = mean[3];
                        ties[(y * old.wide + x) as usize] =
                            format == TileFormat::Bc1 && (alpha - 0.5).abs() < 0.01;
                        let texel = [0, 1, 2, 3].map(|c| match c {
                            3 => (255.0 * alpha).round() as u8,
                            _ => srgb(mean[c] / alpha).round() as u8,
                        });
                        reference.texels[(y * old.wide + x) as usize] = match format {
                            TileFormat::Bc1 if texel[3] < 128 => [0; 4],
                            TileFormat::Bc1 => [texel[0], texel[1], texel[2], 255],
                            _ if texel[3] == 0 => [0; 4],
                            _ => texel,
                        };
                    }
                }
            }
            may = over;
        }
        let best = encoded(&reference, format);
        for (bx, by) in (0..(old.high + 3) / 4).flat_map(|y| (0..(old.wide + 3) / 4).map(move |x| (x, y))) {
            let places = (0..16).map(|i| [4 * bx + i % 4, 4 * by + i / 4]);
            let is_touched = places
                .filter(|[x, y]| *x < old.wide && *y < old.high)
                .any(|[x, y]| may[(y * old.wide + x) as usize]);
            let is_tied = (0..16)
                .map(|i| [4 * bx + i % 4, 4 * by + i / 4])
                .filter(|[x, y]| *x < old.wide && *y < old.high)
                .any(|[x, y]| ties[(y * old.wide + x) as usize]);
            if !is_touched || is_tied {
                continue;
            }
            let found = difference(new, &reference, [bx, by]);
            // What the encoder leaves of the reference, and steps of rounding: whole numbers below whole numbers.
            let most = difference(&best, &reference, [bx, by]) + 2.5;
            assert!(found <= most, "{format:?} level {level} block {bx} {by}: {found} where {most} may be");
        }
        // All copies, and whatever is not touched.
        for id in before.shape.ids().filter(|id| id.level == level) {
            let mut is_changed = false;
            for (place, block, was, is) in Seen::blocks(before, after, id) {
                let texels = (0..16).map(|i| [4 * block[0] + i % 4, 4 * block[1] + i / 4]);
                let clamped = texels.map(|[x, y]| [x.clamp(0, old.wide - 1), y.clamp(0, old.high - 1)]);
                let is_touched = clamped.clone().any(|[x, y]| may[(y * old.wide + x) as usize]);
                assert!(is_touched || was == is, "{format:?} {id:?} {place:?} is not touched, yet changed");
                is_changed |= was != is;
                if was == is {
                    continue;
                }
                let inside = [(block[0], old.wide), (block[1], old.high)]
                    .iter()
                    .all(|(b, end)| *b >= 0 && 4 * b < *end);
                if inside {
                    assert_eq!(is, after.home_block(level, block), "{format:?} {id:?} {place:?}: a seam");
                } else {
                    for (i, [x, y]) in clamped.enumerate() {
                        let (found, wanted) = (is[i], reference.at(x, y));
                        let alike = (0..4).all(|c| found[c].abs_diff(wanted[c]) <= 24);
                        assert!(
                            alike || found[3] == 0 && wanted[3] == 0,
                            "{id:?} {place:?}: {found:?} {wanted:?}"
                        );
                    }
                }
            }
            // Other bytes may show the same texels.
            assert!(changed.contains(&id) || !is_changed, "{format:?} {id:?}");
        }
    }
}

/// Places that matter: inside, four tiles' common corner, the picture's corners and edges, beyond them, across all of it.
pub fn paints() -> Vec<Paint> {
    vec![
        scorch(300.0, 200.0, 32.0),
        fill(disc(504.3, 503.8, 21.0), [200, 30, 60], 0.7, 6.0),
        scorch(1102.0, 531.0, 20.0),
        fill(disc(0.0, 0.0, 9.0), [10, 240, 30], 1.0, 0.0),
        fill(disc(1007.0, 0.0, 12.0), [255, 255, 255], 0.5, 3.0),
        scorch(-5.0, 300.0, 13.0),
        fill(Region::Rect { from_m: [480.0, 100.0], to_m: [1010.0, 140.0] }, [90, 80, 20], 0.8, 10.0),
        fill(disc(700.5, 300.5, 0.1), [0, 0, 0], 1.0, 0.0),
    ]
}
