//! Pictures brought onto the terrain they are for: out of another reference system, turned or mirrored, around the seam of longitudes, or of other texels than the pictures beside them.
//!
//! A picture that lies along the terrain's axes stays as it is. Others are read once and kept ([`Texels`]); then each new texel looks where it lies among the old ones
//! ([`Mapping`]) and mixes the four around. New texels are as large as the old ones are at the picture's centre; of several pictures, as the finest's. Cost: two passes, and some
//! tens of nanoseconds a new texel.

use super::completed::Completed;
use super::texels::Texels;
use crate::crs::{all_over, shift_in_doubt};
use crate::places::Crs;
use crate::warp::{Mapping, Projections, apply};
use rayon::prelude::*;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, MAX_TEXELS, RowReader};
use terrasoar_layout::portable::hypot;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::number;

/// New texels on the sides of a block.
const BLOCK: [usize; 2] = [256, 32];
/// Old texels of one block, at most.
const MOST_OLD: usize = 1 << 20;
/// Steps on each side of the mesh that tells how far a picture reaches.
const MESH: u32 = 32;
/// Farthest that texels may be off the common ones, in texels.
const NEAR: f64 = 0.1;
/// New texels that one old one may become, at most, where a picture lies beside a finer one: 16 each way.
const MOST_PARTS: f64 = 256.0;

/// New texels: the outer corner of one, and the step east and north, both in the terrain's coordinates.
#[derive(Debug, Clone, Copy)]
struct Lattice {
    corner: [f64; 2],
    step: [f64; 2],
}

/// A picture, and the way from the terrain's coordinates to it.
struct Across {
    map: [f64; 6],
    projections: Option<Projections>,
    step: [f64; 2],
    /// West, south, east and north in the terrain's coordinates.
    bounds: [f64; 4],
    /// Whether it lies along the axes as it is.
    is_straight: bool,
    /// Whether its columns go once around the globe.
    wraps: bool,
}

/// West, south, east and north of the terrain's samples.
fn rim(header: &Header, map: &[f64; 6]) -> [f64; 4] {
    let [wide, high] = header.grid.samples().map(|count| f64::from(count - 1));
    let corners = [[0.0, 0.0], [wide, 0.0], [0.0, high], [wide, high]].map(|at| apply(map, at));
    around(corners.into_iter())
}

fn around(points: impl Iterator<Item = [f64; 2]>) -> [f64; 4] {
    points
        .fold([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY], |[w, s, e, n], [x, y]| {
            [w.min(x), s.min(y), e.max(x), n.max(y)]
        })
}

fn shared([w, s, e, n]: [f64; 4], [w2, s2, e2, n2]: [f64; 4]) -> Option<[f64; 4]> {
    let both = [w.max(w2), s.max(s2), e.min(e2), n.min(n2)];
    (both[0] < both[2] && both[1] < both[3]).then_some(both)
}

/// Whether the picture's coordinates are the terrain's, and the way from one system to the other where there is one. What says no system is in the terrain's.
///
/// # Errors
/// [`LayoutError::Unsupported`] where there is no way, or one of the two is on another body.
fn way_between(picture: &Completed, ours: Option<&Crs>) -> Result<(bool, Option<Projections>), LayoutError> {
    let theirs = Crs::of_system(picture.system().clone());
    let Some(ours) = ours.filter(|_| theirs.is_said()) else { return Ok((true, None)) };
    let both = ours.ground().zip(theirs.ground());
    // Two sites' own systems are taken for one, for nothing tells them apart but names that people give.
    let is_same = ours.is_same(&theirs) || (both.is_none() && ours.is_site() && theirs.is_site());
    let refused =
        |problem: String| LayoutError::unsupported(picture.path(), problem).mended_by(Remedy::Extent);
    if !is_same && both.is_none() {
        return Err(refused(format!(
            "the picture is in {} and the terrain in {}, and there is no way from one to the other here; bring it over with gdalwarp, or state where it lies",
            theirs.name(),
            ours.name()
        )));
    }
    if !is_same && ours.is_on_earth() != theirs.is_on_earth() {
        return Err(refused(format!(
            "the picture is in {} and the terrain on another body; give it the system it is in, or state where it lies",
            theirs.name()
        )));
    }
    Ok((is_same, both.map(|(new, old)| Projections { old: old.clone(), new: new.clone() })))
}

