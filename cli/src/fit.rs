//! Whether an eye or a flight belongs to a terrain.
//!
//! **A flight wholly outside is an error; one that was made over another terrain, or is mostly outside, is strange.** An eye outside that has the terrain in view is no mistake.

use crate::numbers::{decimal, grouped};
use glam::DVec3;
use std::path::Path;
use terrasoar::flight::Flight;
use terrasoar::view::{View, Viewport};
use terrasoar_layout::grid::Grid;
use terrasoar_layout::read::terrain::Terrain;

/// Name of the note in which a flight says how large the ground is that it was made over.
const EXTENT_NOTE: &str = "terrain-extent-m";
/// Name of the note in which it says which heights that ground has.
const HEIGHTS_NOTE: &str = "terrain-heights";

/// The terrain's extent in words: "which extends from 0,0 to 2560,2560 metres".
pub(crate) fn extent(grid: &Grid) -> String {
    let [east, north] = extent_note(grid);
    format!("which extends from 0,0 to {east},{north} metres")
}

fn extent_note(grid: &Grid) -> [String; 2] {
    grid.extent_m().map(|m| decimal(m, 4))
}

/// What a flight notes of the ground that it was made over.
pub(crate) fn notes_of(terrain: &Terrain) -> Vec<(String, String)> {
    let extent = (EXTENT_NOTE.into(), extent_note(terrain.grid()).join(" "));
    let heights = heights_note(terrain).map(|digest| (HEIGHTS_NOTE.into(), digest));
    std::iter::once(extent).chain(heights).collect()
}

/// A digest of the terrain's heights as they were built: edits that its journal or an overlay holds do not change it. `None` if the state before them cannot be read.
///
/// Cost: a pass over the directory, a word for each page of records.
fn heights_note(terrain: &Terrain) -> Option<String> {
    if terrain.header().history.is_none() && terrain.base_path().is_none() {
        return digest(terrain);
    }
    let file = Terrain::open_unmapped(terrain.base_path().unwrap_or(terrain.path())).ok()?;
    digest(&file.into_original().ok()?)
}

/// FNV-1a over the grid and the checksums of the pages of records, in 16 hexadecimal digits. `None` if the directory cannot be read.
fn digest(terrain: &Terrain) -> Option<String> {
    let grid = terrain.grid();
    let shape = grid.samples().into_iter().map(u64::from).chain(grid.spacing_m().map(f64::to_bits));
    let mut hash = shape.fold(FNV_OFFSET, put);
    // Where a page lies in the file says nothing of heights. An absent one counts as a checksum of 0, whose bytes change the hash by the factor alone.
    let mut next = 0;
    for (page, entry) in terrain.present_pages().ok()? {
        hash = put(absent(hash, page - next), entry.checksum.into());
        next = page + 1;
    }
    Some(format!("{:016x}", absent(hash, terrain.page_count() - next)))
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// A hash with the bytes of a number put in.
fn put(hash: u64, number: u64) -> u64 {
    number.to_le_bytes().into_iter().fold(hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(FNV_PRIME))
}

/// A hash with so many zeros of 8 bytes put in.
fn absent(hash: u64, count: u64) -> u64 {
    let (mut hash, mut factor, mut bytes) = (hash, FNV_PRIME, 8 * count);
    while bytes > 0 {
        if bytes & 1 == 1 {
            hash = hash.wrapping_mul(factor);
        }
        factor = factor.wrapping_mul(factor);
        bytes >>= 1;
    }
    hash
}

/// Whether an eye is over the terrain.
pub(crate) fn is_over(grid: &Grid, eye_m: DVec3) -> bool {
    let [east_m, north_m] = grid.extent_m();
    (0.0..=east_m).contains(&eye_m.x) && (0.0..=north_m).contains(&eye_m.y)
}

/// Whether a view has anything of the terrain in it that is larger than a pixel. The terrain counts as the ball around it: in doubt it is in view.
pub(crate) fn sees(terrain: &Terrain, view: &View) -> bool {
    let [east_m, north_m] = terrain.grid().extent_m();
    let [low_m, high_m] = terrain.header().height_range_m.map(|h| h * view.vertical_exaggeration);
    let half = 0.5 * DVec3::new(east_m, north_m, high_m - low_m);
    let (radius_m, to_middle) = (half.length(), half + DVec3::Z * low_m - view.eye_m);
    let is_in_view = view.side_normals().iter().all(|normal| normal.dot(to_middle) <= radius_m);
    is_in_view && 2.0 * radius_m * view.pixels_per_radian() >= to_middle.length()
}

/// What is strange about a flight over this terrain, in sentences; for pictures of some size.
///
/// # Errors
/// In words, if it lies wholly outside.
pub(crate) fn strange(
    terrain: &Terrain,
    flight: &Flight,
    path: &Path,
    viewport: Viewport,
) -> Result<Vec<String>, String> {
    let (grid, frames) = (terrain.grid(), &flight.frames);
    let view = |frame: &terrasoar::flight::FlightFrame| frame.view(viewport, 1.0);
    let outside = frames.iter().filter(|frame| !is_over(grid, frame.eye_m.into())).count();
    if outside == frames.len() && !frames.iter().any(|frame| sees(terrain, &view(frame))) {
        return Err(format!(
            "{}: the flight lies wholly outside the terrain, {}; it is a flight of another terrain",
            path.display(),
            extent(grid)
        ));
    }
    let mut strange = Vec::new();
    let note = |name: &str| flight.notes.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str());
    let made_over = note("terrain").map(|name| format!(" ({name})")).unwrap_or_default();
    let is_others = note(EXTENT_NOTE).is_some_and(|value| value != extent_note(grid).join(" "));
    let path = path.display();
    if is_others {
        let was = note(EXTENT_NOTE).unwrap_or_default().replace(' ', " x ");
        strange.push(format!(
            "{path} was made over another terrain{made_over}, of {was} metres; this one is of {} metres",
            extent_note(grid).join(" x ")
        ));
    } else if let Some(noted) = note(HEIGHTS_NOTE)
        && heights_note(terrain).is_some_and(|own| own != noted)
    {
        strange.push(format!(
            "{path} was made over another terrain{made_over}, of the same size but with other heights; or this one was built or rewritten since"
        ));
    }
    if 2 * outside > frames.len() {
        let [outside, all] = [outside, frames.len()].map(|count| grouped(count as u64));
        strange.push(format!(
            "{path}: the eye is outside the terrain, {}, in {outside} of {all} frames; it may be a flight of another terrain{made_over}",
            extent(grid)
        ));
    }
    Ok(strange)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_zeros_are_put_in_at_once() {
        for count in [0, 1, 2, 5, 1000] {
            let hash = put(FNV_OFFSET, 77);
            assert_eq!(absent(hash, count), (0..count).fold(hash, |hash, _| put(hash, 0)), "{count}");
        }
    }
}
