//! What large meshes cost a graphics card.
//!
//! Questions: with 1, 5 and 20 million triangles in the mesh, how long does the device take for a frame, how much is sent to it, for the first frame and for those of a flight, and what
//! does the processor do meanwhile? Data: a terrain file of 8,193 x 8,193 samples or more, for the largest mesh. Command:
//!
//!     cargo bench -p terrasoar-scene --bench triangles -- TERRAIN.iqt [--millions 1,5,20] [--frames 120] [--speed 15] [--size 1920x1080]
//!
//! The tolerance is searched that gives such a mesh at the start of a straight flight. The scene is that of the window: its engine, its culling, tiles a few a frame, timestamps of the
//! device, into a picture in place of a window. Frames follow one another as fast as they can, three under way at most. Prints Markdown. Keep runs under benches/runs/.

use std::path::PathBuf;
use std::time::Instant;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround, generate};
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::ground::{Ground, PictureEngine};
use terrasoar::refine::Culling;
use terrasoar::view::Viewport;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{Gpu, Look, Offscreen, wgpu};
use terrasoar_scene::scene::{Drawn, Scene, SceneOptions, TileService};

type Failure = Box<dyn std::error::Error>;

/// Tiles given a frame, as a window does.
const TILES_A_FRAME: usize = 4;
/// Frames that may be under way, as a window has them.
const UNDER_WAY: usize = 3;
/// How far from the wanted number of triangles a mesh may be.
const NEAR: f64 = 0.05;

struct Plan {
    terrain: PathBuf,
    millions: Vec<f64>,
    frames: u64,
    speed_m_per_frame: f64,
    size: Viewport,
}

fn plan() -> Result<Option<Plan>, Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut terrain, mut millions, mut frames, mut speed) = (None, vec![1.0, 5.0, 20.0], 120, 15.0);
    let mut size = Viewport { width_px: 1920, height_px: 1080 };
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or_else(|| format!("{word} wants a value"));
        match word.as_str() {
            "--millions" => millions = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
            "--frames" => frames = value()?.parse()?,
            "--speed" => speed = value()?.parse()?,
            "--size" => {
                let text = value()?;
                let (width, height) = text.split_once('x').ok_or("--size wants WxH")?;
                size = Viewport { width_px: width.parse()?, height_px: height.parse()? };
            }
            _ => terrain = Some(PathBuf::from(word)),
        }
    }
    Ok(terrain.map(|terrain| Plan { terrain, millions, frames, speed_m_per_frame: speed, size }))
}

fn main() -> Result<(), Failure> {
    let Some(plan) = plan()? else {
        println!("skipped: name a terrain file");
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
    let of_flight = FlightPlan::new(FlightKind::Straight, plan.frames.max(2), plan.speed_m_per_frame);
    let flight = generate(&TerrainGround::new(&terrain), &of_flight)?;
    let [east, north] = terrain.grid().samples();
    let can = &gpu.capabilities;
    println!(
        "adapter {} ({}), timestamps: {}",
        can.adapter,
        can.backend,
        if can.timestamps { "yes" } else { "no" }
    );
    println!(
        "{east} x {north} samples, {} frames of {} x {} pixels, {} m a frame\n",
        plan.frames, plan.size.width_px, plan.size.height_px, plan.speed_m_per_frame
    );
    for millions in plan.millions {
        match tolerance_px(&terrain, &flight, plan.size, millions * 1e6)? {
            Some(tolerance_px) => fly(&terrain, &gpu, &flight, plan.size, tolerance_px)?,
            None => println!("The terrain has no mesh of {millions} million triangles in this view.\n"),
        }
    }
    Ok(())
}

/// The ground of a mapped terrain.
fn mapped(terrain: &Terrain, engine: PictureEngine) -> Result<Ground<'_>, Failure> {
    Ok(Ground::mapped(terrain, engine, Culling::default())?)
}

