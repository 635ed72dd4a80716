//! What does unpacking cost, stage by stage? Megabytes of records a second, of one thread.
//!
//! `cargo bench -p terrasoar-layout --features testing --bench packed -- FILE` for a packed file; without one for generated ground of 4,097 x 4,097 samples. Times are the thread's processor time, the least
//! of several rounds in which the stages take turns.

use std::sync::OnceLock;
use std::time::{Duration, Instant};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::testing::{Stages, Way};

const ROUNDS: usize = 7;

type Failure = Box<dyn std::error::Error>;
type Stage = (&'static str, fn(&mut Stages) -> Result<(), Failure>);

const STAGES: [Stage; 6] = [
    ("values alone", |stages| {
        stages.values();
        Ok(())
    }),
    ("what is made of them alone", |stages| {
        stages.making();
        Ok(())
    }),
    ("tiles", |stages| Ok(stages.tiles()?)),
    ("pages, neighbours together", |stages| Ok(stages.neighbours()?)),
    ("pages, in the file's order", |stages| Ok(stages.pages()?)),
    ("checksums of pages alone", |stages| {
        stages.checksums();
        Ok(())
    }),
];

/// Ground with detail at every scale.
fn height(x: u32, y: u32) -> f64 {
    let noise = |seed: u64, x: u32, y: u32| {
        let mut h = seed ^ (u64::from(x) << 32 | u64::from(y)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        h = (h ^ h >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((h ^ h >> 32) % 4096) as f64 / 4096.0 - 0.5
    };
    let octave = |octave: u32| {
        let cell = 512u32 >> octave;
        let (fx, fy) = (f64::from(x % cell) / f64::from(cell), f64::from(y % cell) / f64::from(cell));
        let at = |i: u32, j: u32| noise(octave.into(), x / cell + i, y / cell + j);
        let south = at(0, 0) * (1.0 - fx) + at(1, 0) * fx;
        let north = at(0, 1) * (1.0 - fx) + at(1, 1) * fx;
        f64::from(cell) * (south * (1.0 - fy) + north * fy)
    };
    (3000.0 + (0..10).map(octave).sum::<f64>()).round()
}

fn generated() -> Result<Vec<u8>, Failure> {
    let folder = tempfile::tempdir()?;
    let [plain, packed] = ["t.iqt", "t.iqp"].map(|name| folder.path().join(name));
    let dem = MemoryDem::from_fn([4097; 2], SampleType::I16, height);
    build(&dem, &plain, &BuildOptions::default().spacing_m([30.0, 30.0]), &Silent)?;
    pack(&SystemDisk, &plain, &packed, &Silent)?;
    Ok(std::fs::read(packed)?)
}

/// The processor time of this thread; where the system does not tell it, the time.
fn thread_time() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|told| told.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}

/// Seconds that it takes, as the mean of so many times that the clock can tell.
fn seconds(mut stage: impl FnMut() -> Result<(), Failure>) -> Result<f64, Failure> {
    let start = thread_time();
    for times in 1.. {
        stage()?;
        let taken = thread_time() - start;
        if taken > Duration::from_millis(60) {
            return Ok(taken.as_secs_f64() / f64::from(times));
        }
    }
    Ok(f64::MAX)
}

fn main() -> Result<(), Failure> {
    let mut files: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    let only = std::env::var("STAGE").ok();
    if files.is_empty() {
        files.push(String::new());
    }
    for file in files {
        let bytes = if file.is_empty() { generated()? } else { std::fs::read(&file)? };
        let packed = bytes.len();
        let mut stages = Stages::open(bytes)?;
        let records_mb = 4.0 * stages.records() as f64 / 1e6;
        let name = if file.is_empty() { "generated" } else { &file };
        println!("\n{name}: {packed} bytes, {records_mb:.1} MB of records\n");
        println!("| stage | instructions | MB/s |\n|---|---|---|");
        let mut ways = Way::all();
        if let Ok(way) = std::env::var("WAY") {
            ways.retain(|known| known.name() == way);
        }
        let mut least = vec![[f64::MAX; STAGES.len()]; ways.len()];
        for _ in 0..ROUNDS {
            for (way, least) in ways.iter().zip(&mut least) {
                stages.read(*way);
                for ((name, stage), least) in STAGES.iter().zip(least) {
                    if only.as_ref().is_none_or(|only| only == name) {
                        *least = least.min(seconds(|| stage(&mut stages))?);
                    }
                }
            }
        }
        for ((i, (name, _)), (way, least)) in
            STAGES.iter().enumerate().flat_map(|stage| ways.iter().zip(&least).map(move |way| (stage, way)))
        {
            // Checksums are what they are with any of them.
            if way.is_portable() || !name.starts_with("checksums") {
                println!("| {name} | {} | {:.0} |", way.name(), records_mb / least[i]);
            }
        }
        let (unpacked, tiles) = stages.unpacked();
        println!("\n{tiles} tiles; {unpacked} were unpacked for pages, rounds all together.");
    }
    Ok(())
}
