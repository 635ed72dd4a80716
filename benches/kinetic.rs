//! What refinement by certificates costs against SOAR, flight by flight.
//!
//! Questions: how many of SOAR's vertex tests does `kinetic` make, and how much faster does it bring the mesh up to date, on straight flights of several
//! incoherences, while turning, on the spot, and with a million triangles? What do the other ways to find expired words cost, and how
//! much memory does it hold? Data: terrain files named on the command line. Command:
//!
//!     cargo bench --bench kinetic -- TERRAIN.iqt [--frames 1500] [--profile INCOHERENCE | --pace METRES [--turn DEGREES]] [--clusters] [--walking]
//!
//! All engines fly the same frames in the same process, one after the other, three times over; a frame's time is the least of its three, and figures are
//! medians over the last two thirds of the frames. One thread. Prints Markdown. Keep runs under benches/runs/.

#[path = "support/scan.rs"]
mod scan;

use std::path::PathBuf;
use std::time::Instant;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround, generate};
use terrasoar::flight::{FlightFrame, incoherence};
use terrasoar::flyover::{Quality, mean_incoherence_percent};
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::{View, Viewport};
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

type Failure = Box<dyn std::error::Error>;

/// Legs whose time is taken together.
const LEGS: usize = 10;
/// Passes over each flight.
const PASSES: usize = 3;

fn main() -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut path, mut frames, mut profile, mut pace, mut only_walks) = (None, 1500, None, None, false);
    let mut turn_deg = 0.0;
    let mut culling = Culling::Vertices;
    while let Some(word) = words.next() {
        match word.as_str() {
            "--frames" => frames = words.next().ok_or("--frames wants a number")?.parse()?,
            "--profile" => {
                profile = Some(words.next().ok_or("--profile wants a percentage")?.parse::<f64>()?)
            }
            "--pace" => pace = Some(words.next().ok_or("--pace wants metres a frame")?.parse::<f64>()?),
            "--turn" => turn_deg = words.next().ok_or("--turn wants degrees a frame")?.parse::<f64>()?,
            "--clusters" => culling = Culling::Clusters,
            "--walking" => only_walks = true,
            _ => path = Some(PathBuf::from(word)),
        }
    }
    let Some(path) = path else {
        println!(
            "skipped: name a terrain file, such as one made by `terrasoar synth --size 8193` and `terrasoar build`"
        );
        return Ok(());
    };
    let terrain = Terrain::open(&path)?;
    with_records!(terrain.records()?, records => {
        match (profile, pace) {
            (Some(percent), _) => fly_only(&records, &straight(&terrain, frames, percent, 1.0)?.0, culling),
            (None, Some(speed_m)) => fly_only(&records, &plain(&terrain, frames, speed_m, turn_deg)?, culling),
            _ if only_walks => walking(&terrain, &records),
            _ => report(&terrain, &records, frames),
        }
    })
}

/// Flies with `kinetic` alone for a while, there and back again, for a profiler, and to compare two binaries: other programs lengthen a leg and never shorten it.
fn fly_only<C: RecordCodec>(
    records: &Records<'_, C>,
    flight: &[FlightFrame],
    culling: Culling,
) -> Result<(), Failure> {
    let mut views = views(flight, 1.0);
    let mut engine = Kinetic::new(records.clone(), culling);
    let start = Instant::now();
    let (mut tests, mut changes, mut legs) = (0u64, 0u64, Vec::new());
    while start.elapsed().as_secs() < 10 {
        let (before, mut in_leg) = (cpu_ns(start), 0);
        for view in &views {
            engine.update(view, &mut Unobserved);
            let work = engine.work();
            tests += work.tests;
            in_leg += work.splits + work.merges;
        }
        changes += in_leg;
        legs.push((cpu_ns(start) - before, in_leg.max(1) as f64));
        views.reverse();
    }
    let updates = (legs.len() * views.len()) as f64;
    // The first leg has the first frame. Some systems tell a thread's time to a few milliseconds only, hence groups.
    let later: Vec<f64> = legs
        .get(1..)
        .unwrap_or(&[])
        .chunks_exact(LEGS)
        .map(|group| {
            let (ns, changes) =
                group.iter().fold((0.0, 0.0), |(ns, changes), leg| (ns + leg.0, changes + leg.1));
            ns / changes
        })
        .collect();
    println!(
        "{updates} updates: {:.0} changes and {:.2} tests a change; ns a change, of {LEGS} legs: {:.0} at the least, {:.0} in the median",
        changes as f64 / updates,
        tests as f64 / changes as f64,
        later.iter().copied().fold(f64::INFINITY, f64::min),
        median(later.to_vec()),
    );
    Ok(())
}

