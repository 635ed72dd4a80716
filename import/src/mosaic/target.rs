//! The grid of the mosaic, and how each sheet comes onto it.
//!
//! Its system is the one that most samples are in, its steps the shortest of the files in that system, on their grid. So files on that grid are copied. A file in another system whose steps are shorter
//! still sets the steps, as does a person who states them; then samples lie at whole multiples of the step, as in warps. Cost: a thousand projected points a sheet.

use super::lattice::{Lattice, Tied};
use super::plan::Placed;
use super::sheet::Sheet;
use crate::crs::{Ground, HorizontalSize, is_earth};
use crate::options::OpenOptions;
use crate::warp::{Mapping, Projections, Resampler, apply, mesh, three_digits};
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::hypot;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::number;

/// Samples on a side of a terrain, at most.
const MOST_SAMPLES: f64 = 65_537.0;
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

/// The grid of a mosaic.
pub(super) struct Target {
    pub(super) tied: Tied,
    pub(super) samples: [u32; 2],
    pub(super) map: [f64; 6],
    pub(super) laid: Vec<Laid>,
}

/// What a mosaic is made of, for messages: "the mosaic of 12 files".
pub(super) struct Named<'a>(pub(super) &'a Path);

/// The number of the system that most samples are in; of systems with as many the one of the first path.
pub(super) fn main_system(placed: &Placed) -> usize {
    let mut samples = vec![0u64; placed.systems.len()];
    for (source, at) in placed.sources.iter().zip(&placed.at) {
        samples[placed.lattices[at.0].system] +=
            source.samples.iter().map(|n| u64::from(*n)).product::<u64>();
    }
    let most = samples.iter().max().copied().unwrap_or(0);
    samples.iter().position(|count| *count == most).unwrap_or(0)
}

/// Why data of one system cannot be brought into another.
///
/// # Errors
/// [`LayoutError::Usage`], naming the file.
pub(super) fn check_way(path: &Path, from: &Tied, to: &Tied) -> Result<(), LayoutError> {
    let name = |tied: &Tied| match tied.system.name.as_str() {
        "" => "an unknown system".to_owned(),
        name => terrasoar_layout::words::harmless(name, 80),
    };
    let bodies = [from, to].map(|tied| tied.system.radius_m.is_none_or(is_earth));
    if bodies[0] != bodies[1] {
        return Err(LayoutError::Usage(format!(
            "{}: it lies on another body than most of the files: {} and {}; build it alone",
            path.display(),
            name(from),
            name(to)
        )));
    }
    if from.ground.is_none() || to.ground.is_none() {
        return Err(LayoutError::Usage(format!(
            "{}: it is in {} and most of the files are in {}, and one of these is not tied to the ground in a way that is known here; say which system all are in",
            path.display(),
            name(from),
            name(to)
        ))
        .mended_by(Remedy::ReferenceSystem));
    }
    Ok(())
}

/// The way from a sheet to the target's system: none where it is the same.
struct Over<'a> {
    map: [f64; 6],
    grounds: Option<(&'a Ground, &'a Ground)>,
    turn: Option<f64>,
}

impl<'a> Over<'a> {
    fn new(sheet: &Sheet, from: &'a Tied, to: &'a Tied, is_same: bool) -> Self {
        let grounds = from.ground.as_ref().zip(to.ground.as_ref()).filter(|_| !is_same);
        Self { map: sheet.map, grounds, turn: to.ground.as_ref().and_then(Ground::turn) }
    }

    /// Coordinates in the target's system, near those of `near` where longitudes go round.
    fn at(&self, at: [f64; 2], near: Option<f64>) -> Option<[f64; 2]> {
        let point = apply(&self.map, at);
        let Some((from, to)) = self.grounds else { return Some(point) };
        let mut point = from.across_to(to, point)?;
        if let (Some(turn), Some(near)) = (self.turn, near) {
            point[0] += turn * ((near - point[0]) / turn).round();
        }
        Some(point)
    }

