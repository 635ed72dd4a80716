//! What it costs to drape a picture, and what is left of it.
//!
//! Questions: how many bytes does a pyramid take of its picture's raw RGB, at how many MB of RGB a second and in how much memory is it made, and how close
//! are the finest level's texels to the picture's? Data: a terrain file and a picture with a place on it, named on the command line. Command:
//!
//!     cargo bench --bench drape -- TERRAIN.iqt PICTURE.tif [--formats bc1,bc7,raw]
//!
//! The terrain is copied beside itself first, and the copy removed. Times are of the whole call, until all is on the disk. Prints Markdown. Keep runs
//! under benches/runs/.

use std::path::{Path, PathBuf};
use std::time::Instant;
use terrasoar_import::open_image;
use terrasoar_layout::file::atomic::folder_of;
use terrasoar_layout::imagery::{
    BORDER_TEXELS, DrapeOptions, INNER_TEXELS, ImageSource, Imagery, TILE_TEXELS, TileFormat, TileId,
    decode_tile, drape,
};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let mut formats = "bc1,bc7".to_owned();
    let mut paths = Vec::new();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--formats" => formats = words.next().ok_or("--formats wants a list")?,
            _ => paths.push(PathBuf::from(word)),
        }
    }
    let [terrain, picture] = &paths[..] else {
        println!(
            "skipped: name a terrain file and a picture of it, such as `terrasoar synth --colour TERRAIN.iqt` makes"
        );
        return Ok(());
    };
    let picture = open_image(picture)?;
    let [wide, high] = picture.info().texels;
    println!("{wide} x {high} texels, {}; {} threads\n", picture.info().format, rayon::current_num_threads());
    println!(
        "| format | tiles | bytes | of raw RGB | s | MB of RGB a second | peak memory so far, MiB | PSNR of level 0, dB |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for word in formats.split(',') {
        let format = [TileFormat::Bc1, TileFormat::Bc7, TileFormat::Rgba8]
            .into_iter()
            .find(|format| format.name() == word)
            .ok_or("formats are bc1, bc7 and raw")?;
        measure(terrain, &*picture, format)?;
    }
    Ok(())
}

fn measure(terrain: &Path, picture: &dyn ImageSource, format: TileFormat) -> Result<(), Failure> {
    let folder = tempfile::tempdir_in(folder_of(terrain))?;
    let copy = folder.path().join("copy.iqt");
    std::fs::copy(terrain, &copy)?;
    let images = vec![open_image(picture.path())?];
    let start = Instant::now();
    let done = drape(&copy, &images, &DrapeOptions::default().format(format), &Silent)?;
    let seconds = start.elapsed().as_secs_f64();
    let peak_mib = peak_memory_mib();
    let raw = 3.0 * f64::from(done.shape.texels[0]) * f64::from(done.shape.texels[1]);
    let bytes = done.header.imagery.map_or(0, |place| place.bytes);
    println!(
        "| {} | {} | {bytes} | {:.4} | {seconds:.1} | {:.0} | {peak_mib} | {:.2} |",
        format.name(),
        done.stored_tiles,
        bytes as f64 / raw,
        raw / seconds / 1e6,
        psnr_db(&copy, picture)?
    );
    Ok(())
}

/// Most memory the process has held, where the system tells.
fn peak_memory_mib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|kb| kb.trim().trim_end_matches(" kB").parse::<u64>().ok()).map_or(0, |kb| kb >> 10)
}

/// Over all texels and the three colours, the picture read again row by row.
fn psnr_db(draped: &Path, picture: &dyn ImageSource) -> Result<f64, Failure> {
    let terrain = Terrain::open_unmapped(draped)?;
    let imagery = Imagery::open(&terrain)?.ok_or("no imagery")?;
    let shape = imagery.shape();
    let [wide, high] = shape.texels;
    let mut rows = picture.rows()?;
    let mut row = vec![0; wide as usize * 4];
    let inner = INNER_TEXELS;
    let mut tiles: (u32, Vec<Vec<u8>>) = (u32::MAX, Vec::new());
    let mut sum = 0u64;
    for y in (0..high).rev() {
        rows.read(&mut row)?;
        if tiles.0 != y / inner {
            let mut bytes = Vec::new();
            let row_of_tiles = (0..shape.tile_count(0)[0]).map(|x| {
                imagery.read_tile(&terrain, TileId { level: 0, x, y: y / inner }, &mut bytes)?;
                decode_tile(shape.format, &bytes).ok_or_else(|| Failure::from("an absent tile"))
            });
            tiles = (y / inner, row_of_tiles.collect::<Result<_, Failure>>()?);
        }
        let at = ((y % inner + BORDER_TEXELS) * TILE_TEXELS + BORDER_TEXELS) as usize * 4;
        for (wanted, tile) in row.chunks(inner as usize * 4).zip(&tiles.1) {
            let texels = wanted.chunks_exact(4).zip(tile[at..].chunks_exact(4));
            let error =
                |(a, b): (&[u8], &[u8])| (0..3).map(|c| u64::from(a[c].abs_diff(b[c])).pow(2)).sum::<u64>();
            sum += texels.map(error).sum::<u64>();
        }
    }
    let mean = sum as f64 / (3.0 * f64::from(wide) * f64::from(high));
    Ok(10.0 * (255.0f64.powi(2) / mean).log10())
}