/// Time in nanoseconds that this thread has run for, where the system tells, else time since `start`.
fn cpu_ns(start: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let run = told.and_then(|told| told.split_whitespace().next()?.parse().ok());
    run.unwrap_or(start.elapsed().as_nanos() as f64)
}

/// A straight flight and its speed in metres a frame.
fn straight(
    terrain: &Terrain,
    frames: u64,
    percent: f64,
    tolerance_px: f64,
) -> Result<(Vec<FlightFrame>, f64), Failure> {
    let quality = Quality::default().tolerance_px(tolerance_px);
    let plan = FlightPlan::new(FlightKind::Straight, frames, 1.0);
    let solution = incoherence::solve(&TerrainGround::new(terrain), &plan, percent, |pairs| {
        mean_incoherence_percent(terrain, pairs, quality)
    })?;
    Ok((solution.flight.frames, solution.best.speed_m_per_frame))
}

/// A flight at a given speed, turning by `rate_deg` a frame if that is not 0.
fn plain(terrain: &Terrain, frames: u64, speed_m: f64, rate_deg: f64) -> Result<Vec<FlightFrame>, Failure> {
    let kind = if rate_deg == 0.0 { FlightKind::Straight } else { FlightKind::Turn };
    let mut plan = FlightPlan::new(kind, frames, speed_m);
    if rate_deg != 0.0 {
        plan.turn_rate_deg_per_frame = rate_deg;
    }
    Ok(generate(&TerrainGround::new(terrain), &plan)?.frames)
}

fn views(frames: &[FlightFrame], tolerance_px: f64) -> Vec<View> {
    frames.iter().map(|f| f.view(Viewport::default(), tolerance_px)).collect()
}

/// What one engine did in the frames that count.
struct Run {
    /// Each frame's least time over all passes, in microseconds.
    times_us: Vec<f64>,
    tests: f64,
    triangles: f64,
    changes: f64,
    slots: f64,
    patch_bytes: f64,
    bytes_a_triangle: f64,
}

/// Flies `views` with a new engine each pass; `observe` hears of the engine after each frame that counts.
fn fly<E: Engine>(views: &[View], new: impl Fn() -> E, mut observe: impl FnMut(&E, u64, &mut Run)) -> Run {
    let counted = views.len() - views.len() / 3;
    let skipped = views.len() / 3;
    let mut run = Run {
        times_us: vec![f64::INFINITY; counted],
        tests: 0.0,
        triangles: 0.0,
        changes: 0.0,
        slots: 0.0,
        patch_bytes: 0.0,
        bytes_a_triangle: 0.0,
    };
    for _ in 0..PASSES {
        let mut engine = new();
        for (i, view) in views.iter().enumerate() {
            let start = Instant::now();
            let tests = engine.update(view, &mut Unobserved);
            let us = start.elapsed().as_secs_f64() * 1e6;
            if i >= skipped {
                let least = &mut run.times_us[i - skipped];
                *least = least.min(us);
                observe(&engine, tests, &mut run);
            }
        }
    }
    let frames = (counted * PASSES) as f64;
    let sums = [&mut run.tests, &mut run.triangles, &mut run.changes, &mut run.slots, &mut run.patch_bytes];
    for sum in sums.into_iter().chain([&mut run.bytes_a_triangle]) {
        *sum /= frames;
    }
    run
}

fn fly_soar<C: RecordCodec>(records: &Records<'_, C>, views: &[View], culling: Culling) -> Run {
    fly(views, || Soar::new(records.clone(), culling), |_, tests, run| run.tests += tests as f64)
}

