//! The imagery: header and directory as opening checks them, every tile against its checksum, and no page that is a record page as well.
//!
//! Cost: every tile is read once, in parallel; a tile a thread is held.

use super::Findings;
use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use crate::imagery::{Imagery, TileId};
use crate::read::terrain::Terrain;
use rayon::prelude::*;

/// Pages of work that the imagery's part reports; of damaged imagery those of its section.
pub(super) fn pages(terrain: &Terrain) -> u64 {
    let section = || terrain.header().imagery.map_or(0, |place| place.bytes / PAGE_BYTES as u64);
    Imagery::open(terrain).map_or_else(|_| section(), |imagery| imagery.map_or(0, |i| i.used_pages()))
}

/// Tiles checked, and what is wrong.
pub(super) fn check(
    terrain: &Terrain,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<(u64, Findings), LayoutError> {
    let Some(place) = terrain.header().imagery else { return Ok((0, Findings::default())) };
    let mut findings = Findings::default();
    let section = place.offset / PAGE_BYTES as u64..place.end() / PAGE_BYTES as u64;
    for (page, entry) in terrain.present_pages()? {
        if section.contains(&u64::from(entry.page)) {
            findings.add(super::record_page(terrain, page), "its page lies in the imagery section");
        }
    }
    let imagery = match Imagery::open(terrain) {
        Ok(Some(imagery)) => imagery,
        Ok(None) => return Ok((0, findings)),
        Err(LayoutError::Damaged { place, problem, .. }) => {
            findings.add(place, problem);
            return Ok((0, findings));
        }
        Err(other) => return Err(other),
    };
    let places = places_of(&imagery);
    // Painted tiles lie between the pages of edits.
    for (page, entry) in terrain.present_pages()? {
        let number = u64::from(entry.page);
        let behind = places.partition_point(|(first, ..)| *first <= number);
        if let Some((first, pages, id)) = behind.checked_sub(1).map(|i| places[i])
            && number < first + pages
            && !section.contains(&number)
        {
            let problem = format!("its page is also that of imagery {}", crate::imagery::tile_name(id));
            findings.add(super::record_page(terrain, page), problem);
        }
    }
    let ids: Vec<TileId> = imagery.shape().ids().filter(|id| imagery.has_tile(*id)).collect();
    let task = |tile: &mut Vec<u8>, id: &TileId| match imagery.read_tile(terrain, *id, tile) {
        Ok(_) => {
            progress(imagery.stored_pages(*id));
            Ok(None)
        }
        Err(LayoutError::Damaged { place, problem, .. }) => Ok(Some((place, problem))),
        Err(other) => Err(other),
    };
    let found: Vec<Option<(String, String)>> =
        ids.par_iter().map_init(Vec::new, task).collect::<Result<_, LayoutError>>()?;
    for (place, problem) in found.into_iter().flatten() {
        findings.add(place, problem);
    }
    Ok((ids.len() as u64, findings))
}

/// First page, pages and name of each tile, in the order of the file. Opening has checked that no two share a page.
fn places_of(imagery: &Imagery) -> Vec<(u64, u64, TileId)> {
    let mut places: Vec<(u64, u64, TileId)> = imagery
        .shape()
        .ids()
        .filter_map(|id| imagery.first_page(id).map(|page| (page, imagery.stored_pages(id), id)))
        .collect();
    places.sort_unstable();
    places
}
