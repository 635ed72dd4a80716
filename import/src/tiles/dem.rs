//! A pyramid as elevation data: the colours of each tile become heights, and transparent texels voids.
//!
//! Each tile is a window, handed on by whichever thread decoded it. A missing tile is void, or the nearest coarser tile interpolated; in that, a sample is void where the nearest is.
//! Cost: a tile in memory for each thread, and a coarser one.

use super::decode::Texels;
use super::grid::{Tile, place};
use super::packing::{Found, check, find};
use super::seam::{Halves, Shifted};
use super::{Part, Pyramid, place_above};
use crate::OpenOptions;
use crate::reader::{Declared, Reader, Said, VerticalUnit};
use crate::value::Decode;
use std::path::Path;
use terrasoar_layout::dem::{SampleSink, Warning, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::{MOST_SAMPLES, MOST_SAMPLES_WORDS};
use terrasoar_layout::remedy::Remedy;

/// Elevation data in tiles.
pub(crate) struct TileDem {
    halves: Halves,
    declared: Declared,
    found: Found,
}

/// A pyramid, and how its heights are packed.
#[derive(Clone, Copy)]
struct Packed<'d> {
    pyramid: &'d Pyramid,
    found: &'d Found,
}

/// What a thread keeps.
#[derive(Default)]
struct Worker {
    bytes: Vec<u8>,
    /// Heights of the last coarser tile.
    coarser: Option<(Tile, u32, Vec<f64>)>,
}

impl TileDem {
    /// Chooses what is read, and finds out how heights are packed.
    pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let halves = Halves::open(path, &options.tiles)?;
        let pyramid = &halves.all[0].0;
        let found = find(pyramid, options.decode.as_deref())?;
        let plan = &pyramid.plan;
        if !halves.is_even() {
            let problem =
                "tiles on both sides of 180 degrees have unlike numbers of texels; build two halves";
            return Err(LayoutError::unsupported(path, problem));
        }
        let size = halves.size.map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        // Halves are put together in memory of this size of numbers.
        if options.reproject.is_none() || halves.size.iter().any(|side| *side > i32::MAX as u64) {
            refuse_large(path, plan.zoom, size)?;
        }
        let mut declared = Declared::new(size, Decode::SAMPLE_TYPE, pyramid.format());
        declared.place = Some(Said::new(place(plan.zoom, plan.side, halves.first), "the tiles"));
        declared.crs = pyramid.crs();
        declared.value.unit = Some(Said::new(VerticalUnit::Metres(1.0), "the packing"));
        declared.aloud.extend(halves.all.iter().map(|(half, _)| half.plan.words.clone()));
        declared.aloud.extend(pyramid.archive.rows_in_doubt().map(str::to_owned));
        declared.notes.push(format!("heights are packed into colours: {}", found.by));
        declared.warnings.extend(found.warning.clone());
        for missing in halves.all.iter().filter_map(|(half, _)| half.plan.missing.as_ref()) {
            let higher = plan.zoom.saturating_sub(1).to_string();
            declared.warnings.push(Warning::new(missing.clone()).mended_by(Remedy::Zoom, higher));
        }
        if let Some(why) = &halves.missing {
            let words = format!("on one side of 180 degrees nothing is read: {why}");
            declared.warnings.push(Warning::new(words).mended_by(Remedy::Bounds, "W,S,E,N"));
        }
        Ok(Self { halves, declared, found })
    }
}

impl Packed<'_> {
    /// The heights of a tile.
    fn heights(self, tile: Tile, texels: &Texels) -> Result<Vec<f64>, LayoutError> {
        check(self.pyramid, tile, texels)?;
        let mut heights = Vec::with_capacity(texels.rgba.len());
        for [red, green, blue, alpha] in &texels.rgba {
            if *alpha == 0 {
                heights.push(f64::NAN);
                continue;
            }
            if let Some(guessed) = self.found.guessed.filter(|guessed| !guessed.holds(*red)) {
                let problem = format!(
                    "{} has colours that are no heights as {} packs them, though other tiles look so; if heights are packed into the colours, state how",
                    self.pyramid.archive.label(tile),
                    guessed.name()
                );
                return Err(LayoutError::unsupported(self.pyramid.path(), problem).mended_by(Remedy::Decode));
            }
            heights.push(self.found.packing.height([*red, *green, *blue].map(f64::from)));
        }
        Ok(heights)
    }

    fn put(self, tile: Tile, worker: &mut Worker, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let part = self.pyramid.part(tile);
        let window = Window { col: part.to[0], row: part.to[1], width: part.size[0], height: part.size[1] };
        if let Some(texels) = self.pyramid.tile(tile, &mut worker.bytes)? {
            let heights = self.heights(tile, &texels)?;
            return sink.put(window, &cut(&heights, texels.side, part));
        }
        let above = self.pyramid.plan.above(&*self.pyramid.archive, tile)?;
        if worker.coarser.as_ref().map(|(kept, ..)| *kept) != above {
            worker.coarser = None;
            if let Some(above) = above
                && let Some(texels) = self.pyramid.coarser(above, &mut worker.bytes)?
            {
                worker.coarser = Some((above, texels.side, self.heights(above, &texels)?));
            }
        }
        let Some((coarser, side, heights)) = &worker.coarser else { return sink.put_void(window) };
        let places = (0..part.size[1]).flat_map(|row| (0..part.size[0]).map(move |col| [col, row]));
        let samples: Vec<f64> = places
            .map(|[col, row]| {
                let texel = [part.from[0] + col, part.from[1] + row];
                mixed(heights, *side, place_above(tile, self.pyramid.plan.side, *coarser, *side, texel))
            })
            .collect();
        sink.put(window, &samples)
    }
}

