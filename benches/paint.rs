//! What it costs to paint on a draped picture.
//!
//! Question: how long does a scorch of 64 x 64 texels take, decoded, painted and encoded in all levels and tiles, on one thread: with its tiles in memory, and with
//! tiles that have to be read; and what does a commit make of it? Data: a terrain file with imagery, named on the command line; else one of 4,096 x 4,096 texels is
//! made. Command:
//!
//!     cargo bench --bench paint -- [TERRAIN.iqt] [--scorches 1000]
//!
//! Places are spread over the whole picture by hashes, in any relation to blocks and tiles. "In memory" paints each place a second time, so that its tiles are here and
//! are painted already. Nothing is written. Prints Markdown. Keep runs under benches/runs/.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::imagery::{
    DrapeOptions, ImageSource, Imagery, MemoryImage, Paint, Painter, Scorch, drape,
};
use terrasoar_layout::mix::mixed_32;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

type Failure = Box<dyn std::error::Error>;

/// Texels across a scorch.
const TEXELS: f64 = 64.0;

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let mut scorches = 1000;
    let mut path = None;
    while let Some(word) = words.next() {
        match word.as_str() {
            "--scorches" => scorches = words.next().ok_or("--scorches wants a number")?.parse()?,
            _ => path = Some(PathBuf::from(word)),
        }
    }
    let folder = tempfile::tempdir()?;
    let path = match path {
        Some(path) => path,
        None => made(folder.path().join("a.iqt"))?,
    };
    let terrain = Arc::new(Terrain::open_unmapped(&path)?);
    let shape = Imagery::open(&terrain)?.ok_or("the file has no imagery")?.shape();
    let [wide, high] = shape.texels;
    println!(
        "{wide} x {high} texels of {}, {} levels; {scorches} scorches of 64 x 64 texels\n",
        shape.format.name(),
        shape.levels
    );
    println!("| tiles | median us | 99 % us | most us |");
    println!("|---|---|---|---|");
    let mut painter = Painter::open(Arc::clone(&terrain))?.ok_or("the file has no imagery")?;
    let (mut first, mut again, mut commits) = (Vec::new(), Vec::new(), Vec::new());
    let mut tiles = 0;
    for i in 0..scorches {
        let part = |seed: u32| f64::from(mixed_32(i ^ mixed_32(seed)) >> 8) / f64::from(1 << 24);
        let centre_m = [0, 1].map(|axis| {
            let texels = f64::from(shape.texels[axis]);
            let at = TEXELS + part(axis as u32) * (texels - 2.0 * TEXELS);
            shape.origin_m[axis] + at * shape.texel_m[axis]
        });
        let paint = Paint::Scorch(Scorch {
            centre_m,
            radius_m: TEXELS / 2.0 * shape.texel_m[0],
            direction_deg: 360.0 * part(2),
            strength: 0.5,
        });
        for times in [&mut first, &mut again] {
            let start = Instant::now();
            tiles += painter.paint(&[paint])?.tiles.len();
            times.push(start.elapsed().as_secs_f64() * 1e6);
        }
        if i % 50 == 0 {
            let start = Instant::now();
            let section = painter.section(terrain.header().file_bytes.div_ceil(4096) as u32)?;
            commits.push((section.map_or(0, |s| s.bytes.len()), start.elapsed().as_secs_f64() * 1e3));
            // Nothing is written, so what was painted is dropped.
            painter = Painter::open(Arc::clone(&terrain))?.ok_or("the file has no imagery")?;
        }
    }
    line("read when first touched", first);
    line("in memory", again);
    let (bytes, ms) = commits.first().copied().unwrap_or_default();
    println!(
        "\n{:.1} tiles a scorch. The section of one scorch: {bytes} bytes in {ms:.1} ms.",
        tiles as f64 / f64::from(2 * scorches)
    );
    Ok(())
}

fn line(what: &str, mut times_us: Vec<f64>) {
    times_us.sort_by(f64::total_cmp);
    let at = |part: f64| times_us[((times_us.len() - 1) as f64 * part) as usize];
    println!("| {what} | {:.0} | {:.0} | {:.0} |", at(0.5), at(0.99), at(1.0));
}

fn made(path: PathBuf) -> Result<PathBuf, Failure> {
    let dem = MemoryDem::from_fn([257, 257], SampleType::I16, |x, y| f64::from(x * y % 97));
    build(&dem, &path, &BuildOptions::default().spacing_m([16.0; 2]), &Silent)?;
    let picture = MemoryImage::from_fn([4096, 4096], |x, y| {
        let grain = (mixed_32(x ^ mixed_32(y)) >> 28) as u8;
        [90 + (x / 40 % 60) as u8 + grain, 100 + (y / 50 % 60) as u8 + grain, 60 + grain, 255]
    });
    let pictures: Vec<Box<dyn ImageSource>> = vec![Box::new(picture)];
    drape(&path, &pictures, &DrapeOptions::default(), &Silent)?;
    Ok(path)
}
