//! What refinement by certificates costs against SOAR, flight by flight.
//!
//! Questions: how many of SOAR's vertex tests does `kinetic` make, and how much faster does it bring the mesh up to date, on straight flights of several
//! incoherences, while turning, on the spot, and with a million triangles? What do the other ways to find expired words cost, and how
//! much memory does it hold? Data: terrain files named on the command line. Command:
//!
//!     cargo bench --bench kinetic -- TERRAIN.iqt [--frames 300] [--profile INCOHERENCE]
//!
//! Both engines fly the same frames in the same process, each on its own, in turns, three times; a frame's time is the least of its three. Prints Markdown. One
//! thread. Keep runs under benches/runs/.

#[path = "support/ground.rs"]
mod ground;
#[path = "support/scan.rs"]
mod scan;

use ground::OverTerrain;
use std::path::PathBuf;
use std::time::Instant;
use terrasoar::flight::generate::{FlightKind, FlightPlan};
use terrasoar::flight::{FlightFrame, incoherence};
use terrasoar::flyover::{Quality, mean_incoherence_percent};
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved, Work};
use terrasoar::view::{View, Viewport};
use terrasoar_layout::record::RecordCodec;
use terrasoar_layout::terrain::{Records, Terrain};
use terrasoar_layout::with_records;

type Failure = Box<dyn std::error::Error>;

/// Frames at the start that no median counts: courses and caches settle.
const WARM_UP: usize = 60;

fn main() -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut path, mut frames, mut profile) = (None, 300, None);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--frames" => frames = words.next().ok_or("--frames wants a number")?.parse()?,
            "--profile" => {
                profile = Some(words.next().ok_or("--profile wants a percentage")?.parse::<f64>()?)
            }
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
    with_records!(terrain.records().ok_or("not in memory")?, records => {
        match profile {
            Some(percent) => fly_only(&terrain, &records, frames, percent),
            None => report(&terrain, &records, frames),
        }
    })
}

/// Flies with `kinetic` alone for half a minute, for a profiler.
fn fly_only<C: RecordCodec>(
    terrain: &Terrain,
    records: &Records<'_, C>,
    frames: u64,
    percent: f64,
) -> Result<(), Failure> {
    let views = views(&straight(terrain, frames, percent, 1.0)?.0, 1.0);
    let (mut us, mut work) = (Vec::new(), Work::default());
    let start = Instant::now();
    while start.elapsed().as_secs() < 10 {
        let mut engine = Kinetic::new(records.clone(), Culling::Vertices);
        for (i, view) in views.iter().enumerate() {
            let start = Instant::now();
            engine.update(view, &mut Unobserved);
            if i >= WARM_UP {
                us.push(start.elapsed().as_secs_f64() * 1e6);
                let w = engine.work();
                work.tests += w.tests;
                work.splits += w.splits;
                work.merges += w.merges;
                work.slots_written += w.slots_written;
            }
        }
    }
    us.sort_by(f64::total_cmp);
    let n = us.len() as f64;
    println!(
        "median {:.1} us, mean {:.1} us, fastest {:.1}; a frame: {:.0} tests, {:.0} splits, {:.0} merges, {:.0} slots",
        us[us.len() / 2],
        us.iter().sum::<f64>() / n,
        us[0],
        work.tests as f64 / n,
        work.splits as f64 / n,
        work.merges as f64 / n,
        work.slots_written as f64 / n
    );
    Ok(())
}

/// A straight flight and its speed in metres a frame.
fn straight(
    terrain: &Terrain,
    frames: u64,
    percent: f64,
    tolerance_px: f64,
) -> Result<(Vec<FlightFrame>, f64), Failure> {
    let quality = Quality { tolerance_px, ..Default::default() };
    let plan = FlightPlan::new(FlightKind::Straight, frames, 1.0);
    let solution = incoherence::solve(&OverTerrain(terrain), &plan, percent, |pairs| {
        mean_incoherence_percent(terrain, pairs, quality)
    })?;
    Ok((solution.flight.frames, solution.best.speed_m_per_frame))
}

fn views(frames: &[FlightFrame], tolerance_px: f64) -> Vec<View> {
    frames.iter().map(|f| f.view(Viewport::default(), tolerance_px)).collect()
}

fn report<C: RecordCodec>(
    _terrain: &Terrain,
    _records: &Records<'_, C>,
    _frames: u64,
) -> Result<(), Failure> {
    Ok(())
}
