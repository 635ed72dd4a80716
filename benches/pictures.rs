//! What pictures cost: the way from an engine's changes to pixels.
//!
//! Questions: how many bytes go to the device a frame, against the engine's patch; how much processor time the renderer takes a frame beside
//! the draw itself (sending the patch, tiles, recording); how long whole frames take; and how much a picture changes at most from one frame to the next of
//! a slow flight, with vertices that move into place and with vertices that pop. Data: a terrain file and a flight over it. Command:
//!
//!     cargo bench --bench pictures -- TERRAIN.iqt FLIGHT [--frames 200] [--size 1280x720]
//!
//! Renderer and device are warm: figures leave out the first tenth of the frames. Prints Markdown and the adapter's name.

#[path = "../tests/pictures/app.rs"]
mod app;

use app::scene::{Scene, SceneOptions, TileService};
use std::path::PathBuf;
use std::time::Instant;
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::view::{View, Viewport};
use terrasoar_layout::terrain::Terrain;
use terrasoar_render::{Gpu, Look, Offscreen, wgpu};

type Failure = Box<dyn std::error::Error>;

/// Tiles given a frame, as a window does.
const TILES_A_FRAME: usize = 4;
/// Share of a frame's way that a slow flight makes.
const SLOW: f64 = 0.1;

struct Plan {
    terrain: PathBuf,
    flight: PathBuf,
    frames: usize,
    size: Viewport,
}

fn plan() -> Result<Option<Plan>, Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut paths, mut frames, mut size) = (Vec::new(), 200, Viewport { width_px: 1280, height_px: 720 });
    while let Some(word) = words.next() {
        match word.as_str() {
            "--frames" => frames = words.next().ok_or("--frames wants a number")?.parse()?,
            "--size" => {
                let text = words.next().ok_or("--size wants WxH")?;
                let (width, height) = text.split_once('x').ok_or("--size wants WxH")?;
                size = Viewport { width_px: width.parse()?, height_px: height.parse()? };
            }
            _ => paths.push(PathBuf::from(word)),
        }
    }
    Ok(match <[PathBuf; 2]>::try_from(paths) {
        Ok([terrain, flight]) => Some(Plan { terrain, flight, frames, size }),
        Err(_) => None,
    })
}

fn main() -> Result<(), Failure> {
    let Some(plan) = plan()? else {
        println!("skipped: name a terrain file and a flight, such as ./demo leaves in demo-out/");
        return Ok(());
    };
    let gpu = match Gpu::headless_blocking() {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("skipped: {error}");
            return Ok(());
        }
    };
    let terrain = Terrain::open(&plan.terrain)?;
    let mut flight = Flight::read(&plan.flight)?.frames;
    flight.truncate(plan.frames);
    println!("adapter {} ({})", gpu.capabilities.adapter, gpu.capabilities.backend);
    println!("{} frames of {} x {} pixels\n", flight.len(), plan.size.width_px, plan.size.height_px);
    costs(&terrain, &gpu, &flight, plan.size)?;
    pops(&terrain, &gpu, &flight, plan.size)
}

/// A list of figures and its percentiles.
struct Figures(Vec<f64>);

