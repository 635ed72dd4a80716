//! Figures of docs/figures.md, measured in one run.
//!
//! Questions: how many of SOAR's vertex tests does SMART make, how fast is the SOAR it is compared with, how fast and in how much memory is
//! a file built? Data: synthetic Puget-Sound-style terrain, or a DEM named with `--dem`. Command:
//!
//!     cargo bench --bench figures -- [--size 8193] [--dem FILE [--spacing M]] [--frames 200]
//!
//! Prints Markdown tables. Keep runs under benches/runs/.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround};
use terrasoar::flight::{FlightFrame, incoherence};
use terrasoar::flyover::{EngineKind, Quality, mean_incoherence_percent, replay};
use terrasoar::stats::Comparison;
use terrasoar_import::synth::{SynthOptions, write};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::file::header::ErrorKind;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

type Failure = Box<dyn std::error::Error>;

/// Extent of the synthetic terrain in metres, whatever its size in samples.
const EXTENT_M: f64 = 163_840.0;

struct Arguments {
    size: u32,
    dem: Option<PathBuf>,
    spacing_m: Option<f64>,
    frames: u64,
}

impl Arguments {
    fn parse() -> Result<Self, Failure> {
        let mut parsed = Self { size: 8193, dem: None, spacing_m: None, frames: 200 };
        let mut words = std::env::args().skip(1);
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| format!("{word} wants a value"));
            match word.as_str() {
                "--size" => parsed.size = value()?.parse()?,
                "--dem" => parsed.dem = Some(value()?.into()),
                "--spacing" => parsed.spacing_m = Some(value()?.parse()?),
                "--frames" => parsed.frames = value()?.parse()?,
                // cargo bench adds it.
                "--bench" => {}
                other => return Err(format!("unknown argument {other}").into()),
            }
        }
        Ok(parsed)
    }
}

/// Builds in a process of its own, so that its peak memory is the build's.
fn timed_build(dem: &Path, out: &Path, spacing_m: Option<f64>, error: &str) -> Result<(), Failure> {
    let start = Instant::now();
    let status = Command::new(std::env::current_exe()?)
        .env("TERRASOAR_FIGURES_BUILD", error)
        .env("TERRASOAR_FIGURES_SPACING", spacing_m.map_or(String::new(), |s| s.to_string()))
        .args([dem, out])
        .status()?;
    if !status.success() {
        return Err("the build failed".into());
    }
    let terrain = Terrain::open(out)?;
    let [wide, high] = terrain.grid().samples().map(f64::from);
    println!(
        "| {wide} x {high}, {error} | {:.1} | {:.2} | {:.4} |",
        wide * high / start.elapsed().as_secs_f64() / 1e6,
        start.elapsed().as_secs_f64(),
        terrain.bytes_per_sample(),
    );
    Ok(())
}

/// The child's side of [`timed_build`].
fn build_and_report(error: &str) -> Result<(), Failure> {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(Into::into).collect();
    let [dem, out] = &paths[..] else { return Err("two paths expected".into()) };
    let spacing_m = std::env::var("TERRASOAR_FIGURES_SPACING")?.parse::<f64>().ok();
    let options = BuildOptions::default()
        .error(if error == "step" { ErrorKind::Step } else { ErrorKind::Bounded })
        .spacing_m(spacing_m.map(|s| [s, s]));
    build(&*terrasoar_import::open(std::slice::from_ref(dem))?, out, &options, &Silent)?;
    if let Ok(status) = std::fs::read_to_string("/proc/self/status")
        && let Some(line) = status.lines().find(|l| l.starts_with("VmHWM"))
    {
        eprintln!("peak memory of the build ({error}): {}", line.trim_start_matches("VmHWM:").trim());
    }
    Ok(())
}

fn quality(tolerance_px: f64) -> Quality {
    Quality::default().tolerance_px(tolerance_px)
}

fn flight(
    terrain: &Terrain,
    kind: FlightKind,
    frames: u64,
    percent: f64,
    tolerance_px: f64,
) -> Result<(Vec<FlightFrame>, f64), Failure> {
    let plan = FlightPlan::new(kind, frames, 1.0);
    let solution = incoherence::solve(&TerrainGround::new(terrain), &plan, percent, |pairs| {
        mean_incoherence_percent(terrain, pairs, quality(tolerance_px))
    })?;
    Ok((solution.flight.frames, solution.best.speed_m_per_frame))
}

fn compare(terrain: &Terrain, frames: &[FlightFrame], tolerance_px: f64) -> Result<Comparison, Failure> {
    let mut runs = Vec::new();
    for kind in [EngineKind::Soar, EngineKind::Smart] {
        let stats = replay(terrain, frames, quality(tolerance_px), kind, &mut |_| {})?;
        runs.push((kind.name().to_owned(), stats));
    }
    Ok(Comparison::of(&runs))
}