/// The tolerance at which the first view has a mesh of so many triangles, by halving.
fn tolerance_px(
    terrain: &Terrain,
    flight: &Flight,
    size: Viewport,
    wanted: f64,
) -> Result<Option<f64>, Failure> {
    let mut ground = mapped(terrain, PictureEngine::Soar)?;
    let first = flight.frames.first().ok_or("the flight is empty")?;
    let mut triangles = |tolerance_px: f64| ground.update(&first.view(size, tolerance_px)).triangles as f64;
    let (mut fine, mut coarse) = (1.0 / 1024.0, 16.0_f64);
    if triangles(fine) < wanted * (1.0 - NEAR) {
        return Ok(None);
    }
    for _ in 0..30 {
        let between = (fine * coarse).sqrt();
        let found = triangles(between);
        if (found / wanted - 1.0).abs() < NEAR {
            return Ok(Some(between));
        }
        if found > wanted { fine = between } else { coarse = between }
    }
    Ok(Some(coarse))
}

/// A column of the table.
type Figure = fn(&Frame) -> f64;

/// What a frame took: milliseconds and bytes.
#[derive(Default)]
struct Frame {
    triangles: f64,
    update_ms: f64,
    sent_kb: f64,
    renderer_ms: f64,
    whole_ms: f64,
    device_ms: f64,
}

fn fly(
    terrain: &Terrain,
    gpu: &Gpu,
    flight: &Flight,
    size: Viewport,
    tolerance_px: f64,
) -> Result<(), Failure> {
    let options = SceneOptions::default().tiles(TileService::AFrame(TILES_A_FRAME)).timestamps(true);
    let mut ground = mapped(terrain, PictureEngine::Kinetic)?;
    let mut scene = Scene::new(&ground, gpu, options)?;
    let offscreen = Offscreen::new(&gpu.device, size.size_px())?;
    let mut under_way = std::collections::VecDeque::new();
    let mut draw = |frame: &FlightFrame, waits: bool| -> Result<Frame, Failure> {
        let view = frame.view(size, tolerance_px);
        let start = Instant::now();
        let refined = ground.update(&view);
        let updated = Instant::now();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut tiles = Drawn::default();
        scene.serve_tiles(&mut ground, &view, &mut tiles)?;
        let upload = scene.sync_mesh(&ground, &mut encoder)?;
        let drawn = scene.draw(&mut encoder, offscreen.target(), &view, &Look::default(), None)?;
        under_way.push_back(gpu.queue.submit([encoder.finish()]));
        let recorded = Instant::now();
        while under_way.len() >= if waits { 1 } else { UNDER_WAY } {
            let submission_index = under_way.pop_front();
            gpu.device.poll(wgpu::PollType::Wait { submission_index, timeout: None })?;
        }
        let done = Instant::now();
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        Ok(Frame {
            triangles: refined.triangles as f64,
            update_ms: ms(start, updated),
            sent_kb: (upload.bytes + drawn.bytes + tiles.tiles[1]) as f64 / 1e3,
            renderer_ms: ms(updated, recorded),
            whole_ms: ms(start, done),
            device_ms: scene.gpu_time_ms().unwrap_or(f64::NAN),
        })
    };
    let (first, later) = flight.frames.split_first().ok_or("the flight is empty")?;
    let first = draw(first, true)?;
    let frames = later.iter().map(|frame| draw(frame, false)).collect::<Result<Vec<_>, _>>()?;
    gpu.watch.check()?;
    println!("{:.2} million triangles, {tolerance_px:.4} px\n", first.triangles / 1e6);
    println!("| | first frame | median | 95 % | 99 % | most |\n|---|---|---|---|---|---|");
    let rows: [(&str, Figure); 6] = [
        ("device, ms", |f| f.device_ms),
        ("engine's update, ms", |f| f.update_ms),
        ("renderer, processor, ms", |f| f.renderer_ms),
        ("whole frame, ms", |f| f.whole_ms),
        ("sent, KB", |f| f.sent_kb),
        ("triangles, thousands", |f| f.triangles / 1e3),
    ];
    for (name, value) in rows {
        // The first frames after the start bring tiles and make buffers.
        let mut list: Vec<f64> =
            frames.iter().skip(frames.len() / 10).map(value).filter(|v| v.is_finite()).collect();
        list.sort_by(f64::total_cmp);
        let at = |share: f64| {
            list.get(((list.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
        };
        println!(
            "| {name} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} |",
            value(&first),
            at(0.5),
            at(0.95),
            at(0.99),
            at(1.0)
        );
    }
    println!();
    Ok(())
}
