//! The grid of the mosaic, and how each sheet comes onto it.
//!
//! Its system is the one that most samples are in, its steps the shortest of the files in that system, on their grid. So files on that grid are copied. A file in another system whose steps are shorter
//! still sets the steps, as does a person who states them; then samples lie at whole multiples of the step, as in warps. Cost: a thousand projected points a sheet.

use super::across::{Over, outside};
use super::aim::Aim;
use super::lattice::{Lattice, Tied};
use super::plan::Placed;
use super::sheet::Sheet;
use crate::cells::Cells;
use crate::crs::HorizontalSize;
use crate::options::OpenOptions;
use crate::warp::{Mapping, Projections, Resampler, three_digits};
use std::path::Path;
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::{MOST_SAMPLES, MOST_SAMPLES_WORDS};
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::number;

/// How much shorter steps of another system must be to count.
const SHORTER: f64 = 0.95;
/// What lies within a thousandth of a step of the edge of a sample lies on it.
const NEAR: f64 = 1e-3;

/// How a sheet comes onto the grid.
pub(super) enum Way {
    /// Sample by sample: column and row of its first one.
    Copied([i64; 2]),
    /// New samples are made.
    Resampled(Box<Resampler>),
}

/// A sheet on the grid.
pub(super) struct Laid {
    pub(super) way: Way,
    /// Columns and rows of the grid that it may cover: from, to (not included).
    pub(super) from: [u32; 2],
    pub(super) to: [u32; 2],
}

impl Laid {
    /// Whether a window of the grid may have samples of the sheet, whose files lie in `cells`.
    pub(super) fn meets(&self, window: Window, cells: &Cells) -> bool {
        let is_within = window.col < self.to[0]
            && window.row < self.to[1]
            && window.col + window.width > self.from[0]
            && window.row + window.height > self.from[1];
        is_within
            && match &self.way {
                Way::Copied(at) => cells.touch(
                    [i64::from(window.col) - at[0], i64::from(window.row) - at[1]],
                    [window.width, window.height],
                ),
                Way::Resampled(resampler) => resampler.may_touch(window, cells),
            }
    }
}

/// The grid of a mosaic.
pub(super) struct Target {
    pub(super) tied: Tied,
    pub(super) samples: [u32; 2],
    pub(super) map: [f64; 6],
    pub(super) laid: Vec<Laid>,
}

impl Target {
    /// The grid in a system.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for a grid that would be too large, a resolution that is none, or data outside of what a system covers.
    pub(super) fn new(
        name: &Path,
        placed: &Placed,
        sheets: &[Sheet],
        Aim { tied, own, .. }: Aim,
        sample_bytes: u64,
        options: &OpenOptions,
    ) -> Result<Self, LayoutError> {
        let ways: Vec<Over<'_>> = sheets
            .iter()
            .map(|sheet| {
                Over::new(&sheet.map, &placed.systems[sheet.system], &tied, Some(sheet.system) == own)
            })
            .collect();
        let lattice = lattice(name, placed, sheets, &ways, &tied, own, options)?;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut spans = Vec::new();
        let mut near = None;
        for (sheet, way) in sheets.iter().zip(&ways) {
            let (mut from, mut to) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for point in way.mesh(sheet, placed, &mut near) {
                let at = lattice.index(point);
                for i in 0..2 {
                    from[i] = from[i].min(at[i]);
                    to[i] = to[i].max(at[i]);
                }
            }
            if from[0] > to[0] {
                return Err(outside(name));
            }
            // Coarser samples of the same system add no rim of half a step, where finer ones would be made of nothing beyond.
            let may_be_inner = way.grounds.is_none() && options.resolution.is_none();
            for i in 0..2 {
                let half = 0.5 * (sheet.map[[1, 5][i]] / lattice.step[i]).abs();
                let (mut begin, mut end) = (from[i], to[i]);
                if may_be_inner && half > 0.5 + NEAR {
                    begin = (from[i] + half - NEAR).ceil() - 0.5;
                    end = (to[i] - half + NEAR).floor() + 0.5;
                }
                low[i] = low[i].min(begin);
                high[i] = high[i].max(end);
            }
            spans.push((from, to));
        }
        let first = low.map(|low| (low + 0.5 + NEAR).floor());
        let counts: [f64; 2] = std::array::from_fn(|i| (high[i] - 0.5 - NEAR).ceil() - first[i] + 1.0);
        if counts.iter().any(|count| !(2.0..=f64::from(MOST_SAMPLES)).contains(count)) {
            return Err(LayoutError::Usage(format!(
                "{}: it would have {} x {} samples, and a terrain has from 2 to {MOST_SAMPLES_WORDS} on a side; name fewer files, or state a coarser resolution",
                name.display(),
                number(counts[0]),
                number(counts[1])
            ))
            .mended_by(Remedy::Resolution));
        }
        let samples = counts.map(|count| count as u32);
        let map = lattice.map(first.map(|first| first as i64));
        let resampling = options.resampling.unwrap_or_default();
        let mut laid = Vec::new();
        for ((sheet, way), (from, to)) in sheets.iter().zip(&ways).zip(&spans) {
            let copied = way.grounds.is_none().then(|| lattice.place(&sheet.map, sheet.samples)).flatten();
            let way = match copied {
                Some(at) => Way::Copied([0, 1].map(|i| at[i] - first[i] as i64)),
                None => {
                    let both =
                        way.grounds.map(|(old, new)| Projections { old: old.clone(), new: new.clone() });
                    let mapping = Mapping::new(map, sheet.map, sheet.samples[0], both);
                    let new = [0, 1].map(|i| to[i] - from[i]);
                    Way::Resampled(Box::new(Resampler::new(
                        mapping,
                        resampling,
                        sheet.samples,
                        new,
                        sample_bytes,
                    )))
                }
            };
            // A margin for what the mesh of the rim did not meet.
            let clip = |value: f64, i: usize| (value - first[i]).clamp(0.0, counts[i]) as u32;
            laid.push(Laid {
                way,
                from: [0, 1].map(|i| clip((from[i] - 8.0).floor(), i)),
                to: [0, 1].map(|i| clip((to[i] + 9.0).ceil(), i)),
            });
        }
        Ok(Self { tied, samples, map, laid })
    }
}

