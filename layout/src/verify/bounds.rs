//! Whether bounds of errors that were packed with tiles hold for the records of these: one that is too low would leave ground coarse, and nobody would know.

use super::Findings;
use crate::error::LayoutError;
use crate::read::terrain::Terrain;

pub(super) fn check(terrain: &Terrain) -> Result<Findings, LayoutError> {
    let mut findings = Findings::default();
    if let Some(unpacking) = terrain.source().unpacking() {
        unpacking.wrong_bounds()?.into_iter().for_each(|(place, problem)| findings.add(place, problem));
    }
    Ok(findings)
}