/// Refuses what no terrain can hold, with the zoom that one can.
fn refuse_large(path: &Path, zoom: u8, size: [u32; 2]) -> Result<(), LayoutError> {
    let over = size[0].max(size[1]).div_ceil(MOST_SAMPLES);
    if over <= 1 {
        return Ok(());
    }
    let levels = over.next_power_of_two().trailing_zeros() as u8;
    Err(LayoutError::Usage(format!(
        "{}: zoom {zoom} has {} x {} samples here, and a terrain has {MOST_SAMPLES_WORDS} at most a side; state bounds, or zoom {}",
        path.display(),
        size[0],
        size[1],
        zoom.saturating_sub(levels)
    ))
    .mended_by(Remedy::Zoom))
}

/// A part of a tile's samples.
fn cut(samples: &[f64], side: u32, part: Part) -> Vec<f64> {
    let ([left, top], [width, height]) =
        (part.from.map(|at| at as usize), part.size.map(|count| count as usize));
    let rows = samples.chunks_exact(side as usize).skip(top).take(height);
    rows.flat_map(|row| &row[left..left + width]).copied().collect()
}

/// The height at a place among samples, whose centres are at halves: of the four around, those beyond the rim being those at it; the nearest where one of them is void.
fn mixed(samples: &[f64], side: u32, at: [f64; 2]) -> f64 {
    let most = f64::from(side - 1);
    let sample = |col: f64, row: f64| {
        let [col, row] = [col, row].map(|at| at.clamp(0.0, most) as usize);
        samples[row * side as usize + col]
    };
    let nearest = sample(at[0].floor(), at[1].floor());
    let [x, y] = at.map(|at| at - 0.5);
    let (col, row) = (x.floor(), y.floor());
    let (right, below) = (x - col, y - row);
    let mix = |a: f64, b: f64, part: f64| a + (b - a) * part;
    let upper = mix(sample(col, row), sample(col + 1.0, row), right);
    let lower = mix(sample(col, row + 1.0), sample(col + 1.0, row + 1.0), right);
    let mixed = mix(upper, lower, below);
    if mixed.is_nan() || nearest.is_nan() { nearest } else { mixed }
}

impl Reader for TileDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        self.halves.all.iter().map(|(half, _)| half.memory_bytes() + half.met_bytes()).max().unwrap_or(0)
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.halves.put_rest(sink)?;
        for (pyramid, by) in &self.halves.all {
            let sink = Shifted { sink, by: *by };
            let packed = Packed { pyramid, found: &self.found };
            let put = |worker: &mut Worker, tile: Tile| packed.put(tile, worker, &sink);
            pyramid.each_tile_met(|window| sink.put_void(window), put)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarser_heights_are_a_plane_where_the_ground_is_one() {
        // A plane of 1 m a coarse texel east and 10 m south; the lower right quarter of the coarse tile, twice as fine.
        let samples: Vec<f64> = (0..16).map(|i| f64::from(i % 4) + 10.0 * f64::from(i / 4)).collect();
        let (missing, above) = (Tile { zoom: 3, x: 5, y: 3 }, Tile { zoom: 2, x: 2, y: 1 });
        for (texel, height) in [([0, 0], 1.75 + 17.5), ([1, 1], 2.25 + 22.5), ([2, 1], 2.75 + 22.5)] {
            assert_eq!(mixed(&samples, 4, place_above(missing, 4, above, 4, texel)), height, "{texel:?}");
        }
        // At the rim the last sample holds on.
        assert_eq!(mixed(&samples, 4, place_above(missing, 4, above, 4, [3, 3])), 33.0);
        let mut holed = samples;
        holed[15] = f64::NAN;
        assert!(mixed(&holed, 4, [3.6, 3.6]).is_nan());
        assert_eq!(mixed(&holed, 4, [2.9, 2.9]), 22.0, "the nearest beside a void");
    }
}
