//! What the first mesh costs, and the mesh after a jump of the eye, on one thread and on more.
//!
//! Questions: how long does `kinetic` take for its first mesh, made at once and split by split; how long after the eye has jumped elsewhere; how long does SOAR take for the same
//! mesh? Data: a terrain file named on the command line, 8,193 x 8,193 samples for docs/figures.md. Command:
//!
//!     cargo bench --bench first -- TERRAIN.iqt [--rounds 5] [--only THREADS]
//!
//! `--only` jumps there and back with so many threads for some seconds, for a profiler. Each figure is the least of all rounds; in a round everything is done once, in turns. Split by split is what a frame with a budget does: it is given one that it never uses up. SOAR's first mesh
//! and its later ones, whose memory is there already, are on one thread, as all of SOAR. The second table has the same jump with 4 ms a frame, as the window gives it: how long frames take, and after how many of them the mesh is what it would be without a budget. Views are 800 x 600 pixels; the jump leads a third of the terrain
//! away and turns around, and back. The file's pages are in memory. Prints Markdown. Keep runs under benches/runs/.

use std::path::PathBuf;
use std::time::{Duration, Instant};
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround, generate};
use terrasoar::refine::kinetic::{Budget, Kinetic};
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::{View, Viewport};
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

type Failure = Box<dyn std::error::Error>;

/// Thread counts that are measured.
const THREADS: [usize; 2] = [1, 2];

/// What the window gives a frame.
const WINDOW_BUDGET: Duration = Duration::from_millis(4);
/// Frames after which a mesh is no longer waited for.
const MOST_FRAMES: usize = 10_000;

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut path, mut rounds, mut only) = (None, 5, None);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--only" => only = Some(words.next().ok_or("--only wants a number of threads")?.parse()?),
            "--rounds" => rounds = words.next().ok_or("--rounds wants a number")?.parse()?,
            _ => path = Some(PathBuf::from(word)),
        }
    }
    let Some(path) = path else {
        println!(
            "skipped: name a terrain file, such as `terrasoar synth --size 8193` and `terrasoar build` make"
        );
        return Ok(());
    };
    let terrain = Terrain::open(&path)?;
    if let Some(threads) = only {
        return with_records!(terrain.records()?, records => only_jumps(&terrain, &records, threads));
    }
    println!(
        "| tolerance px | culling | triangles | soar, first ms | soar, later ms | split by split ms | at once, 1 thread ms | 2 threads ms | jump, 1 thread ms | 2 threads ms | 1 / 2 threads | at once / soar, first | jump / soar, later |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    with_records!(terrain.records()?, records => {
        for tolerance_px in [1.0, 0.5, 0.25] {
            for culling in Culling::ALL {
                measure(&terrain, &records, tolerance_px, culling, rounds)?;
            }
        }
        println!("\n4 ms a frame, after a jump:\n");
        println!("| tolerance px | culling | triangles | frame of the jump ms | longest after it ms | mean after it ms | frames until complete |");
        println!("|---|---|---|---|---|---|---|");
        for tolerance_px in [1.0, 0.5, 0.25] {
            for culling in Culling::ALL {
                budgeted(&terrain, &records, tolerance_px, culling)?;
            }
        }
    });
    Ok(())
}

/// The start of a flight, and another place and direction.
fn views(terrain: &Terrain, tolerance_px: f64) -> Result<[View; 2], Failure> {
    let plan = FlightPlan::new(FlightKind::Straight, 2, 1.0);
    let start =
        generate(&TerrainGround::new(terrain), &plan)?.frames[0].view(Viewport::default(), tolerance_px);
    let mut away = start;
    for (place, extent_m) in [&mut away.eye_m.x, &mut away.eye_m.y].into_iter().zip(terrain.grid().extent_m())
    {
        *place += if *place < extent_m / 2.0 { extent_m / 3.0 } else { -extent_m / 3.0 };
    }
    away.yaw_rad += std::f64::consts::PI;
    Ok([start, away])
}

fn timed(least_ms: &mut f64, work: impl FnOnce()) {
    let start = Instant::now();
    work();
    *least_ms = least_ms.min(start.elapsed().as_secs_f64() * 1e3);
}

