//! How long does a terrain file take to open? `cargo bench -p terrasoar-layout --bench opening -- FILE` for a file that there is; the median of many openings, all of them after the first, in milliseconds.

use std::path::Path;
use std::time::Instant;
use terrasoar_layout::read::terrain::Terrain;

const ROUNDS: usize = 51;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(path) = std::env::args().skip(1).find(|word| !word.starts_with('-')) else {
        println!("name a terrain file");
        return Ok(());
    };
    let mut took = Vec::with_capacity(ROUNDS);
    for _ in 0..ROUNDS {
        let begun = Instant::now();
        let terrain = Terrain::open_unmapped(Path::new(&path))?;
        took.push(begun.elapsed());
        drop(terrain);
    }
    took[1..].sort_unstable();
    let [first, median] = [took[0], took[1 + ROUNDS / 2]].map(|time| time.as_secs_f64() * 1e3);
    println!("opened in {median:.3} ms, {first:.3} ms the first time");
    Ok(())
}
