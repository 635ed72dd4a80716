//! Heights at places: bilinear between the four samples around. Pages are checked, and a few of them are kept.
//!
//! A place needs up to four pages, because neighbours of different levels lie apart in the file. [`Heights`] keeps pages by number, so places near each other read a page once. [`heights_m`] puts any
//! number of places into such an order first and shares them out to threads. Cost: some tens of nanoseconds a sample whose page is kept; else a read of 4 KiB and its checksum.

use super::terrain::Terrain;
use super::window::SampleWindow;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::grid::GridPoint;
use crate::grid::order::slot_of;
use crate::grid::record::{Vertex, VertexClass};

/// Pages kept by default: 4 MiB.
const PAGES: usize = 1024;

/// Heights of one terrain.
#[derive(Debug)]
pub struct Heights<'t> {
    terrain: &'t Terrain,
    /// A page by its number modulo their count, a power of two.
    kept: Vec<Option<(u64, Box<Page>)>>,
}

impl<'t> Heights<'t> {
    /// Heights of `terrain`, with 4 MiB for pages.
    pub fn new(terrain: &'t Terrain) -> Self {
        Self::with_pages(terrain, PAGES)
    }

    /// As [`Heights::new`], with room for so many pages of 4 KiB, rounded up to a power of two.
    pub fn with_pages(terrain: &'t Terrain, pages: usize) -> Self {
        let needed =
            pages.min(usize::try_from(terrain.page_count()).unwrap_or(usize::MAX)).max(1).next_power_of_two();
        Self { terrain, kept: (0..needed).map(|_| None).collect() }
    }

    /// Height in metres at a place in metres east and north of the south-west sample, interpolated bilinearly between the four samples around
    /// it. `Ok(None)` outside the data or where one of them is void.
    ///
    /// # Errors
    /// As [`Terrain::checked_page`].
    pub fn height_m(&mut self, east_m: f64, north_m: f64) -> Result<Option<f64>, LayoutError> {
        let Some(([x0, y0], [fx, fy])) = cell(self.terrain, [east_m, north_m]) else { return Ok(None) };
        let mut height = 0.0;
        for (x, wx) in [(x0, 1.0 - fx), (x0 + 1, fx)] {
            for (y, wy) in [(y0, 1.0 - fy), (y0 + 1, fy)] {
                // A sample without weight may lie outside or be void.
                if wx * wy > 0.0 {
                    let vertex = self.vertex(GridPoint::new(x, y))?;
                    if vertex.class.is_void() {
                        return Ok(None);
                    }
                    height += vertex.height_m * wx * wy;
                }
            }
        }
        Ok(Some(height))
    }

    /// Heights in metres of the samples of `window`, rows from the south, in `into`, whatever was in it; NaN where there is none.
    ///
    /// # Errors
    /// As [`Terrain::checked_page`]; [`LayoutError::Usage`] for a window that does not lie in the terrain.
    pub fn samples(&mut self, window: &SampleWindow, into: &mut Vec<f64>) -> Result<(), LayoutError> {
        window.check(self.terrain.grid())?;
        into.clear();
        into.reserve(window.size[0] as usize * window.size[1] as usize);
        if self.is_void(window)? {
            into.resize(window.size[0] as usize * window.size[1] as usize, f64::NAN);
            return Ok(());
        }
        for row in 0..window.size[1] {
            for column in 0..window.size[0] {
                let vertex = self.vertex(window.point(column, row))?;
                into.push(if vertex.class.is_void() { f64::NAN } else { vertex.height_m });
            }
        }
        Ok(())
    }