impl Figures {
    fn row(mut self, name: &str) {
        // The first frames make buffers and compile shaders.
        self.0.drain(..self.0.len() / 10);
        self.0.sort_by(f64::total_cmp);
        let at = |share: f64| {
            self.0.get(((self.0.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(0.0)
        };
        println!("| {name} | {:.3} | {:.3} | {:.3} | {:.3} |", at(0.5), at(0.95), at(0.99), at(1.0));
    }
}

fn costs(terrain: &Terrain, gpu: &Gpu, flight: &[FlightFrame], size: Viewport) -> Result<(), Failure> {
    let options =
        SceneOptions { tiles: TileService::AFrame(TILES_A_FRAME), timestamps: true, ..Default::default() };
    let mut scene = Scene::new(terrain, gpu, options)?;
    let offscreen = Offscreen::new(&gpu.device, [size.width_px, size.height_px])?;
    let look = Look::default();
    let names = [
        "patch of the engine, KB",
        "sent for it, KB",
        "sent in all, KB",
        "triangles drawn, thousands",
        "engine's update, ms",
        "renderer without tiles, CPU, ms",
        "tiles, CPU, ms",
        "submission to picture, ms",
        "whole frame, ms",
        "device, ms",
    ];
    let mut figures: Vec<Vec<f64>> = names.map(|_| Vec::new()).to_vec();
    for frame in flight {
        let view = frame.view(size, 1.0);
        let start = Instant::now();
        let refined = scene.update(&view);
        let updated = Instant::now();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut tiles = app::scene::Drawn::default();
        scene.serve_tiles(&view, &mut tiles)?;
        let served = Instant::now();
        // Nothing is wanted any more within the bound that was not given.
        let drawn = scene.draw_served(&mut encoder, offscreen.target(), &view, &look, None)?;
        let recorded = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.device.poll(wgpu::PollType::wait_indefinitely())?;
        let done = Instant::now();
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        let kb = |bytes: u64| bytes as f64 / 1e3;
        let row = [
            kb(refined.work.patch_bytes),
            kb(drawn.upload.bytes),
            kb(drawn.upload.bytes + drawn.draw.bytes + tiles.tiles[1]),
            drawn.draw.triangles as f64 / 1e3,
            ms(start, updated),
            ms(served, recorded),
            ms(updated, served),
            ms(recorded, done),
            ms(start, done),
            scene.gpu_time_ms().unwrap_or(f64::NAN),
        ];
        figures.iter_mut().zip(row).for_each(|(list, value)| list.push(value));
    }
    gpu.watch.check()?;
    println!("| a frame | median | 95 % | 99 % | most |\n|---|---|---|---|---|");
    names.into_iter().zip(figures).for_each(|(name, list)| Figures(list).row(name));
    Ok(())
}

/// The largest change of a channel between one picture and the next, of a flight a tenth as fast as recorded.
fn pops(terrain: &Terrain, gpu: &Gpu, flight: &[FlightFrame], size: Viewport) -> Result<(), Failure> {
    let small = Viewport { width_px: size.width_px / 2, height_px: size.height_px / 2 };
    let views: Vec<View> = (0..flight.len().min(40))
        .filter_map(|i| {
            let at = i as f64 * SLOW;
            let (a, b) = (flight.get(at as usize)?, flight.get(at as usize + 1)?);
            let (a, b) = (a.view(small, 4.0), b.view(small, 4.0));
            let t = at.fract();
            Some(View {
                eye_m: a.eye_m.lerp(b.eye_m, t),
                yaw_rad: a.yaw_rad + t * (b.yaw_rad - a.yaw_rad),
                ..a
            })
        })
        .collect();
    println!(
        "\n| slow flight at 4 px, of 255 | largest change of a pixel | pixels that change by more than 16, a frame |\n|---|---|---|"
    );
    for morph in [true, false] {
        // The haze hides little: what is measured is the ground.
        let look = Look { morph, tile_normals: false, ..Look::named("hillshade").unwrap_or_default() };
        let mut scene = Scene::new(terrain, gpu, SceneOptions::default())?;
        let offscreen = Offscreen::new(&gpu.device, [small.width_px, small.height_px])?;
        let (mut before, mut most, mut large) = (Vec::new(), 0, 0_u64);
        for view in &views {
            scene.update(view);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            scene.draw(&mut encoder, offscreen.target(), view, &look, None)?;
            gpu.queue.submit([encoder.finish()]);
            let picture = offscreen.read_rgba(&gpu.device, &gpu.queue)?;
            for (a, b) in picture.as_chunks::<4>().0.iter().zip(before.as_chunks::<4>().0) {
                let change = a.iter().zip(b).map(|(a, b): (&u8, &u8)| a.abs_diff(*b)).max().unwrap_or(0);
                most = most.max(change);
                large += u64::from(change > 16);
            }
            before = picture;
        }
        let word = if morph { "moving" } else { "popping" };
        println!("| {word} | {most} | {:.1} |", large as f64 / (views.len().max(2) - 1) as f64);
    }
    Ok(())
}
