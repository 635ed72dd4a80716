//! The difference of two grounds: second less first, at the first one's samples.
//!
//! Where both have the same samples these are compared; else the second one's height is interpolated bilinearly at the place of each sample of the first, brought into the second one's system. Where either has no
//! height there is no difference. **What single precision cannot tell apart is equal,** so that heights which went through a file of single precision are what they were. Cost: two
//! readings, and a microsecond a sample where systems differ.

mod survey;

pub use survey::{Extreme, Reduced, Summary};

use crate::export::{Meaning, Numbers, Written, write_raster};
use crate::places::{Crs, Doubt, Frame};
use crate::raster::{Raster, TerrainSamples};
use std::path::Path;
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::portable::hypot;
use terrasoar_layout::progress::Progress;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

/// Samples that lie so little apart, in samples, are the same.
const SAME: f64 = 1e-6;

/// Two grounds to be compared.
pub struct Difference<'t> {
    first: TerrainSamples<'t>,
    second: TerrainSamples<'t>,
    header: &'t Header,
    window: SampleWindow,
    /// The first terrain, and the second one in the first one's system; nothing where samples are the same.
    frames: Option<(Frame, Frame)>,
}

impl<'t> Difference<'t> {
    /// Compares `second` with `first` at the samples of `window`, which is a part of the first.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] where the samples differ and it is not known where on the ground they lie, or no way leads from one system to the other; for a window outside.
    pub fn new(first: &'t Terrain, second: &'t Terrain, window: &SampleWindow) -> Result<Self, LayoutError> {
        let headers = [first.header(), second.header()];
        let frames =
            if are_same(headers) { None } else { Some(frames(headers, [first.path(), second.path()])?) };
        let other = if frames.is_none() { *window } else { SampleWindow::of(second.grid()) };
        Ok(Self {
            first: TerrainSamples::new(first, *window)?,
            second: TerrainSamples::new(second, other)?,
            header: first.header(),
            window: *window,
            frames,
        })
    }

    /// Whether heights of the second ground are interpolated, for it has other samples.
    pub fn is_interpolated(&self) -> bool {
        self.frames.is_some()
    }

    /// How far places may be off, where a shift between datums is not known well.
    pub fn doubt(&self) -> Option<Doubt> {
        self.frames.as_ref().and_then(|(_, second)| second.doubt())
    }

    /// Writes the differences in metres as a cloud-optimised GeoTIFF, in single precision.
    ///
    /// # Errors
    /// As [`crate::export::export_heights`].
    pub fn export(&self, out: &Path, progress: &dyn Progress) -> Result<Written, LayoutError> {
        let meaning = Meaning {
            file: "Differences of terrain heights in metres, second less first".into(),
            band: "difference of heights".into(),
            are_heights: false,
        };
        write_raster(self, &meaning, Numbers::Float32, self.header, &self.window, out, progress)
    }

    /// Heights of both at the samples of a window, rows from the north.
    fn heights(&self, window: Window, heights: &mut [Vec<f64>; 2]) -> Result<(), LayoutError> {
        let [first, second] = heights;
        self.first.read(window, first)?;
        let Some((here, there)) = &self.frames else { return self.second.read(window, second) };
        second.clear();
        let spacing_m = self.header.grid.spacing_m();
        let north = self.window.size[1] - 1;
        self.second.with_reader(|reader| {
            for row in window.row..window.row + window.height {
                for column in window.col..window.col + window.width {
                    let p = self.window.point(column, north - row);
                    let place_m = [f64::from(p.x()) * spacing_m[0], f64::from(p.y()) * spacing_m[1]];
                    let place = here.coordinates(place_m).and_then(|place| there.place_m(place));
                    let height = match place {
                        Some([east, north]) => reader.height_m(east, north)?,
                        None => None,
                    };
                    second.push(height.unwrap_or(f64::NAN));
                }
            }
            Ok(())
        })
    }
}

impl Raster for Difference<'_> {
    fn size(&self) -> [u32; 2] {
        self.window.size
    }

    /// Where the first ground has no height, or neither has one.
    fn has_nothing(&self, window: Window) -> Result<bool, LayoutError> {
        Ok(self.first.is_void(window)? || self.have_nothing(window)?)
    }

    fn read(&self, window: Window, into: &mut Vec<f64>) -> Result<(), LayoutError> {
        let mut heights = [Vec::new(), Vec::new()];
        self.heights(window, &mut heights)?;
        into.clear();
        into.extend(heights[0].iter().zip(&heights[1]).map(|(first, second)| difference(*first, *second)));
        Ok(())
    }
}