fn fly_kinetic<C: RecordCodec>(records: &Records<'_, C>, views: &[View], culling: Culling) -> Run {
    fly(
        views,
        || Kinetic::new(records.clone(), culling),
        |engine, tests, run| {
            let work = engine.work();
            run.tests += tests as f64;
            run.triangles += engine.triangle_count() as f64;
            run.changes += (work.splits + work.merges) as f64;
            run.slots += work.slots_written as f64;
            run.patch_bytes += work.patch_bytes as f64;
            run.bytes_a_triangle += engine.bytes() as f64 / engine.triangle_count() as f64;
        },
    )
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Median over the frames of how many times faster `run` is than `base`.
fn speed_up(base: &Run, run: &Run) -> f64 {
    median(base.times_us.iter().zip(&run.times_us).map(|(b, r)| b / r).collect())
}

fn report<C: RecordCodec>(terrain: &Terrain, records: &Records<'_, C>, frames: u64) -> Result<(), Failure> {
    println!("{}, 800x600, 1 px\n", terrain.path().file_name().unwrap_or_default().display());
    let mut flights = Vec::new();
    let mut speed_of_0_61 = 0.0;
    for percent in [0.1, 0.61, 1.4, 5.3] {
        // Faster flights would come to the terrain's end.
        let frames = if percent > 5.0 {
            frames / 5
        } else if percent > 1.0 {
            frames / 2
        } else {
            frames
        };
        let (path, speed) = straight(terrain, frames, percent, 1.0)?;
        if percent == 0.61 {
            speed_of_0_61 = speed;
        }
        flights.push((format!("straight, {percent} %, {speed:.1} m a frame"), path));
    }
    // 30 degrees a second, 60 frames a second.
    flights.push((
        "turning 0.5 degrees a frame at the speed of 0.61 %".into(),
        plain(terrain, frames, speed_of_0_61, 0.5)?,
    ));
    flights.push(("turning 0.5 degrees a frame on the spot".into(), plain(terrain, frames, 0.0, 0.5)?));
    println!(
        "| flight | culling | triangles | tests, % of soar's | tests a split or merge | us, soar | us, kinetic | times faster | slots | patch bytes | bytes a triangle |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for (name, path) in &flights {
        let views = views(path, 1.0);
        let soar = fly_soar(records, &views, Culling::Vertices);
        for culling in Culling::ALL {
            let kinetic = fly_kinetic(records, &views, culling);
            println!(
                "| {name} | {} | {:.0} | {:.3} | {:.2} | {:.0} | {:.1} | {:.1} | {:.0} | {:.0} | {:.0} |",
                culling.name(),
                kinetic.triangles,
                100.0 * kinetic.tests / soar.tests,
                kinetic.tests / kinetic.changes.max(1.0),
                median(soar.times_us.clone()),
                median(kinetic.times_us.clone()),
                speed_up(&soar, &kinetic),
                kinetic.slots,
                kinetic.patch_bytes,
                kinetic.bytes_a_triangle,
            );
        }
        let uncropped = fly_soar(records, &views, Culling::Clusters);
        println!(
            "| | soar, uncropped | | {:.0} | | {:.0} | | | | | |",
            100.0 * uncropped.tests / soar.tests,
            median(uncropped.times_us)
        );
    }
    walking(terrain, records)?;
    scan::report(fly_kinetic_nodes(records, &views(&flights[0].1[..2], 1.0)));
    Ok(())
}

/// Live nodes after a flight.
fn fly_kinetic_nodes<C: RecordCodec>(records: &Records<'_, C>, views: &[View]) -> usize {
    let mut engine = Kinetic::new(records.clone(), Culling::Vertices);
    for view in views {
        engine.update(view, &mut Unobserved);
    }
    engine.node_count()
}

/// A million triangles at walking speed.
fn walking<C: RecordCodec>(terrain: &Terrain, records: &Records<'_, C>) -> Result<(), Failure> {
    // 1.5 m a second, 60 frames a second.
    let path = plain(terrain, 200, 0.025, 0.0)?;
    println!("\n## Walking: 0.025 m a frame\n");
    println!(
        "| tolerance px | triangles | nodes a triangle | first frame ms | us, median | us, worst | bytes a triangle |"
    );
    println!("|---|---|---|---|---|---|---|");
    for tolerance_px in [1.0, 0.5, 0.25] {
        let mut engine = Kinetic::new(records.clone(), Culling::Vertices);
        let mut times: Vec<f64> = Vec::new();
        for view in views(&path, tolerance_px) {
            let start = Instant::now();
            engine.update(&view, &mut Unobserved);
            times.push(start.elapsed().as_secs_f64() * 1e6);
        }
        let (first, later) = (times[0], times[1..].to_vec());
        println!(
            "| {tolerance_px} | {} | {:.2} | {:.1} | {:.1} | {:.1} | {:.0} |",
            engine.triangle_count(),
            engine.node_count() as f64 / engine.triangle_count() as f64,
            first / 1e3,
            median(later.clone()),
            later.iter().copied().fold(0.0, f64::max),
            engine.bytes() as f64 / engine.triangle_count() as f64,
        );
    }
    Ok(())
}
