//! What pictures cost: the way from an engine's changes to pixels.
//!
//! Questions: how many bytes go to the device a frame, against the engine's patch; how much processor time the renderer takes a frame beside
//! the draw itself (sending the patch, tiles, recording); how long whole frames take; and how much the change of detail is seen in a slow flight, with
//! vertices that move into place and with vertices that pop. For that each step is taken apart: what the eye's motion changes over a frozen mesh, and what
//! the mesh of the new frame changes in the same view. Data: a terrain file and a flight over it. Command:
//!
//!     cargo bench -p terrasoar-scene --bench pictures -- TERRAIN.iqt FLIGHT [--frames 200] [--size 1280x720]
//!
//! Renderer and device are warm: figures leave out the first tenth of the frames. Prints Markdown and the adapter's name.

use std::path::PathBuf;
use std::time::Instant;
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::ground::{Ground, PictureEngine};
use terrasoar::refine::Culling;
use terrasoar::view::{View, Viewport};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{Gpu, Look, Offscreen, wgpu};
use terrasoar_scene::scene::{Scene, SceneOptions, TileService};

type Failure = Box<dyn std::error::Error>;

/// Tiles given a frame, as a window does.
const TILES_A_FRAME: usize = 4;
/// Share of a frame's way that a slow flight makes.
const SLOW: f64 = 0.1;
/// Steps of the slow flight.
const STEPS: usize = 200;
/// Side of a block of pixels whose mean is compared.
const BLOCK: usize = 4;

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

/// The ground of a mapped terrain.
fn mapped(terrain: &Terrain) -> Result<Ground<'_>, Failure> {
    Ok(Ground::mapped(terrain, PictureEngine::Kinetic, Culling::Vertices)?)
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
    let options = SceneOptions::default().tiles(TileService::AFrame(TILES_A_FRAME)).timestamps(true);
    let mut ground = mapped(terrain)?;
    let mut scene = Scene::new(&ground, gpu, options)?;
    let offscreen = Offscreen::new(&gpu.device, size.size_px())?;
    let look = Look::default();
    let names = [
        "patch of the engine, KB",
        "sent for it, KB",
        "sent in all, KB",
        "triangles of the mesh, thousands",
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
        let refined = ground.update(&view);
        let updated = Instant::now();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut tiles = terrasoar_scene::scene::Drawn::default();
        scene.serve_tiles(&mut ground, &view, &mut tiles)?;
        let served = Instant::now();
        // Nothing is wanted any more within the bound that was not given.
        let upload = scene.sync_mesh(&ground, &mut encoder)?;
        let draw = scene.draw(&mut encoder, offscreen.target(), &view, &look, None)?;
        let recorded = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.device.poll(wgpu::PollType::wait_indefinitely())?;
        let done = Instant::now();
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        let kb = |bytes: u64| bytes as f64 / 1e3;
        let row = [
            kb(refined.work.patch_bytes),
            kb(upload.bytes),
            kb(upload.bytes + draw.bytes + tiles.tiles[1]),
            refined.triangles as f64 / 1e3,
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

/// Means of a picture's blocks of 4 x 4 pixels, red, green and blue: an edge that steps from one pixel to the next is no large change in them, a triangle of
/// another shade is.
fn blocks(rgba: &[u8], width: usize) -> Vec<f32> {
    let (columns, lines) = (width / BLOCK, rgba.len() / (4 * width) / BLOCK);
    let mut means = vec![0.0; 3 * columns * lines];
    for (i, pixel) in rgba.as_chunks::<4>().0.iter().enumerate() {
        let (x, y) = (i % width / BLOCK, i / width / BLOCK);
        if x < columns && y < lines {
            let mean = &mut means[3 * (y * columns + x)..][..3];
            mean.iter_mut().zip(pixel).for_each(|(m, c)| *m += f32::from(*c) / (BLOCK * BLOCK) as f32);
        }
    }
    means
}

/// How two pictures differ: the largest change of a block, and how many blocks change by more than 2 of 255.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    most: f32,
    seen: u64,
}

impl Change {
    fn add(&mut self, before: &[f32], after: &[f32]) {
        for (a, b) in before.chunks_exact(3).zip(after.chunks_exact(3)) {
            let change = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            self.most = self.most.max(change);
            self.seen += u64::from(change > 2.0);
        }
    }
}

/// A flight a tenth as fast as recorded, each step taken apart: first the eye moves over the frozen mesh, then the mesh follows while the eye rests.
fn pops(terrain: &Terrain, gpu: &Gpu, flight: &[FlightFrame], size: Viewport) -> Result<(), Failure> {
    let small = Viewport { width_px: size.width_px / 2, height_px: size.height_px / 2 };
    let views: Vec<View> = (0..=STEPS)
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
        "\n| slow flight at 4 px, blocks of {BLOCK} x {BLOCK} pixels, of 255 | largest change | blocks that change by more than 2, a frame |\n|---|---|---|"
    );
    let mut changes = 0.0;
    for morph in [true, false] {
        // The haze hides little: what is measured is the ground.
        let look = Look::named("hillshade").unwrap_or_default().morph(morph).tile_normals(false);
        let mut ground = mapped(terrain)?;
        let mut scene = Scene::new(&ground, gpu, SceneOptions::default())?;
        let offscreen = Offscreen::new(&gpu.device, small.size_px())?;
        let picture = |scene: &mut Scene,
                       ground: &mut Ground<'_>,
                       view: &View,
                       refined_for: Option<&View>|
         -> Result<Vec<f32>, Failure> {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            scene.sync(ground, &mut encoder, view, &look)?;
            scene.draw(&mut encoder, offscreen.target(), view, &look, refined_for)?;
            gpu.queue.submit([encoder.finish()]);
            let rgba = offscreen.read_rgba(&gpu.device, &gpu.queue)?;
            Ok(blocks(&rgba, small.width_px as usize))
        };
        let ([mut motion, mut detail], mut work) = ([Change::default(); 2], 0);
        let Some(first) = views.first() else { return Ok(()) };
        ground.update(first);
        let mut before = picture(&mut scene, &mut ground, first, None)?;
        for [from, to] in views.array_windows() {
            let frozen = picture(&mut scene, &mut ground, to, Some(from))?;
            let did = ground.update(to).work;
            work += did.splits + did.merges;
            let refined = picture(&mut scene, &mut ground, to, None)?;
            motion.add(&before, &frozen);
            detail.add(&frozen, &refined);
            before = refined;
        }
        let word = if morph { "moving" } else { "popping" };
        let steps = (views.len().max(2) - 1) as f64;
        let rows = [("the eye's motion alone", motion), ("change of detail alone", detail)];
        for (what, Change { most, seen }) in rows {
            println!("| vertices {word}: {what} | {most:.1} | {:.2} |", seen as f64 / steps);
        }
        changes = work as f64 / steps;
    }
    println!("\nVertices split and merged a frame: {changes:.1}.");
    Ok(())
}
