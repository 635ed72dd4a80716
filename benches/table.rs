//! The whole table of what is claimed against other engines, in one run.
//!
//! Question: do the figures of docs/figures.md hold here? Data: synthetic terrain, made first; terrain files named on the command line are flown over as well. Command:
//!
//!     cargo bench --bench table -- [TERRAIN.iqt ...] [--large] [--frames 300]
//!
//! It makes the terrains and runs the other benchmarks in turn, each in a process of its own: `kinetic` over 8,193 x 8,193 samples, over 16,385 x 16,385 with `--large`, and over the
//! files named; `craters` over 4,097 x 4,097 samples; `figures`, which has SMART, SOAR alone and the build. Every part prints its Markdown and its seconds. Leave the machine alone
//! meanwhile. Keep runs under benches/runs/.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use terrasoar_import::synth::{SynthOptions, write};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;

type Failure = Box<dyn std::error::Error>;

/// Extent of the synthetic terrain in metres, whatever its size in samples.
const EXTENT_M: f64 = 163_840.0;

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut terrains, mut is_large, mut frames) = (Vec::new(), false, "300".to_owned());
    while let Some(word) = words.next() {
        match word.as_str() {
            "--large" => is_large = true,
            "--frames" => frames = words.next().ok_or("--frames wants a number")?,
            _ if word.starts_with("--") => return Err(format!("unknown argument {word}").into()),
            _ => terrains.push(std::path::absolute(PathBuf::from(word))?),
        }
    }
    let start = Instant::now();
    let folder = tempfile::tempdir()?;
    println!("{} cores, {}\n", std::thread::available_parallelism()?, std::env::consts::ARCH);
    let small = synthetic(folder.path(), 4097)?;
    let mut flown = vec![synthetic(folder.path(), 8193)?];
    if is_large {
        flown.push(synthetic(folder.path(), 16_385)?);
    }
    flown.extend(terrains);
    for terrain in &flown {
        part("kinetic", &[text(terrain)?, "--frames", &frames])?;
    }
    part("craters", &[text(&small)?])?;
    part("figures", &["--size", "4097", "--frames", "100"])?;
    println!("\nAll of it: {:.0} s.", start.elapsed().as_secs_f64());
    Ok(())
}

fn text(path: &Path) -> Result<&str, Failure> {
    Ok(path.to_str().ok_or("the path is not Unicode")?)
}

/// A synthetic terrain of so many samples a side.
fn synthetic(folder: &Path, size: u32) -> Result<PathBuf, Failure> {
    let start = Instant::now();
    let dem = folder.join(format!("synthetic-{size}.tif"));
    let out = dem.with_extension("iqt");
    let spacing_m = EXTENT_M / f64::from(size - 1);
    write(&SynthOptions::default().size(size).seed(1).spacing_m(spacing_m), &dem, &|_| {})?;
    build(&*terrasoar_import::open(std::slice::from_ref(&dem))?, &out, &BuildOptions::default(), &Silent)?;
    std::fs::remove_file(&dem)?;
    println!("{size} x {size} samples: made in {:.1} s", start.elapsed().as_secs_f64());
    Ok(out)
}

/// Runs another benchmark and waits for it.
fn part(name: &str, arguments: &[&str]) -> Result<(), Failure> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let start = Instant::now();
    println!("\n# {name}\n\n    cargo bench --bench {name} -- {}\n", arguments.join(" "));
    let status = Command::new(cargo)
        .args(["bench", "--quiet", "--bench", name, "--"])
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status()?;
    println!("\n({name}: {:.0} s)", start.elapsed().as_secs_f64());
    if status.success() { Ok(()) } else { Err(format!("{name} failed").into()) }
}
