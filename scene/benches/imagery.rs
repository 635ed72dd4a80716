//! Whether the image keeps up with a flight.
//!
//! Questions: on a recorded flight at 60 frames a second, with a stated device memory for tiles, how many of the tiles that a view wants are there, by how many levels is the coarsest
//! place off, what is sent a frame, and what does that cost the processor? Data: a draped terrain and a flight. Command:
//!
//!     cargo bench -p terrasoar-scene --bench imagery -- TERRAIN.iqt FLIGHT.flight [--pool MIB] [--size WxH]
//!
//! Nothing is drawn, so that a software driver does not set the pace: the mesh is refined, tiles are asked for, read by threads, and sent. The first second is for starting from
//! nothing and is told apart. Prints Markdown. Keep runs under benches/runs/.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use terrasoar::flight::Flight;
use terrasoar::ground::{Ground, StreamOptions};
use terrasoar::view::Viewport;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::Gpu;
use terrasoar_scene::scene::{Drawn, Scene, SceneOptions, TileService};

type Failure = Box<dyn std::error::Error>;

/// Frames of the first second.
const START: usize = 60;
const SPAN: Duration = Duration::from_nanos(16_666_667);

/// What a frame saw.
struct Row {
    ideal_share: f32,
    levels_off: u32,
    bytes: u64,
    serve_ms: f64,
}

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut paths, mut pool_mib, mut size) = (Vec::new(), 64, Viewport { width_px: 1280, height_px: 720 });
    while let Some(word) = words.next() {
        match word.as_str() {
            "--pool" => pool_mib = words.next().ok_or("--pool wants MiB")?.parse::<u64>()?,
            "--size" => {
                let text = words.next().ok_or("--size wants WxH")?;
                let (width, height) = text.split_once('x').ok_or("--size wants WxH")?;
                size = Viewport { width_px: width.parse()?, height_px: height.parse()? };
            }
            _ => paths.push(PathBuf::from(word)),
        }
    }
    let [terrain, flight] = &paths[..] else {
        println!("skipped: name a draped terrain (`terrasoar drape`) and a flight");
        return Ok(());
    };
    let terrain = Arc::new(Terrain::open_unmapped(terrain)?);
    let flight = Flight::read(flight)?;
    let gpu = Gpu::headless_blocking()?;
    let options = SceneOptions::default().tiles(TileService::AFrame(0)).imagery_bytes(pool_mib << 20);
    let mut ground = Ground::streamed(terrain, &StreamOptions::default().cache_mib(128))?;
    let mut scene = Scene::new(&ground, &gpu, options)?;
    if !scene.has_image() {
        return Err("the terrain has no image; drape one over it".into());
    }
    let mut rows = Vec::new();
    let mut next = Instant::now();
    for frame in &flight.frames {
        let view = frame.view(size, 2.0);
        ground.update(&view);
        let begun = Instant::now();
        let mut drawn = Drawn::default();
        scene.serve_image(&ground, &view, &mut drawn)?;
        let serve_ms = begun.elapsed().as_secs_f64() * 1e3;
        // What was sent goes with the next submission.
        gpu.queue.submit([]);
        gpu.device.poll(terrasoar_render::wgpu::PollType::Poll)?;
        let stats = scene.renderer().imagery_stats();
        rows.push(Row {
            ideal_share: stats.ideal_share,
            levels_off: stats.most_levels_off,
            bytes: drawn.image.bytes,
            serve_ms,
        });
        next = (next + SPAN).max(Instant::now());
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    gpu.watch.check()?;
    let stats = scene.renderer().imagery_stats();
    println!(
        "{} frames of {} x {} pixels; {} tiles of {} fit {pool_mib} MiB; {} sent, {} made room\n",
        rows.len(),
        size.width_px,
        size.height_px,
        stats.resident,
        stats.capacity,
        stats.uploads,
        stats.evicted
    );
    println!(
        "| frames | wanted tiles there, mean | frames with all | least | levels off, most | sent a frame, KB, mean | most | serving, ms, median | 99 % |\n|---|---|---|---|---|---|---|---|---|"
    );
    let (first, later) = rows.split_at(START.min(rows.len()));
    tell("first second", first);
    tell("later", later);
    Ok(())
}

fn tell(name: &str, rows: &[Row]) {
    if rows.is_empty() {
        return;
    }
    let n = rows.len() as f64;
    let mut times: Vec<f64> = rows.iter().map(|r| r.serve_ms).collect();
    times.sort_by(f64::total_cmp);
    let at = |part: f64| times[((n * part) as usize).min(rows.len() - 1)];
    println!(
        "| {name} | {:.2} % | {:.1} % | {:.1} % | {} | {:.0} | {:.0} | {:.3} | {:.3} |",
        100.0 * rows.iter().map(|r| f64::from(r.ideal_share)).sum::<f64>() / n,
        100.0 * rows.iter().filter(|r| r.ideal_share >= 1.0).count() as f64 / n,
        100.0 * rows.iter().map(|r| r.ideal_share).fold(1.0, f32::min),
        rows.iter().map(|r| r.levels_off).max().unwrap_or(0),
        rows.iter().map(|r| r.bytes).sum::<u64>() as f64 / n / 1e3,
        rows.iter().map(|r| r.bytes).max().unwrap_or(0) as f64 / 1e3,
        at(0.5),
        at(0.99),
    );
}