/// The grid without an end on which the mosaic's samples lie.
fn lattice(
    name: &Path,
    placed: &Placed,
    sheets: &[Sheet],
    ways: &[Over<'_>],
    tied: &Tied,
    own: Option<usize>,
    options: &OpenOptions,
) -> Result<Lattice, LayoutError> {
    let signs = tied.system.signs;
    let multiples = |steps: [f64; 2]| Lattice {
        system: 0,
        origin: [0.0; 2],
        step: [signs[0] * steps[0], -signs[1] * steps[1]],
    };
    if let Some(metres) = options.resolution {
        if !(metres.is_finite() && metres > 0.0) {
            return Err(LayoutError::Usage("a resolution is a number of metres above 0".into()));
        }
        let step = match tied.system.unit.as_ref().map(|unit| unit.size) {
            Some(HorizontalSize::Metres(size)) => metres / size,
            Some(HorizontalSize::Radians(size)) => {
                metres / (tied.system.radius_m.unwrap_or(6_378_137.0) * size)
            }
            None => metres,
        };
        return Ok(multiples([step; 2]));
    }
    // The shortest steps by columns and by rows, each with the grid that has them.
    let mut shortest: Option<Lattice> = None;
    for sheet in sheets.iter().filter(|sheet| Some(sheet.system) == own) {
        let one = Lattice::of(0, &sheet.map);
        let best = shortest.get_or_insert(one);
        for i in 0..2 {
            let [new, old] = [one.step[i].abs(), best.step[i].abs()];
            let is_shorter = new < old * (1.0 - 1e-9);
            // Of grids alike the one that begins farther west, whatever the order of files.
            let is_before = new <= old * (1.0 + 1e-9) && one.origin[i] < best.origin[i];
            if is_shorter || is_before {
                (best.origin[i], best.step[i]) = (one.origin[i], one.step[i]);
            }
        }
    }
    let mut others = [f64::INFINITY; 2];
    for (sheet, way) in sheets.iter().zip(ways).filter(|(sheet, _)| Some(sheet.system) != own) {
        // A file that the system covers beside its centre sets no steps.
        if let Some(steps) = way.steps(sheet, placed) {
            others = [0, 1].map(|i| others[i].min(steps[i]));
        }
    }
    if shortest.is_none() && others[0].is_infinite() {
        return Err(outside(name));
    }
    Ok(match shortest {
        Some(lattice) if (0..2).all(|i| others[i] >= SHORTER * lattice.step[i].abs()) => lattice,
        Some(lattice) => multiples([0, 1].map(|i| {
            if others[i] < SHORTER * lattice.step[i].abs() {
                three_digits(others[i])
            } else {
                lattice.step[i].abs()
            }
        })),
        None => multiples(others.map(three_digits)),
    })
}