/// Bounds in a system of longitudes, turned to where they meet the terrain: around all that meets it after some turns, and whether any turn was needed.
fn turned(bounds: [f64; 4], terrain: [f64; 4], turn: f64) -> ([f64; 4], bool) {
    let [west, south, east, north] = bounds;
    let meets: Vec<(i32, [f64; 4])> = (-2..=2)
        .filter_map(|turns| {
            let by = f64::from(turns) * turn;
            shared([west + by, south, east + by, north], terrain).map(|both| (turns, both))
        })
        .collect();
    if meets.iter().all(|(turns, _)| *turns == 0) {
        return (bounds, false);
    }
    (around(meets.iter().flat_map(|(_, [w, s, e, n])| [[*w, *s], [*e, *n]])), true)
}

impl Across {
    /// How a picture lies on the terrain of `header`; `None` where that is not known: it is then laid as it is.
    fn of(picture: &Completed, header: &Header) -> Result<Option<Self>, LayoutError> {
        let (Some(map), Some(samples)) = (picture.info().georeference.pixel_to_crs, header.sample_to_crs)
        else {
            return Ok(None);
        };
        let ours = Crs::of(header);
        let (is_same, projections) = way_between(picture, ours.as_ref())?;
        let turn = ours.as_ref().filter(|ours| ours.is_geographic()).and_then(Crs::turn);
        // Coordinates that are the same numbers need no way but around the globe.
        let projections = projections.filter(|_| !is_same || turn.is_some());
        let size = picture.info().texels.map(f64::from);
        let over = |at: [f64; 2]| match &projections {
            Some(both) if !is_same => both.old.across_to(&both.new, apply(&map, at)),
            _ => Some(apply(&map, at)),
        };
        let nodes = (0..=MESH).flat_map(|i| (0..=MESH).map(move |j| [i, j]));
        let places = nodes
            .filter_map(|node| over([0, 1].map(|i| f64::from(node[i]) / f64::from(MESH) * size[i] - 0.5)));
        let bounds = around(places.filter(|point| point.iter().all(|value| value.is_finite())));
        let (bounds, is_turned) =
            turn.map_or((bounds, false), |turn| turned(bounds, rim(header, &samples), turn));
        let step = if is_same {
            [hypot(map[1], map[4]), hypot(map[2], map[5])]
        } else {
            let step = step_at_centre(size, over).ok_or_else(|| {
                LayoutError::Usage(format!(
                    "{}: its centre has no place in the terrain's reference system; check the systems, or state where the picture lies",
                    picture.path().display()
                ))
                .mended_by(Remedy::Extent)
            })?;
            [step; 2]
        };
        let is_along = map[2] == 0.0 && map[4] == 0.0;
        let goes_round = |turn: f64| (size[0] * map[1].abs() - turn).abs() < 0.5 * map[1].abs();
        let wraps = is_same && is_along && turn.is_some_and(goes_round);
        let is_straight = is_same && is_along && map[1] > 0.0 && map[5] < 0.0 && !is_turned;
        Ok(Some(Self { map, projections, step, bounds, is_straight, wraps }))
    }
}

