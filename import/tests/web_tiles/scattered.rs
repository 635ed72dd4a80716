//! Tiles at the ends of the world, in the largest square that a terrain can be: what lies between is passed over, in every kind of archive.

use crate::make::{self, Pm, Tiles, folder, hills, mapbox, pmtiles, tiles};
use std::path::PathBuf;
use std::sync::Mutex;
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, PictureOptions, TileOptions, open_images, open_with};
use terrasoar_layout::LayoutError;
use terrasoar_layout::dem::{SampleSink, Window};

const SIDE: u32 = 32;
/// Columns and rows of tiles.
const WORLD: u32 = 1 << 15;
const BOUNDS: [f64; 4] = [-180.0, -85.06, 180.0, 85.06];

/// Samples that came, of which those at some places are kept.
struct Looking {
    places: Vec<[u32; 2]>,
    found: Mutex<(Vec<Option<f64>>, u64, u64, u64)>,
}

impl SampleSink for Looking {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let mut found = self.found.lock().unwrap();
        for (at, [col, row]) in self.places.iter().enumerate() {
            let [x, y] = [col.wrapping_sub(window.col), row.wrapping_sub(window.row)];
            if x < window.width && y < window.height {
                assert_eq!(found.0[at], None, "twice");
                found.0[at] = Some(samples[(y * window.width + x) as usize]);
            }
        }
        found.1 += samples.len() as u64;
        found.2 += samples.len() as u64;
        Ok(())
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        let mut found = self.found.lock().unwrap();
        found.1 += u64::from(window.width) * u64::from(window.height);
        found.3 += 1;
        Ok(())
    }
}

fn scattered() -> Tiles {
    let texel = |col: u64, row: u64| mapbox(hills(col, row));
    let mut made = tiles(15, 0..3, 1..3, SIDE, texel);
    made.extend(tiles(15, WORLD - 1..WORLD, WORLD - 2..WORLD, SIDE, texel));
    made.extend(tiles(15, 9000..9002, 20_000..20_001, SIDE, texel));
    // A plain of 500 m in coarser tiles, which stand in for 16 finer ones each.
    made.extend(tiles(13, 5000..5001, 300..302, SIDE, |_, _| mapbox(5000)));
    made
}

#[test]
fn what_lies_between_tiles_far_apart_is_passed_over() {
    let folder_of = tempdir().unwrap();
    let made = scattered();
    let mut archives: Vec<PathBuf> = vec![
        folder(&folder_of.path().join("xyz"), &made, ".png", false),
        pmtiles(&folder_of.path().join("a.pmtiles"), &made, "{}", BOUNDS, Pm { leaf: 2, ..Pm::PLAIN }),
    ];
    #[cfg(feature = "mbtiles")]
    for is_view in [false, true] {
        let path = folder_of.path().join(format!("{is_view}.mbtiles"));
        archives.push(make::mbtiles(&path, &made, &[("format", "png")], is_view));
    }
    // From the first row that has a tile, which is the second.
    let top = SIDE;
    let hill = |col: u32, row: u32| Some(hills(col.into(), (row + top).into()) as f64 / 10.0);
    let end = WORLD * SIDE - 1;
    let wanted = [
        ([0, 0], hill(0, 0)),
        ([95, 63], hill(95, 63)),
        ([96, 63], None),
        ([end, end - top], hill(end, end - top)),
        ([end - SIDE, end - top], None),
        ([9001 * SIDE + 7, 20_000 * SIDE - top + 9], hill(9001 * SIDE + 7, 20_000 * SIDE - top + 9)),
        ([5000 * 4 * SIDE, 300 * 4 * SIDE - top], Some(500.0)),
        ([5001 * 4 * SIDE - 1, 302 * 4 * SIDE - top - 1], Some(500.0)),
        ([5001 * 4 * SIDE, 302 * 4 * SIDE - top - 1], None),
        ([500_000, 500_000], None),
    ];
    let options = OpenOptions {
        decode: Some("mapbox".into()),
        tiles: TileOptions { zoom: Some(15), ..TileOptions::default() },
        ..OpenOptions::default()
    };
    for path in archives {
        let dem = open_with(std::slice::from_ref(&path), &options).unwrap();
        let places: Vec<[u32; 2]> = wanted.iter().map(|(at, _)| *at).collect();
        let looking = Looking { found: Mutex::new((vec![None; places.len()], 0, 0, 0)), places };
        dem.stream(&looking).unwrap();
        let (found, samples, heights, voids) = looking.found.into_inner().unwrap();
        for ((at, wanted), found) in wanted.iter().zip(found) {
            assert_eq!(found, *wanted, "{} {at:?}", path.display());
        }
        assert_eq!(samples, u64::from(end + 1) * u64::from(end + 1 - top));
        // Ten tiles, and twice sixteen.
        assert_eq!(heights, 42 * u64::from(SIDE * SIDE));
        assert!(voids < 8000, "{voids}");

        // A picture of as many holes is none.
        let pictures = PictureOptions { tiles: options.tiles.clone(), ..PictureOptions::default() };
        let refused = open_images(&[path], None, &pictures).err().unwrap().to_string();
        assert!(refused.contains("lie scattered over 32768 x 32767 places"), "{refused}");
    }
}
