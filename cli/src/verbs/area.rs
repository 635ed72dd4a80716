//! A part of a terrain as an argument: a rectangle in samples, in metres, or in a reference system.
//!
//! What lies beyond the terrain is left out, which is said; a rectangle that lies wholly outside is an error that tells where the terrain is. Cost: for another system than the terrain's own
//! some hundred projections.

use super::guess;
use super::output::complain;
use super::parse;
use super::siting::{frame, reach};
use anyhow::{Context, Result, bail};
use std::path::Path;
use terrasoar_import::places::Frame;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

/// Points on each side of a rectangle whose places tell which samples it holds.
const POINTS: u32 = 64;

/// Which part.
#[derive(Debug, clap::Args)]
pub(super) struct AreaArgs {
    /// Part of the terrain: west, south, east, north in metres from its south-west sample, or in what --crs says; all of it without this
    #[arg(long, value_name = "W,S,E,N", value_parser = parse::extent, allow_hyphen_values = true)]
    window: Option<[f64; 4]>,
    /// What the numbers of --window are: samples for columns and rows from the south-west one, dem for the elevation model's own coordinates, EPSG:n, WKT or a PROJ string
    #[arg(long, value_name = "SYSTEM", requires = "window")]
    crs: Option<String>,
}

impl AreaArgs {
    /// As it would be typed.
    #[cfg(feature = "pictures")]
    pub(super) fn new(window: Option<[f64; 4]>, crs: Option<String>) -> Self {
        Self { window, crs }
    }

    /// West, south, east and north of the part in metres from the south-west sample, without what lies beyond the terrain. `file` is the terrain's name in messages.
    #[cfg(feature = "pictures")]
    pub(super) fn sides_m(&self, terrain: &Terrain, file: &Path) -> Result<[f64; 4]> {
        let header = terrain.header();
        let sides = self.sides(header).with_context(|| file.display().to_string())?;
        let (extent_m, spacing_m) = (header.grid.extent_m(), header.grid.spacing_m());
        let sides: [f64; 4] =
            std::array::from_fn(|i| (sides[i] * spacing_m[i % 2]).clamp(0.0, extent_m[i % 2]));
        if sides[0] >= sides[2] || sides[1] >= sides[3] {
            bail!("{}: the window only touches the terrain{}", file.display(), self.likely(header));
        }
        let likely = self.likely(header);
        if !likely.is_empty() {
            complain(&format!(
                "note: the window was read as metres from the terrain's south-west sample{likely}"
            ));
        }
        Ok(sides)
    }

    /// Every `step`-th sample of the part, at least 2 x 2. `file` is the terrain's name in messages.
    pub(super) fn window(&self, terrain: &Terrain, file: &Path, step: u32) -> Result<SampleWindow> {
        let header = terrain.header();
        let found = self.sides(header).and_then(|sides| {
            let window = SampleWindow::within(&header.grid, sides, step);
            let [wide, high] = window.map_or([0; 2], |window| window.size);
            if wide.min(high) < 2 {
                bail!(
                    "there are {wide} x {high} samples in it, and at least 2 x 2 are needed; take a larger window or a smaller step{}",
                    self.likely(header)
                );
            }
            Ok(window)
        });
        let window = found.with_context(|| file.display().to_string())?;
        window.context("the window holds no samples")
    }

    /// What a window in metres looks more like, as a clause.
    fn likely(&self, header: &Header) -> String {
        let Some(sides) = self.window.filter(|_| self.crs.is_none()) else { return String::new() };
        guess::of_local(header, &corners(sides))
            .map(|(guess, is_inside)| {
                let would = if is_inside { "it would lie inside" } else { "it may be meant" };
                format!("; {} {would}", guess.words())
            })
            .unwrap_or_default()
    }

    /// The part's sides in samples from the south-west one.
    fn sides(&self, header: &Header) -> Result<[f64; 4]> {
        let last = header.grid.samples().map(|count| f64::from(count - 1));
        let Some(asked) = self.window else { return Ok([0.0, 0.0, last[0], last[1]]) };
        let in_samples = self.crs.as_deref().is_some_and(|crs| crs.trim().eq_ignore_ascii_case("samples"));
        let frame = if in_samples { None } else { frame(header, self.crs.as_deref())? };
        let sides = match (&frame, in_samples) {
            (_, true) => Some(asked),
            (None, _) => {
                let [east, north] = header.grid.spacing_m();
                Some([asked[0] / east, asked[1] / north, asked[2] / east, asked[3] / north])
            }
            (Some(frame), _) => around(header, frame, asked),
        };
        let extent = || {
            let reach = if in_samples {
                Some(format!("from 0,0 to {},{} samples", last[0], last[1]))
            } else {
                reach(header, frame.as_ref())
            };
            reach.map(|reach| format!(", which extends {reach}")).unwrap_or_default()
        };
        let is_apart = |[west, south, east, north]: &[f64; 4]| {
            *east < -1e-6 || *north < -1e-6 || *west > last[0] + 1e-6 || *south > last[1] + 1e-6
        };
        let Some(sides) = sides.filter(|sides| !is_apart(sides)) else {
            let hint = if in_samples {
                String::new()
            } else {
                guess::clause_of_outside(header, frame.as_ref(), &corners(asked))
            };
            bail!("the window lies outside the terrain{}{hint}", extent());
        };
        let is_beyond = |side: f64, last: f64| side < -1e-6 || side > last + 1e-6;
        if (0..4).any(|side| is_beyond(sides[side], last[side % 2])) {
            complain(&format!(
                "note: the window reaches beyond the terrain{}; what lies in both is taken",
                extent()
            ));
        }
        Ok(sides)
    }
}

/// Corners and middle of a rectangle.
fn corners([west, south, east, north]: [f64; 4]) -> [[f64; 2]; 5] {
    let middle = [0.5 * (west + east), 0.5 * (south + north)];
    [[west, south], [east, south], [west, north], [east, north], middle]
}

/// The least rectangle of samples that holds a rectangle of a system; `None` where none of it has a place.
fn around(header: &Header, frame: &Frame, [west, south, east, north]: [f64; 4]) -> Option<[f64; 4]> {
    let spacing_m = header.grid.spacing_m();
    let mut sides = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for i in 0..=POINTS {
        let share = f64::from(i) / f64::from(POINTS);
        let (x, y) = (west + share * (east - west), south + share * (north - south));
        for place in [[x, south], [x, north], [west, y], [east, y]] {
            let Some(place_m) = frame.place_m(place) else { continue };
            for axis in 0..2 {
                let at = place_m[axis] / spacing_m[axis];
                sides[axis] = sides[axis].min(at);
                sides[axis + 2] = sides[axis + 2].max(at);
            }
        }
    }
    sides.iter().all(|side| side.is_finite()).then_some(sides)
}

/// Every how many samples: a power of two up to 32,768.
pub(super) fn step(text: &str) -> Result<u32, String> {
    match text.trim().parse::<u32>() {
        Ok(step) if step.is_power_of_two() && step <= 1 << 15 => Ok(step),
        _ => Err("it must be a power of two: 1, 2, 4, 8, ... 32768".into()),
    }
}