/// The tolerance at which the middle frame of a flight has about `triangles` triangles.
fn tolerance_for(terrain: &Terrain, frames: &[FlightFrame], triangles: f64) -> Result<f64, Failure> {
    let middle = &frames[frames.len() / 2..=frames.len() / 2];
    let (mut low, mut high) = (0.05f64, 16.0f64);
    for _ in 0..24 {
        let tolerance_px = (low * high).sqrt();
        let stats = replay(terrain, middle, quality(tolerance_px), EngineKind::Soar, &mut |_| {})?;
        if stats[0].triangles as f64 > triangles { low = tolerance_px } else { high = tolerance_px }
    }
    Ok((low * high).sqrt())
}

fn main() -> Result<(), Failure> {
    if let Ok(error) = std::env::var("TERRASOAR_FIGURES_BUILD") {
        return build_and_report(&error);
    }
    let arguments = Arguments::parse()?;
    let folder = tempfile::tempdir()?;
    let path = |name: &str| folder.path().join(name);
    let synthesised = |size: u32| -> Result<PathBuf, Failure> {
        let out = path(&format!("synth-{size}.tif"));
        let spacing_m = EXTENT_M / f64::from(size - 1);
        write(&SynthOptions::default().size(size).seed(1).spacing_m(spacing_m), &out, &|_| {})?;
        Ok(out)
    };
    println!("## Build, 512 MiB, {} threads\n", rayon::current_num_threads());
    println!("| samples, error | million samples/s | s | bytes a sample |\n|---|---|---|---|");
    let dem = match &arguments.dem {
        Some(dem) => dem.clone(),
        None => synthesised(arguments.size)?,
    };
    timed_build(&dem, &path("bounded.iqt"), arguments.spacing_m, "bounded")?;
    timed_build(&dem, &path("step.iqt"), arguments.spacing_m, "step")?;
    // SOAR's authors flew over 4,097 x 4,097 samples; a DEM that is given serves as it is.
    let small = match arguments.dem {
        Some(_) => path("step.iqt"),
        None => {
            let out = path("step-small.iqt");
            timed_build(&synthesised(arguments.size / 2 + 1)?, &out, None, "step")?;
            out
        }
    };

    println!("\n## SMART against SOAR, straight flight, 800x600, bounded error\n");
    println!(
        "| incoherence % | tolerance px | m a frame | triangles | tests % | worst frame % | speed-up | soar ms | same mesh |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let bounded = Terrain::open(&path("bounded.iqt"))?;
    for (percent, tolerance_px) in
        [(0.61, 0.5), (0.61, 1.0), (0.61, 2.0), (0.61, 4.0), (1.4, 1.0), (5.3, 1.0)]
    {
        let (frames, speed) =
            flight(&bounded, FlightKind::Straight, arguments.frames, percent, tolerance_px)?;
        let c = compare(&bounded, &frames, tolerance_px)?;
        let (soar, smart) = (&c.engines[0].summary, &c.engines[1]);
        println!(
            "| {:.2} | {tolerance_px} | {speed:.1} | {:.0} | {:.2} | {:.2} | {:.2} | {:.2} | {} |",
            soar.incoherence_percent,
            soar.triangles_mean,
            100.0 * smart.vertex_tests_ratio,
            100.0 * smart.vertex_tests_ratio_worst_frame,
            smart.speedup_median,
            soar.update_ms.p50,
            c.same_mesh,
        );
    }

    println!("\n## SOAR alone, one thread, step error, 346,000 triangles\n");
    println!("| samples | tolerance px | frame | triangles | ms | million triangles/s | ns a vertex test |");
    println!("|---|---|---|---|---|---|---|");
    let small = Terrain::open(&small)?;
    let (frames, _) = flight(&small, FlightKind::Straight, 60, 0.61, 1.0)?;
    let tolerance_px = tolerance_for(&small, &frames, 346_000.0)?;
    let stats = replay(&small, &frames, quality(tolerance_px), EngineKind::Soar, &mut |_| {})?;
    let mut per_triangle: Vec<[f64; 4]> = stats[1..]
        .iter()
        .map(|f| {
            let ns = f.update_ms * 1e6;
            [ns / f.triangles as f64, ns / f.vertex_tests as f64, f.update_ms, f.triangles as f64]
        })
        .collect();
    per_triangle.sort_by(|a, b| a[0].total_cmp(&b[0]));
    for (name, at) in [("fastest", 0), ("median", per_triangle.len() / 2)] {
        let [ns_triangle, ns_test, ms, triangles] = per_triangle[at];
        println!(
            "| {} | {tolerance_px:.2} | {name} | {triangles:.0} | {ms:.2} | {:.1} | {ns_test:.1} |",
            small.grid().samples()[0],
            1e3 / ns_triangle,
        );
    }
    Ok(())
}
