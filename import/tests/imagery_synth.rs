//! Synthetic pictures of synthetic terrain: placed as the terrain is, the same for any threads, and true to the eye once they are blocks.

#[path = "../../layout/tests/common/mod.rs"]
mod common;

use common::drape::Opened;
use std::path::Path;
use terrasoar_import::open_image;
use terrasoar_import::synth::{ColourOptions, SynthOptions, write, write_colour};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::imagery::{DrapeOptions, PlaceOrigin, TileFormat, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// A terrain of 513 x 513 samples, and its picture of so many texels a sample.
fn land(folder: &Path, texels_a_sample: u32) -> [std::path::PathBuf; 2] {
    let [dem, iqt, picture] = ["a.tif", "a.iqt", "x.tif"].map(|name| folder.join(name));
    write(&SynthOptions::default().size(513).seed(3).spacing_m(40.0), &dem, &|_| {}).unwrap();
    build(&*terrasoar_import::open(&[dem]).unwrap(), &iqt, &BuildOptions::default(), &Silent).unwrap();
    let options = ColourOptions::default().seed(5).texels_a_sample(texels_a_sample);
    let texels = write_colour(&Terrain::open(&iqt).unwrap(), &options, &picture, &|_| {}).unwrap();
    assert_eq!(texels, [512 * texels_a_sample; 2]);
    [iqt, picture]
}

fn texels(picture: &Path) -> (usize, Vec<[u8; 4]>) {
    let image = open_image(picture).unwrap();
    let [wide, high] = image.info().texels.map(|side| side as usize);
    let mut rgba = vec![0; wide * high * 4];
    image.rows().unwrap().read(&mut rgba).unwrap();
    (wide, rgba.as_chunks::<4>().0.to_vec())
}

#[test]
fn pictures_lie_on_their_terrain_and_survive_compression() {
    let folder = tempfile::tempdir().unwrap();
    for (texels_a_sample, format, wanted_db) in
        [(1, TileFormat::Bc1, 40.0), (3, TileFormat::Bc1, 40.0), (2, TileFormat::Bc7, 46.0)]
    {
        let [iqt, picture] = land(folder.path(), texels_a_sample);
        let options = DrapeOptions::default().format(format);
        let done = match drape(&iqt, &[open_image(&picture).unwrap()], &options, &Silent) {
            Err(error) if format == TileFormat::Bc7 && error.to_string().contains("no encoder") => continue,
            done => done.unwrap(),
        };
        assert_eq!((done.place, done.shape.origin_m), (PlaceOrigin::Georeference, [0.0; 2]));
        let texel_m = 40.0 / f64::from(texels_a_sample);
        assert!(done.shape.texel_m.iter().all(|m| (m - texel_m).abs() < 1e-9));
        let (wide, rows) = texels(&picture);
        let opened = Opened::new(&iqt);
        let (mut sum, mut count) = (0.0, 0u32);
        for id in opened.imagery.shape().ids().filter(|id| id.level == 0) {
            let tile = opened.tile(id).unwrap();
            let [covered_x, covered_y] = opened.imagery.shape().covered_texels(id).map(|side| side as usize);
            for v in 0..covered_y {
                for u in 0..covered_x {
                    let (x, y) = (id.x as usize * 504 + u, id.y as usize * 504 + v);
                    let wanted = rows[(wide - 1 - y) * wide + x];
                    let found = tile[(v + 4) * 512 + u + 4];
                    sum += (0..3).map(|c| f64::from(found[c].abs_diff(wanted[c])).powi(2)).sum::<f64>();
                    count += 3;
                }
            }
        }
        let psnr_db = 10.0 * (255.0f64.powi(2) * f64::from(count) / sum).log10();
        assert!(psnr_db >= wanted_db, "{format:?}, {texels_a_sample} a sample: {psnr_db:.2} dB");
    }
}

#[test]
fn pictures_are_the_same_for_any_threads_and_follow_seed_and_ground() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let [_, picture] = pool.install(|| land(folder.path(), 1));
        files.push(std::fs::read(picture).unwrap());
    }
    assert!(files[0] == files[1]);
    let [iqt, picture] = land(folder.path(), 1);
    let (_, rows) = texels(&picture);
    let terrain = Terrain::open(&iqt).unwrap();
    // The sea is blue, land is not.
    let (mut sea, mut land) = (0, 0);
    for y in (0..512).step_by(7) {
        for x in (0..512).step_by(7) {
            let place = [x, y].map(|texel| (f64::from(texel) + 0.5) * 40.0);
            let height_m = terrain.height_m(place[0], place[1]).unwrap().unwrap();
            let [r, _, b, _] = rows[((511 - y) * 512 + x) as usize];
            if height_m > 6.0 {
                assert!(b < r.saturating_add(30), "{x} {y}: {height_m} m");
                land += 1;
            } else if height_m <= 0.0 {
                assert!(b > r, "{x} {y}: {height_m} m");
                sea += 1;
            }
        }
    }
    assert!(sea > 50 && land > 500, "{sea} {land}");
    let options = ColourOptions::default().seed(6);
    write_colour(&terrain, &options, &picture, &|_| {}).unwrap();
    assert!(std::fs::read(&picture).unwrap() != files[0]);
    for wrong in [0, 65] {
        let options = ColourOptions::default().texels_a_sample(wrong);
        assert!(write_colour(&terrain, &options, &picture, &|_| {}).is_err());
    }
}