    /// Lengths of its steps, by x and y of the target's system, at its centre.
    fn steps(&self, samples: [u32; 2]) -> Option<[f64; 2]> {
        let [x, y] = samples.map(|count| f64::from(count - 1) / 2.0);
        let centre = self.at([x, y], None)?;
        let step = |a: [f64; 2], b: [f64; 2]| {
            let [from, to] = [self.at(a, Some(centre[0]))?, self.at(b, Some(centre[0]))?];
            Some([to[0] - from[0], to[1] - from[1]])
        };
        let across = step([x - 0.5, y], [x + 0.5, y])?;
        let down = step([x, y - 0.5], [x, y + 0.5])?;
        let steps = [0, 1].map(|i| hypot(across[i], down[i]));
        steps.iter().all(|step| step.is_finite() && *step > 0.0).then_some(steps)
    }
}

impl Target {
    /// The grid in a system, which has the number `own` if it is one of the files'.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for a grid that would be too large, a resolution that is none, or data outside of what a system covers.
    pub(super) fn new(
        named: &Named<'_>,
        placed: &Placed,
        sheets: &[Sheet],
        tied: Tied,
        own: Option<usize>,
        sample_bytes: u64,
        options: &OpenOptions,
    ) -> Result<Self, LayoutError> {
        let ways: Vec<Over<'_>> = sheets
            .iter()
            .map(|sheet| Over::new(sheet, &placed.systems[sheet.system], &tied, Some(sheet.system) == own))
            .collect();
        let lattice = lattice(named, sheets, &ways, &tied, own, options)?;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut spans = Vec::new();
        let mut near = None;
        for (sheet, way) in sheets.iter().zip(&ways) {
            let (mut from, mut to) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for at in mesh(sheet.samples) {
                let Some(point) = way.at(at, near) else { continue };
                near.get_or_insert(point[0]);
                let at = lattice.index(point);
                for i in 0..2 {
                    from[i] = from[i].min(at[i]);
                    to[i] = to[i].max(at[i]);
                }
            }
            if from[0] > to[0] {
                return Err(outside(named));
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
        if counts.iter().any(|count| !(2.0..=MOST_SAMPLES).contains(count)) {
            return Err(LayoutError::Usage(format!(
                "{}: it would have {} x {} samples, and a terrain has from 2 to 65,537 on a side; name fewer files, or state a coarser resolution",
                named.0.display(),
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

/// A coarse grid over all sheets in a system of the files, for finding a system to bring them into.
pub(super) fn extent(
    named: &Named<'_>,
    placed: &Placed,
    sheets: &[Sheet],
    system: usize,
) -> Result<([f64; 6], [u32; 2]), LayoutError> {
    const CELLS: u32 = 1000;
    let tied = &placed.systems[system];
    let (mut low, mut high, mut near) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], None);
    for sheet in sheets {
        let way = Over::new(sheet, &placed.systems[sheet.system], tied, sheet.system == system);
        for point in mesh(sheet.samples).filter_map(|at| way.at(at, near)).collect::<Vec<_>>() {
            near.get_or_insert(point[0]);
            low = [0, 1].map(|i| low[i].min(point[i]));
            high = [0, 1].map(|i| high[i].max(point[i]));
        }
    }
    if low[0] > high[0] {
        return Err(outside(named));
    }
    let step = [0, 1].map(|i| (high[i] - low[i]) / f64::from(CELLS));
    Ok(([low[0], step[0], 0.0, low[1], 0.0, step[1]], [CELLS + 1; 2]))
}

/// The grid without an end on which the mosaic's samples lie.
fn lattice(
    named: &Named<'_>,
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
        let steps = way.steps(sheet.samples).ok_or_else(|| outside(named))?;
        others = [0, 1].map(|i| others[i].min(steps[i]));
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

pub(super) fn outside(named: &Named<'_>) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: a file lies outside of what its reference system or that of the mosaic covers; name another one to bring them into",
        named.0.display()
    ))
    .mended_by(Remedy::Reproject)
}
