//! A headless replay: flies a straight line over a terrain file with three engines and prints what each did. They draw the same triangles.
//!
//!     cargo run --release --example replay -- TERRAIN.iqt

use std::error::Error;
use terrasoar::MappedTerrain;
use terrasoar::flight::FlightFrame;
use terrasoar::flyover::{EngineKind, Quality, replay};
use terrasoar::stats::ReplaySummary;

const FRAMES: u32 = 200;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: replay TERRAIN.iqt")?;
    // Mapped: soar and smart want all records at hand.
    let terrain = MappedTerrain::open(&path)?;
    let [east_m, north_m] = terrain.file().grid().extent_m();
    let top_m = terrain.file().header().height_range_m[1];
    let frames: Vec<FlightFrame> = (0..FRAMES)
        .map(|i| FlightFrame {
            time_s: f64::from(i) / 30.0,
            eye_m: [
                0.5 * east_m,
                (0.1 + 0.5 * f64::from(i) / f64::from(FRAMES)) * north_m,
                top_m + 0.02 * east_m,
            ],
            yaw_deg: 0.0,
            pitch_deg: -15.0,
            roll_deg: 0.0,
            vertical_fov_deg: 45.0,
        })
        .collect();
    for engine in [EngineKind::Soar, EngineKind::Smart, EngineKind::Kinetic] {
        let stats = replay(terrain.file(), &frames, Quality::default(), engine, &mut |_| {})?;
        let summary = ReplaySummary::of(engine.name(), &stats);
        println!(
            "{:8} {:>9.0} triangles a frame, {:>11} vertex tests in all, {:.3} ms an update (median)",
            engine.name(),
            summary.triangles_mean,
            summary.vertex_tests_total,
            summary.update_ms.p50,
        );
    }
    Ok(())
}
