//! The sweeps of a comparison: speed-up by tolerance and by incoherence, the SMART paper's figures 9 and 10.
//!
//! A point flies a short stretch: the middle of the flight for tolerances, a new flight of the same kind at a solved speed for
//! incoherences. An incoherence that this terrain and flight cannot reach is left out, with a note.

use super::progress::Meter;
use super::replay::fly;
use anyhow::Result;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround};
use terrasoar::flight::incoherence::{SolveError, solve};
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::flyover::{EngineKind, Quality, mean_incoherence_percent};
use terrasoar::stats::Comparison;
use terrasoar_lab::report::SweepPoint;
use terrasoar_layout::read::terrain::Terrain;

/// Frames a point.
const FRAMES: usize = 120;
/// Tolerances in pixels.
const TOLERANCES_PX: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];
/// Incoherences in percent.
const INCOHERENCES_PERCENT: [f64; 3] = [0.6, 1.4, 5.3];

/// What is swept over.
pub(super) struct Sweep<'a> {
    pub(super) terrain: &'a Terrain,
    pub(super) flight: &'a Flight,
    pub(super) quality: Quality,
    pub(super) engines: &'a [EngineKind],
    pub(super) progress: &'a Meter,
}

impl Sweep<'_> {
    /// About how many frames both sweeps fly: each engine flies each twice. Finding speeds comes on top.
    pub(super) fn frames(&self) -> u64 {
        let stretch = self.flight.frames.len().min(FRAMES);
        let once = TOLERANCES_PX.len() * stretch + INCOHERENCES_PERCENT.len() * FRAMES;
        (2 * once * self.engines.len()) as u64
    }

    /// The same stretch at each tolerance.
    pub(super) fn by_tolerance(&self) -> Result<Vec<SweepPoint>> {
        let frames = &self.flight.frames;
        let first = frames.len().saturating_sub(FRAMES) / 2;
        let stretch = &frames[first..(first + FRAMES).min(frames.len())];
        let mut points = Vec::new();
        for tolerance_px in TOLERANCES_PX {
            let quality = self.quality.tolerance_px(tolerance_px);
            points.extend(self.points(
                tolerance_px,
                &format!("{tolerance_px} px"),
                stretch,
                None,
                quality,
            )?);
        }
        Ok(points)
    }

    /// Flights of the same kind at each incoherence.
    pub(super) fn by_incoherence(&self) -> Result<Vec<SweepPoint>> {
        let ground = TerrainGround::new(self.terrain);
        let plan = self.plan();
        let mut points = Vec::new();
        for percent in INCOHERENCES_PERCENT {
            self.progress.begin(format!("speed for {percent} %"), 0);
            let solution = solve(&ground, &plan, percent, |pairs| {
                mean_incoherence_percent(self.terrain, pairs, self.quality)
            });
            ground.check()?;
            let (frames, speed) = match solution {
                Ok(solution) => (solution.flight.frames, solution.best.speed_m_per_frame),
                Err(error @ (SolveError::Unreachable { .. } | SolveError::Jumps { .. })) => {
                    self.progress.note(&format!("note: the sweep leaves out {percent} %: {error}"));
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            points.extend(self.points(
                percent,
                &format!("{percent} %"),
                &frames,
                Some(speed),
                self.quality,
            )?);
        }
        Ok(points)
    }

    /// A short flight of the kind that the flight says it is.
    fn plan(&self) -> FlightPlan {
        let note =
            |name: &str| self.flight.notes.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str());
        let kind = note("flight").and_then(|kind| kind.parse().ok()).unwrap_or(FlightKind::Straight);
        let mut plan = FlightPlan::new(kind, FRAMES as u64, 0.0);
        if let Some(rate) = note("turn-rate-deg-per-frame").and_then(|rate| rate.parse().ok()) {
            plan.turn_rate_deg_per_frame = rate;
        }
        if let Some(frame) = self.flight.frames.first() {
            plan.vertical_fov_deg = frame.vertical_fov_deg;
        }
        plan
    }

    fn points(
        &self,
        x: f64,
        title: &str,
        frames: &[FlightFrame],
        speed_m_per_frame: Option<f64>,
        quality: Quality,
    ) -> Result<Vec<SweepPoint>> {
        let mut runs = Vec::new();
        for engine in self.engines {
            let title = format!("{title}, {}", engine.name());
            let flown = fly(self.terrain, frames, quality, *engine, &title, self.progress)?;
            runs.push((engine.name().to_owned(), flown));
        }
        let points = Comparison::of(&runs).engines.into_iter().map(|engine| SweepPoint {
            x,
            frames: engine.summary.frames,
            triangles_mean: engine.summary.triangles_mean,
            incoherence_percent: engine.summary.incoherence_percent,
            speed_m_per_frame,
            engine: engine.summary.engine,
            speedup_median: engine.speedup_median,
            vertex_tests_ratio: engine.vertex_tests_ratio,
        });
        Ok(points.collect())
    }
}