    /// Whether none of the samples of a window nor between them has a height: found from the coarsest records down, so that oceans cost next to nothing.
    ///
    /// # Errors
    /// As [`samples`](Self::samples).
    pub fn is_void(&mut self, window: &SampleWindow) -> Result<bool, LayoutError> {
        window.check(self.terrain.grid())?;
        if !self.terrain.header().has_voids {
            return Ok(false);
        }
        let (from, last) = (window.from, window.last());
        let mut waiting = vec![([0u32; 2], self.terrain.grid().side_steps())];
        while let Some((at, side)) = waiting.pop() {
            if (0..2).any(|axis| at[axis] > last[axis] || at[axis] + side < from[axis]) {
                continue;
            }
            let half = side / 2;
            // What lies in a square or on its sides lies below its centre, but for the corners.
            let is_open = half > 0 && {
                let centre = self.vertex(GridPoint::new(at[0] + half, at[1] + half))?;
                centre.class != VertexClass::Inert
            };
            if is_open {
                waiting.extend(
                    [[0, 0], [half, 0], [0, half], [half, half]].map(|[x, y]| ([at[0] + x, at[1] + y], half)),
                );
                continue;
            }
            for [x, y] in [[0, 0], [side, 0], [0, side], [side, side]].map(|[x, y]| [at[0] + x, at[1] + y]) {
                let is_within = (from[0]..=last[0]).contains(&x) && (from[1]..=last[1]).contains(&y);
                if is_within && !self.vertex(GridPoint::new(x, y))?.class.is_void() {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// The vertex at a grid point of the square.
    fn vertex(&mut self, p: GridPoint) -> Result<Vertex, LayoutError> {
        let (terrain, grid) = (self.terrain, self.terrain.grid());
        let slot = slot_of(grid.k(), p);
        let per_page = terrain.header().records_per_page();
        let (logical, at) = (slot / per_page, (slot % per_page) as usize * (PAGE_BYTES / per_page as usize));
        let place = logical as usize & (self.kept.len() - 1);
        let page = match &mut self.kept[place] {
            Some((kept, page)) if *kept == logical => page,
            other => &mut other.insert((logical, terrain.checked_page(logical)?)).1,
        };
        let level = if grid.is_corner(p) { 0 } else { grid.level(p) };
        Ok(terrain.codec().decode(&page[at..], level))
    }
}

/// South-west sample of the cell around a place in metres, and the place within the cell; none outside the data.
fn cell(terrain: &Terrain, place_m: [f64; 2]) -> Option<([u32; 2], [f64; 2])> {
    let (spacing_m, samples) = (terrain.grid().spacing_m(), terrain.grid().samples());
    let at = [0, 1].map(|axis| snap(place_m[axis] / spacing_m[axis]));
    let is_inside = |axis: usize| (0.0..=f64::from(samples[axis] - 1)).contains(&at[axis]);
    (is_inside(0) && is_inside(1)).then(|| (at.map(|v| v.floor() as u32), at.map(|v| v - v.floor())))
}

/// Places a hair off a sample, from spacings that are not exact in binary, mean the sample.
fn snap(v: f64) -> f64 {
    let near = v.round();
    if (v - near).abs() < 1e-9 * near.abs().max(1.0) { near } else { v }
}

impl Terrain {
    /// Height in metres at one place, as [`Heights::height_m`] gives it for many: this reads its pages anew.
    ///
    /// # Errors
    /// As [`Terrain::checked_page`].
    pub fn height_m(&self, east_m: f64, north_m: f64) -> Result<Option<f64>, LayoutError> {
        Heights::with_pages(self, 4).height_m(east_m, north_m)
    }
}

/// Heights at many places, in metres east and north of the south-west sample, in the order of the places: as [`Heights::height_m`] gives them. Reads on
/// the current rayon pool, with at most `memory_bytes` for pages, and 12 bytes a place.
///
/// # Errors
/// As [`Terrain::checked_page`].
#[cfg(feature = "files")]
pub fn heights_m(
    terrain: &Terrain,
    places_m: &[[f64; 2]],
    memory_bytes: u64,
) -> Result<Vec<Option<f64>>, LayoutError> {
    use rayon::prelude::*;
    // Neighbours come one after the other: places by the bits of their cell, column and row in turn.
    let order_of =
        |place_m: &[f64; 2]| cell(terrain, *place_m).map_or(u64::MAX, |([x, y], _)| interleaved(x, y));
    let mut order: Vec<(u64, u32)> =
        places_m.par_iter().map(order_of).zip((0..places_m.len() as u32).into_par_iter()).collect();
    order.par_sort_unstable();
    let threads = rayon::current_num_threads();
    let pages = (memory_bytes / PAGE_BYTES as u64 / threads as u64).try_into().unwrap_or(usize::MAX);
    let share = order.len().div_ceil(4 * threads).max(1);
    let found: Vec<Vec<Option<f64>>> = order
        .par_chunks(share)
        .map(|share| {
            let mut heights = Heights::with_pages(terrain, pages);
            let places = share.iter().map(|(_, i)| places_m[*i as usize]);
            places.map(|[east_m, north_m]| heights.height_m(east_m, north_m)).collect()
        })
        .collect::<Result<_, LayoutError>>()?;
    let mut heights = vec![None; places_m.len()];
    order.iter().zip(found.iter().flatten()).for_each(|((_, i), height)| heights[*i as usize] = *height);
    Ok(heights)
}

/// The bits of two numbers in turn.
#[cfg(feature = "files")]
fn interleaved(x: u32, y: u32) -> u64 {
    let spread = |v: u32| {
        let mut v = u64::from(v);
        for (shift, mask) in [
            (16, 0x0000_ffff_0000_ffff),
            (8, 0x00ff_00ff_00ff_00ff),
            (4, 0x0f0f_0f0f_0f0f_0f0f),
            (2, 0x3333_3333_3333_3333),
            (1, 0x5555_5555_5555_5555_u64),
        ] {
            v = (v | v << shift) & mask;
        }
        v
    };
    spread(x) | spread(y) << 1
}

#[cfg(all(test, feature = "files"))]
mod tests {
    use super::*;
    use crate::build::{BuildOptions, build};
    use crate::dem::{MemoryDem, SampleType};
    use crate::mix::Random;
    use crate::progress::Silent;

    /// Whatever the order, the threads and the memory: each height is that of its place alone, and that is the mean of the samples around.
    #[test]
    fn many_heights_are_those_of_each() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.iqt");
        let sample = |x: u32, y: u32| {
            if x / 20 == 3 && y > 90 { f64::NAN } else { f64::from(x * 31 % 97 + y * 17 % 89) }
        };
        for kind in [SampleType::I16, SampleType::F32, SampleType::F64] {
            let dem = MemoryDem::from_fn([150, 120], kind, sample);
            build(&dem, &path, &BuildOptions::default().spacing_m([10.0, 7.0]), &Silent).unwrap();
            let terrain = Terrain::open_unmapped(&path).unwrap();
            let mut random = Random::new(4);
            let mut at = |extent: f64| (random.below(1_000_000) as f64 / 1e6 * 1.1 - 0.05) * extent;
            let mut places: Vec<[f64; 2]> = (0..5000).map(|_| [at(1490.0), at(833.0)]).collect();
            places.extend([[0.0, 0.0], [1490.0, 833.0], [1490.0, 0.0], [f64::NAN, 3.0], [640.0, 700.0]]);
            let many = heights_m(&terrain, &places, 0).unwrap();
            assert!(many == heights_m(&terrain, &places, 1 << 30).unwrap());
            let mut kept = Heights::new(&terrain);
            for ([x, y], height) in places.iter().zip(&many) {
                assert_eq!(*height, terrain.height_m(*x, *y).unwrap());
                assert_eq!(*height, kept.height_m(*x, *y).unwrap());
                let (gx, gy) = (x / 10.0, y / 7.0);
                let is_inside = (0.0..=149.0).contains(&gx) && (0.0..=119.0).contains(&gy);
                let (i, j) = (gx.floor().min(148.0), gy.floor().min(118.0));
                let (fx, fy) = (gx - i, gy - j);
                let s = |u: f64, v: f64| sample((i + u) as u32, (j + v) as u32);
                let mean = s(0.0, 0.0) * (1.0 - fx) * (1.0 - fy)
                    + s(1.0, 0.0) * fx * (1.0 - fy)
                    + s(0.0, 1.0) * (1.0 - fx) * fy
                    + s(1.0, 1.0) * fx * fy;
                match height {
                    Some(height) => {
                        assert!(is_inside && (height - mean).abs() < 1e-6, "{x}, {y}: {height}, {mean}")
                    }
                    None => assert!(!is_inside || mean.is_nan(), "{x}, {y}"),
                }
            }
            assert!(many.iter().flatten().count() > 3000 && many.iter().any(Option::is_none));
        }
    }

    /// Windows over islands, single samples among them, and over what lies between: as sample by sample, and without an ocean's samples being looked at.
    #[test]
    fn windows_of_voids_are_void_and_others_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.iqt");
        let [wide, high] = [700, 600];
        let islands = [[0, 0], [699, 599], [256, 256], [255, 300], [511, 128], [300, 599]];
        let dem = MemoryDem::from_fn([wide, high], SampleType::I16, |x, y| {
            let is_land = islands.contains(&[x, y]) || (400..430).contains(&x) && (60..90).contains(&y);
            if is_land { f64::from(x + 2 * y) } else { f64::NAN }
        });
        build(&dem, &path, &BuildOptions::default().spacing_m([1.0; 2]), &Silent).unwrap();
        let terrain = Terrain::open_unmapped(&path).unwrap();
        let mut heights = Heights::new(&terrain);
        let mut random = Random::new(9);
        let mut read = Vec::new();
        let mut voids = 0;
        for i in 0..400 {
            let [x, y] = islands[i % islands.len()];
            let near = |v: u32, random: &mut Random| (v + random.below(40) as u32).saturating_sub(20);
            let from = [near(x, &mut random).min(wide - 1), near(y, &mut random).min(high - 1)];
            let size = [from[0], from[1]]
                .map(|v| 1 + random.below(30).min(u64::from(high - 1 - v.min(high - 1))) as u32);
            let window = SampleWindow { from, size: [size[0].min(wide - from[0]), size[1]], step: 1 };
            heights.samples(&window, &mut read).unwrap();
            for (at, height) in (0u32..).zip(&read) {
                let p = window.point(at % window.size[0], at / window.size[0]);
                let expected = dem.sample(p.x(), p.y());
                assert!(*height == expected || height.is_nan() && expected.is_nan(), "{p:?}: {height}");
            }
            voids += usize::from(read.iter().all(|height| height.is_nan()));
        }
        assert!((20..390).contains(&voids), "{voids}");
    }
}