fn measure<C: RecordCodec>(
    terrain: &Terrain,
    records: &Records<'_, C>,
    tolerance_px: f64,
    culling: Culling,
    rounds: usize,
) -> Result<(), Failure> {
    let [start, away] = views(terrain, tolerance_px)?;
    let pools: Vec<rayon::ThreadPool> = THREADS
        .iter()
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(*threads).build())
        .collect::<Result<_, _>>()?;
    let (mut soar_first, mut soar_later, mut split) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let (mut first, mut jump) = ([f64::INFINITY; 2], [f64::INFINITY; 2]);
    let mut triangles = 0;
    for _ in 0..rounds {
        let mut soar = Soar::new(records.clone(), culling);
        timed(&mut soar_first, || _ = soar.update(&start, &mut Unobserved));
        soar.update(&away, &mut Unobserved);
        timed(&mut soar_later, || _ = soar.update(&start, &mut Unobserved));
        drop(soar);
        pools[0].install(|| {
            let mut kinetic = Kinetic::new(records.clone(), culling);
            kinetic.set_budget(Budget::default().tests(u64::MAX));
            timed(&mut split, || _ = kinetic.update(&start, &mut Unobserved));
        });
        for (i, pool) in pools.iter().enumerate() {
            pool.install(|| {
                let mut kinetic = Kinetic::new(records.clone(), culling);
                timed(&mut first[i], || _ = kinetic.update(&start, &mut Unobserved));
                triangles = kinetic.triangle_count();
                kinetic.update(&away, &mut Unobserved);
                timed(&mut jump[i], || _ = kinetic.update(&start, &mut Unobserved));
            });
        }
    }
    println!(
        "| {tolerance_px} | {} | {triangles} | {soar_first:.1} | {soar_later:.1} | {split:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} |",
        culling.name(),
        first[0],
        first[1],
        jump[0],
        jump[1],
        first[0] / first[1],
        first[1] / soar_first,
        jump[1] / soar_later,
    );
    Ok(())
}

/// A jump with the time that the window gives a frame, and the frames after it.
fn budgeted<C: RecordCodec>(
    terrain: &Terrain,
    records: &Records<'_, C>,
    tolerance_px: f64,
    culling: Culling,
) -> Result<(), Failure> {
    let [start, away] = views(terrain, tolerance_px)?;
    let mut kinetic = Kinetic::new(records.clone(), culling);
    kinetic.update(&away, &mut Unobserved);
    kinetic.set_budget(Budget::default().time(WINDOW_BUDGET));
    let mut times_ms = Vec::new();
    loop {
        let mut took_ms = f64::INFINITY;
        timed(&mut took_ms, || _ = kinetic.update(&start, &mut Unobserved));
        times_ms.push(took_ms);
        if kinetic.work().late_error_px == 0.0 || times_ms.len() == MOST_FRAMES {
            break;
        }
    }
    let after = &times_ms[1..];
    println!(
        "| {tolerance_px} | {} | {} | {:.1} | {:.1} | {:.1} | {} |",
        culling.name(),
        kinetic.triangle_count(),
        times_ms[0],
        after.iter().copied().fold(0.0, f64::max),
        after.iter().sum::<f64>() / after.len().max(1) as f64,
        if times_ms.len() == MOST_FRAMES { "never".into() } else { times_ms.len().to_string() }
    );
    Ok(())
}

/// Jumps there and back for a while, for a profiler.
fn only_jumps<C: RecordCodec>(
    terrain: &Terrain,
    records: &Records<'_, C>,
    threads: usize,
) -> Result<(), Failure> {
    let views = views(terrain, 0.25)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    pool.install(|| {
        let mut kinetic = Kinetic::new(records.clone(), Culling::Vertices);
        let (begun, mut nodes, mut frames) = (Instant::now(), 0, 0);
        while begun.elapsed().as_secs() < 6 {
            for view in &views {
                kinetic.update(view, &mut Unobserved);
                nodes += kinetic.node_count();
                frames += 1;
            }
        }
        let ns = begun.elapsed().as_secs_f64() * 1e9;
        println!(
            "{frames} jumps, {:.1} ms each, {:.1} ns a node",
            ns / 1e6 / f64::from(frames),
            ns / nodes as f64
        );
    });
    Ok(())
}