impl Difference<'_> {
    /// Whether neither ground has a height at the samples of a window, as far as is known without a look at each. Places are computed on a mesh; between its nodes they lie no farther from the nearest than that
    /// from its neighbours.
    pub(super) fn have_nothing(&self, window: Window) -> Result<bool, LayoutError> {
        const NODES: usize = 9;
        if !self.first.is_void(window)? {
            return Ok(false);
        }
        let Some((here, there)) = &self.frames else { return self.second.is_void(window) };
        let spacing_m = self.header.grid.spacing_m();
        let south = f64::from(self.window.size[1] - window.row - window.height);
        let from = [f64::from(window.col), south];
        let step = [window.width, window.height].map(|side| f64::from(side - 1) / (NODES - 1) as f64);
        let place_m = |axis: usize, at: usize| {
            let sample = from[axis] + at as f64 * step[axis];
            (f64::from(self.window.from[axis]) + sample * f64::from(self.window.step)) * spacing_m[axis]
        };
        let of_second = self.second.grid();
        let other_m = of_second.spacing_m();
        let mut nodes = [[[0.0; 2]; NODES]; NODES];
        for (y, row) in nodes.iter_mut().enumerate() {
            for (x, node) in row.iter_mut().enumerate() {
                let place_m = [place_m(0, x), place_m(1, y)];
                let found = here.coordinates(place_m).and_then(|place| there.place_m(place));
                let Some(found) = found.filter(|place| place.iter().all(|v| v.is_finite())) else {
                    return Ok(false);
                };
                *node = [found[0] / other_m[0], found[1] / other_m[1]];
            }
        }
        let mut sides = [[0.0; 2]; 2];
        for (axis, sides) in sides.iter_mut().enumerate() {
            let at = |y: usize, x: usize| nodes[y][x][axis];
            let mut apart = 0.0f64;
            *sides = [f64::INFINITY, f64::NEG_INFINITY];
            for (y, x) in (0..NODES).flat_map(|y| (0..NODES).map(move |x| (y, x))) {
                *sides = [sides[0].min(at(y, x)), sides[1].max(at(y, x))];
                apart = apart
                    .max((at(y, x) - at(y, x.max(1) - 1)).abs())
                    .max((at(y, x) - at(y.max(1) - 1, x)).abs());
            }
            // A height is made of the samples around its place.
            *sides = [sides[0] - apart - 1.0, sides[1] + apart + 1.0];
        }
        let [[west, east], [south, north]] = sides;
        match SampleWindow::within(of_second, [west, south, east, north], 1) {
            Some(part) => self.second.with_reader(|reader| reader.is_void(&part)),
            None => Ok(true),
        }
    }
}

/// Second less first; 0 where single precision does not tell them apart.
fn difference(first: f64, second: f64) -> f64 {
    let difference = second - first;
    let rounding = f64::from(f32::EPSILON) * first.abs().max(second.abs());
    if difference.abs() <= rounding { 0.0 } else { difference }
}

/// Whether two terrains have their samples at the same places, as far as is known.
fn are_same([first, second]: [&Header; 2]) -> bool {
    if first.grid.samples() != second.grid.samples() {
        return false;
    }
    let [wide, high] = first.grid.samples().map(|count| f64::from(count - 1));
    match (first.sample_to_crs, second.sample_to_crs) {
        (Some(a), Some(b)) => {
            let near = |x: f64, y: f64| {
                (0..2).all(|axis| {
                    let at = |m: &[f64; 6]| m[3 * axis] + m[3 * axis + 1] * x + m[3 * axis + 2] * y;
                    let sample = hypot(a[3 * axis + 1], a[3 * axis + 2]);
                    (at(&a) - at(&b)).abs() <= SAME * sample
                })
            };
            let is_system_same = match (Crs::of(first), Crs::of(second)) {
                (Some(a), Some(b)) => a.is_same(&b) || a.is_unnamed() || b.is_unnamed(),
                // What does not know its system may be in the other's.
                _ => true,
            };
            is_system_same && [[0.0, 0.0], [wide, 0.0], [0.0, high]].iter().all(|[x, y]| near(*x, *y))
        }
        // Without places there is the spacing.
        _ => {
            let [a, b] = [first, second].map(|header| header.grid.spacing_m());
            (0..2).all(|axis| (a[axis] / b[axis] - 1.0).abs() <= SAME / wide.max(high).max(1.0))
        }
    }
}

/// The first terrain in its own system, and the second one in that of the first.
fn frames(
    [first, second]: [&Header; 2],
    [first_path, second_path]: [&Path; 2],
) -> Result<(Frame, Frame), LayoutError> {
    let lost = |path: &Path, what: &str| {
        LayoutError::Usage(format!(
            "{}: the two terrains have different samples, and this one does not know {what}, for its elevation model did not say; build it again from data that does, or both on one grid",
            path.display()
        ))
    };
    let own = |header, path| Frame::own(header).ok_or_else(|| lost(path, "where on the ground it lies"));
    let (here, there) = (own(first, first_path)?, own(second, second_path)?);
    let is_known = |frame: &Frame| frame.crs().is_some();
    match (is_known(&here), is_known(&there)) {
        (false, false) => Ok((here, there)),
        (false, true) => Err(lost(first_path, "its reference system")),
        (true, false) => Err(lost(second_path, "its reference system")),
        (true, true) => {
            let crs = here.crs().cloned();
            let there = crs.map_or(Ok(there), |crs| {
                Frame::of(second, &crs)
                    .map_err(|error| LayoutError::Usage(format!("{}: {error}", second_path.display())))
            })?;
            Ok((here, there))
        }
    }
}
