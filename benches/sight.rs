//! What errors measured along the line of sight save.
//!
//! Questions: how many triangles does a view need by line of sight, beside those by ball, at which height above the ground and at which angle? What do the tests cost, and how many of SOAR's does
//! `kinetic` make in flight, by either? Data: terrain files named on the command line. Command:
//!
//!     cargo bench --bench sight -- TERRAIN.iqt ... [--frames 400]
//!
//! Views: 800 x 600 pixels, 45 degrees, 1 px, from nine places, in four directions each; culling of vertices. Flights are straight, at several heights, pitches and paces; both
//! metrics fly the same frames, frame by frame in turn. One thread; times are medians over the frames. Prints Markdown. Keep runs under benches/runs/.

use std::path::PathBuf;
use std::time::Instant;
use terrasoar::flight::FlightFrame;
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::{ErrorMetric, View, Viewport};
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

type Failure = Box<dyn std::error::Error>;

/// Heights above the ground as multiples of the spacing of samples.
const HEIGHTS: [f64; 6] = [1.0, 4.0, 16.0, 64.0, 256.0, 1024.0];
/// Angles of view above the horizon.
const PITCHES_DEG: [f64; 5] = [0.0, -20.0, -45.0, -70.0, -90.0];

fn main() -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut paths, mut frames) = (Vec::new(), 400);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--frames" => frames = words.next().ok_or("--frames wants a number")?.parse()?,
            _ => paths.push(PathBuf::from(word)),
        }
    }
    if paths.is_empty() {
        println!(
            "skipped: name a terrain file, such as one made by `terrasoar synth --size 4097` and `terrasoar build`"
        );
        return Ok(());
    }
    for path in paths {
        let terrain = Terrain::open(&path)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let [wide, high] = terrain.grid().samples();
        println!("## {name}: {wide} x {high} samples, {:.1} m apart\n", terrain.grid().spacing_m()[0]);
        with_records!(terrain.records()?, records => {
            triangles(&terrain, &records)?;
            flights(&terrain, &records, frames)?;
        });
    }
    Ok(())
}

/// A place in parts of the extent, so many metres above the ground.
fn eye_m(terrain: &Terrain, [x, y]: [f64; 2], above_m: f64) -> Result<[f64; 3], Failure> {
    let [wide_m, high_m] = terrain.grid().extent_m();
    let (east_m, north_m) = (x * wide_m, y * high_m);
    Ok([east_m, north_m, terrain.height_m(east_m, north_m)?.unwrap_or(0.0) + above_m])
}

fn view(eye_m: [f64; 3], yaw_deg: f64, pitch_deg: f64) -> View {
    let frame = FlightFrame { time_s: 0.0, eye_m, yaw_deg, pitch_deg, roll_deg: 0.0, vertical_fov_deg: 45.0 };
    frame.view(Viewport::default(), 1.0)
}

fn triangles_of(engine: &impl Engine) -> u64 {
    let mut count = 0;
    engine.for_each_triangle(&mut |_| count += 1);
    count
}

fn triangles<C: RecordCodec>(terrain: &Terrain, records: &Records<'_, C>) -> Result<(), Failure> {
    let spacing_m = terrain.grid().spacing_m()[0];
    let heads: Vec<String> = PITCHES_DEG.iter().map(|deg| format!("{deg} deg")).collect();
    println!("Triangles by ball, and what sight needs of them:\n");
    println!("| above the ground | {} |\n|---{}|", heads.join(" | "), "|---".repeat(PITCHES_DEG.len()));
    let mut soar = Soar::new(records.clone(), Culling::Vertices);
    for times in HEIGHTS {
        let mut cells = Vec::new();
        for pitch_deg in PITCHES_DEG {
            let mut sums = [0u64; 2];
            for place in 0..9 {
                let at = [0.25 * f64::from(place % 3 + 1), 0.25 * f64::from(place / 3 + 1)];
                let eye_m = eye_m(terrain, at, times * spacing_m)?;
                for turn in 0..4 {
                    for (sum, metric) in sums.iter_mut().zip(ErrorMetric::ALL) {
                        soar.update(
                            &view(eye_m, 90.0 * f64::from(turn) + 20.0, pitch_deg).metric(metric),
                            &mut Unobserved,
                        );
                        *sum += triangles_of(&soar);
                    }
                }
            }
            cells.push(format!("{}, {:.1} %", sums[0] / 36, 100.0 * sums[1] as f64 / sums[0] as f64));
        }
        println!("| {:.0} m | {} |", times * spacing_m, cells.join(" | "));
    }
    println!();
    Ok(())
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

/// What an engine took over a flight, the first frame left out.
#[derive(Default)]
struct Took {
    triangles: u64,
    soar_tests: u64,
    soar_ns_a_test: Vec<f64>,
    tests: u64,
    changes: u64,
    kinetic_us: Vec<f64>,
}

fn flights<C: RecordCodec>(terrain: &Terrain, records: &Records<'_, C>, frames: u32) -> Result<(), Failure> {
    let spacing_m = terrain.grid().spacing_m()[0];
    println!(
        "Straight flights of {frames} frames, figures a frame; shares are of SOAR's tests by the same metric:\n"
    );
    println!(
        "| above the ground | pitch | samples a frame | metric | triangles | SOAR's ns a test | kinetic's tests | share | tests a change | us |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (times, pitch_deg) in [(4.0, -10.0), (64.0, -20.0), (64.0, -60.0), (400.0, -50.0), (400.0, -90.0)] {
        for samples in [0.05, 0.5, 2.0] {
            let [x, y, up] = eye_m(terrain, [0.45, 0.3], times * spacing_m)?;
            let mut took = [Took::default(), Took::default()];
            let mut engines = ErrorMetric::ALL.map(|metric| {
                (
                    metric,
                    Soar::new(records.clone(), Culling::Vertices),
                    Kinetic::new(records.clone(), Culling::Vertices),
                )
            });
            for i in 0..frames {
                let way = samples * spacing_m * f64::from(i);
                let view = view([x + 0.3 * way, y + 0.95 * way, up], 17.5, pitch_deg);
                for (took, (metric, soar, kinetic)) in took.iter_mut().zip(&mut engines) {
                    let view = view.metric(*metric);
                    let start = Instant::now();
                    let soar_tests = soar.update(&view, &mut Unobserved);
                    let between = Instant::now();
                    let tests = kinetic.update(&view, &mut Unobserved);
                    let end = Instant::now();
                    if i > 0 {
                        let work = kinetic.work();
                        took.triangles += kinetic.triangle_count() as u64;
                        took.soar_tests += soar_tests;
                        took.soar_ns_a_test.push(1e9 * (between - start).as_secs_f64() / soar_tests as f64);
                        took.tests += tests;
                        took.changes += work.splits + work.merges;
                        took.kinetic_us.push(1e6 * (end - between).as_secs_f64());
                    }
                }
            }
            for (took, metric) in took.iter_mut().zip(ErrorMetric::ALL) {
                let a_frame = |sum: u64| sum as f64 / f64::from(frames - 1);
                println!(
                    "| {:.0} m | {pitch_deg} | {samples} | {} | {:.0} | {:.1} | {:.1} | {:.3} % | {:.1} | {:.1} |",
                    times * spacing_m,
                    metric.name(),
                    a_frame(took.triangles),
                    median(&mut took.soar_ns_a_test),
                    a_frame(took.tests),
                    100.0 * took.tests as f64 / took.soar_tests.max(1) as f64,
                    took.tests as f64 / took.changes.max(1) as f64,
                    median(&mut took.kinetic_us),
                );
            }
        }
    }
    println!();
    Ok(())
}