/// The side of a square that is as large as a texel in the middle of a picture of `size`.
fn step_at_centre(size: [f64; 2], over: impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Option<f64> {
    let near = |dx: f64, dy: f64| over([size[0] / 2.0 - 0.5 + dx, size[1] / 2.0 - 0.5 + dy]);
    let (west, east) = (near(-0.5, 0.0)?, near(0.5, 0.0)?);
    let (north, south) = (near(0.0, -0.5)?, near(0.0, 0.5)?);
    let area = (east[0] - west[0]) * (south[1] - north[1]) - (east[1] - west[1]) * (south[0] - north[0]);
    Some(area.abs().sqrt()).filter(|step| step.is_normal())
}

/// The pictures as they lie on the terrain of `header`: north-up in its reference system, of texels on one lattice.
pub(super) fn bring(
    pictures: Vec<Completed>,
    header: &Header,
) -> Result<Vec<Box<dyn ImageSource>>, LayoutError> {
    let ways = pictures.iter().map(|picture| Across::of(picture, header)).collect::<Result<Vec<_>, _>>()?;
    let finest = ways.iter().flatten().min_by(|a, b| a.step[0].total_cmp(&b.step[0]));
    let lattice = finest.map(|way| Lattice {
        // On the old texels where these stay as they are, or are turned by right angles only.
        corner: apply(&way.map, [-0.5, -0.5]),
        step: way.step,
    });
    let mut brought: Vec<Box<dyn ImageSource>> = Vec::new();
    for (picture, way) in pictures.into_iter().zip(ways) {
        let (Some(way), Some(lattice), Some(samples)) = (way, lattice, header.sample_to_crs) else {
            brought.push(Box::new(picture));
            continue;
        };
        let [wide, high] = picture.info().texels.map(f64::from);
        let off =
            |i: usize, count: f64| (way.step[i] - lattice.step[i]).abs() * count > NEAR * lattice.step[i];
        let corner = apply(&way.map, [-0.5, -0.5]);
        let between = |i: usize| {
            let at = (corner[i] - lattice.corner[i]) / lattice.step[i];
            (at - at.round()).abs() > NEAR
        };
        if way.is_straight && !off(0, wide) && !off(1, high) && !between(0) && !between(1) {
            brought.push(Box::new(picture));
        } else if let Some(part) = shared(way.bounds, rim(header, &samples)) {
            brought.push(Box::new(Brought::new(picture, way, lattice, part)?));
        } else {
            // Who places it says where both are.
            brought.push(Box::new(picture));
        }
    }
    Ok(brought)
}

/// A picture on other texels.
struct Brought {
    picture: Completed,
    info: ImageInfo,
    mapping: Mapping,
    wraps: bool,
}

impl Brought {
    fn new(picture: Completed, way: Across, lattice: Lattice, part: [f64; 4]) -> Result<Self, LayoutError> {
        let [west, south, east, north] = part;
        let Lattice { corner, step } = lattice;
        // Whole texels around the part of the terrain that it covers.
        let low =
            [((west - corner[0]) / step[0] + 1e-6).floor(), ((corner[1] - north) / step[1] + 1e-6).floor()];
        let high =
            [((east - corner[0]) / step[0] - 1e-6).ceil(), ((corner[1] - south) / step[1] - 1e-6).ceil()];
        let sides = [0, 1].map(|i| (high[i] - low[i]).max(1.0));
        let old = picture.info().texels.map(f64::from);
        let is_fine = sides.iter().all(|side| *side <= f64::from(MAX_TEXELS));
        if !is_fine || sides[0] * sides[1] > MOST_PARTS * old[0] * old[1] {
            return Err(LayoutError::Usage(format!(
                "{}: its {} x {} texels would become {} x {}, as fine as those of the finest picture; drape pictures of similar texels, or bring them to one size before: gdalwarp -tr",
                picture.path().display(),
                old[0],
                old[1],
                number(sides[0]),
                number(sides[1])
            )));
        }
        let new_map = [
            corner[0] + (low[0] + 0.5) * step[0],
            step[0],
            0.0,
            corner[1] - (low[1] + 0.5) * step[1],
            0.0,
            -step[1],
        ];
        let mut info = picture.info().clone();
        let doubt = way
            .projections
            .as_ref()
            .and_then(|both| both.old.doubt(&both.new, &all_over(&way.map, info.texels)));
        let mapping = Mapping::new(new_map, way.map, info.texels[0], way.projections);
        info.notes.push(format!(
            "brought onto the terrain: from {} x {} texels to {} x {}, bilinear",
            info.texels[0], info.texels[1], sides[0], sides[1]
        ));
        if let Some(doubt) = doubt {
            info.notes.push(shift_in_doubt(doubt, &picture.system().name, "the terrain's system"));
        }
        let windows = rayon::current_num_threads() as u64 * 8 * MOST_OLD as u64;
        info.memory_bytes =
            info.memory_bytes.saturating_add(Texels::memory_bytes(info.texels)).saturating_add(windows);
        info.texels = sides.map(|side| side as u32);
        info.georeference.pixel_to_crs = Some(new_map);
        // It is in the terrain's system now.
        info.georeference.epsg = None;
        Ok(Self { picture, info, mapping, wraps: way.wraps })
    }

    /// New texels from `first` on, row by row.
    fn block(
        &self,
        texels: &Texels,
        first: [usize; 2],
        size: [usize; 2],
    ) -> Result<Vec<[u8; 4]>, LayoutError> {
        let places = self.mapping.places(first.map(|at| at as f64), size);
        let limits = self.picture.info().texels.map(f64::from);
        let is_in = |place: &[f64; 2]| {
            (self.wraps || (-0.5..limits[0] - 0.5).contains(&place[0]))
                && (-0.5..limits[1] - 0.5).contains(&place[1])
        };
        let [west, north, east, south] = around(places.iter().filter(|place| is_in(place)).copied());
        if west > east {
            return Ok(vec![[0; 4]; places.len()]);
        }
        let from = [west.floor() as i64, north.floor() as i64];
        let old =
            [(east.floor() as i64 - from[0] + 2) as usize, (south.floor() as i64 - from[1] + 2) as usize];
        if old[0].saturating_mul(old[1]) > MOST_OLD && size[0] * size[1] > 1 {
            // In halves, where it needs too many old ones.
            let axis = usize::from(size[1] > size[0]);
            let (mut half, mut rest, mut later) = (size, size, first);
            half[axis] = size[axis] / 2;
            rest[axis] = size[axis] - half[axis];
            later[axis] += half[axis];
            let (a, b) = (self.block(texels, first, half)?, self.block(texels, later, rest)?);
            return Ok(match axis {
                1 => [a, b].concat(),
                _ => a
                    .chunks_exact(half[0])
                    .zip(b.chunks_exact(rest[0]))
                    .flat_map(|(a, b)| a.iter().chain(b).copied())
                    .collect(),
            });
        }
        let window = texels.window(from, old, self.wraps)?;
        let mix = |place: &[f64; 2]| {
            // The rim of the picture, and of its holes, is where it was, to a texel.
            if !is_in(place) || window.nearest(*place)[3] == 0 { [0; 4] } else { window.mixed(*place) }
        };
        Ok(places.iter().map(mix).collect())
    }
}

impl ImageSource for Brought {
    fn path(&self) -> &Path {
        self.picture.path()
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        let texels = Texels::keep(&mut *self.picture.rows()?, self.picture.info().texels)?;
        Ok(Box::new(Rows { brought: self, texels, y: 0 }))
    }
}

struct Rows<'p> {
    brought: &'p Brought,
    texels: Texels,
    y: usize,
}

impl RowReader for Rows<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let wide = self.brought.info.texels[0] as usize;
        for band in rgba.chunks_mut(4 * wide * BLOCK[1]) {
            let rows = band.len() / (4 * wide);
            let blocks: Vec<(usize, Vec<[u8; 4]>)> = (0..wide.div_ceil(BLOCK[0]))
                .into_par_iter()
                .map(|block| {
                    let left = block * BLOCK[0];
                    let size = [BLOCK[0].min(wide - left), rows];
                    Ok((left, self.brought.block(&self.texels, [left, self.y], size)?))
                })
                .collect::<Result<_, LayoutError>>()?;
            let (texels, _) = band.as_chunks_mut::<4>();
            for (left, block) in blocks {
                let width = BLOCK[0].min(wide - left);
                for (row, from) in block.chunks_exact(width).enumerate() {
                    texels[row * wide + left..][..width].copy_from_slice(from);
                }
            }
            self.y += rows;
        }
        Ok(())
    }
}
