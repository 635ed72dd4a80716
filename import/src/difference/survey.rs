//! What two grounds differ by, in numbers, and as a small picture.
//!
//! A sample stands for the rectangle around it, one spacing wide and high: volumes are sums of differences times its area, as in any program that counts pixels. Sums are taken tile by tile and added in
//! the order of tiles, so that threads do not show. What is void in both is passed over.

use super::{Difference, difference};
use crate::cells::cells_met;
use rayon::prelude::*;
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::progress::Progress;

/// Samples a side of a tile.
const TILE: u32 = 512;

/// A largest difference, and where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// Metres, second less first.
    pub difference_m: f64,
    /// Column and row of the sample, from the first terrain's south-west one.
    pub sample: [u32; 2],
}

/// What the differences add up to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Summary {
    /// Samples at which both have a height.
    pub compared: u64,
    /// Those whose heights differ.
    pub changed: u64,
    /// Samples where the first alone has a height, and where the second alone has one.
    pub alone: [u64; 2],
    /// Mean of the differences in metres, of all that were compared.
    pub mean_m: f64,
    /// Square root of the mean of their squares.
    pub rms_m: f64,
    /// The lowest difference; none where nothing was compared.
    pub lowest: Option<Extreme>,
    /// The highest.
    pub highest: Option<Extreme>,
    /// Cubic metres by which the second ground lies below the first.
    pub cut_m3: f64,
    /// Cubic metres by which it lies above.
    pub fill_m3: f64,
    /// Square metres whose height differs.
    pub changed_m2: f64,
}

/// The differences in small: of the samples that a pixel stands for the one that differs most.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Samples a pixel, each way.
    pub samples: u32,
    /// Metres, rows from the north; NaN where nothing was compared.
    pub differences_m: Vec<f32>,
}

/// What a tile adds.
struct Part {
    window: Window,
    compared: u64,
    changed: u64,
    alone: [u64; 2],
    sum: f64,
    squares: f64,
    below: f64,
    above: f64,
    lowest: Option<Extreme>,
    highest: Option<Extreme>,
    reduced: Vec<f32>,
}

impl Difference<'_> {
    /// Compares all samples; the picture has at most `most` pixels a side, 128 or more. Works on the current rayon pool.
    ///
    /// # Errors
    /// Damage in one of the terrains; I/O.
    pub fn survey(&self, most: u32, progress: &dyn Progress) -> Result<(Summary, Reduced), LayoutError> {
        let size = self.window.size;
        let longest = size[0].max(size[1]);
        let samples = longest.div_ceil(most.max(128)).next_power_of_two().min(TILE);
        progress.stage("comparing", self.window.samples());
        // Oceans are found from the whole down, half by half.
        let is_met = |window| Ok(!self.have_nothing(window)?);
        let pass = |window: Window| {
            progress.advance(u64::from(window.width) * u64::from(window.height));
            Ok(())
        };
        let tiles = cells_met(size, TILE, is_met, pass)?;
        let parts: Vec<Part> = tiles
            .into_par_iter()
            .map(|window| {
                let part = self.part(window, samples);
                progress.advance(u64::from(window.width) * u64::from(window.height));
                part
            })
            // Of oceans nothing is kept.
            .filter(|part| {
                part.as_ref().map_or(true, |part| part.compared + part.alone[0] + part.alone[1] > 0)
            })
            .collect::<Result<_, LayoutError>>()?;
        let reduced_size = size.map(|side| side.div_ceil(samples));
        let mut reduced = vec![f32::NAN; reduced_size[0] as usize * reduced_size[1] as usize];
        for part in &parts {
            let [col, row] = [part.window.col / samples, part.window.row / samples].map(|at| at as usize);
            let width = part.window.width.div_ceil(samples) as usize;
            for (i, values) in part.reduced.chunks_exact(width).enumerate() {
                reduced[(row + i) * reduced_size[0] as usize + col..][..width].copy_from_slice(values);
            }
        }
        let summary = summed(&parts, self.header.grid.spacing_m().map(|m| m * f64::from(self.window.step)));
        Ok((summary, Reduced { size: reduced_size, samples, differences_m: reduced }))
    }

    fn part(&self, window: Window, samples: u32) -> Result<Part, LayoutError> {
        let mut heights = [Vec::new(), Vec::new()];
        self.heights(window, &mut heights)?;
        let wide = window.width.div_ceil(samples) as usize;
        let mut part = Part {
            window,
            compared: 0,
            changed: 0,
            alone: [0; 2],
            sum: 0.0,
            squares: 0.0,
            below: 0.0,
            above: 0.0,
            lowest: None,
            highest: None,
            reduced: vec![f32::NAN; wide * window.height.div_ceil(samples) as usize],
        };
        let north = self.window.size[1] - 1;
        for (i, (first, second)) in heights[0].iter().zip(&heights[1]).enumerate() {
            if first.is_nan() || second.is_nan() {
                part.alone[0] += u64::from(!first.is_nan());
                part.alone[1] += u64::from(!second.is_nan());
                continue;
            }
            let difference_m = difference(*first, *second);
            let (column, row) = (i as u32 % window.width, i as u32 / window.width);
            part.compared += 1;
            part.changed += u64::from(difference_m != 0.0);
            part.sum += difference_m;
            part.squares += difference_m * difference_m;
            part.above += difference_m.max(0.0);
            part.below += (-difference_m).max(0.0);
            if part.lowest.is_none_or(|lowest| difference_m < lowest.difference_m)
                || part.highest.is_none_or(|highest| difference_m > highest.difference_m)
            {
                let p = self.window.point(window.col + column, north - window.row - row);
                let here = Extreme { difference_m, sample: [p.x(), p.y()] };
                part.lowest = lower(part.lowest, Some(here));
                part.highest = higher(part.highest, Some(here));
            }
            let pixel = &mut part.reduced[(row / samples) as usize * wide + (column / samples) as usize];
            if pixel.is_nan() || f64::from(pixel.abs()) < difference_m.abs() {
                *pixel = difference_m as f32;
            }
        }
        Ok(part)
    }
}

fn lower(a: Option<Extreme>, b: Option<Extreme>) -> Option<Extreme> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.difference_m < a.difference_m { b } else { a }),
        (a, b) => a.or(b),
    }
}

fn higher(a: Option<Extreme>, b: Option<Extreme>) -> Option<Extreme> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.difference_m > a.difference_m { b } else { a }),
        (a, b) => a.or(b),
    }
}

fn summed(parts: &[Part], spacing_m: [f64; 2]) -> Summary {
    let mut summary = Summary::default();
    let (mut sum, mut squares, mut below, mut above) = (0.0, 0.0, 0.0, 0.0);
    for part in parts {
        summary.compared += part.compared;
        summary.changed += part.changed;
        (0..2).for_each(|i| summary.alone[i] += part.alone[i]);
        sum += part.sum;
        squares += part.squares;
        below += part.below;
        above += part.above;
        summary.lowest = lower(summary.lowest, part.lowest);
        summary.highest = higher(summary.highest, part.highest);
    }
    let count = summary.compared.max(1) as f64;
    let area_m2 = spacing_m[0] * spacing_m[1];
    Summary {
        mean_m: sum / count,
        rms_m: (squares / count).sqrt(),
        cut_m3: below * area_m2,
        fill_m3: above * area_m2,
        changed_m2: summary.changed as f64 * area_m2,
        ..summary
    }
}
