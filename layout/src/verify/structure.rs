//! What the directory says besides page numbers: which generation wrote each page, and that entries of absent pages are empty. It also checks whether the header's numbers of voids agree.
//!
//! What [`Terrain::check_directory`] finds was checked before: checksums of root and leaves, that every page lies in the file, and that none has two uses. Cost: a look at each entry.

use super::{Findings, record_page};
use crate::file::entries::Entry;
use crate::read::terrain::Terrain;

pub(super) fn check(terrain: &Terrain) -> Findings {
    let header = terrain.header();
    let mut findings = Findings::default();
    for (page, entry) in terrain.table().listed() {
        if entry.is_present() {
            if !(1..=header.generation).contains(&entry.generation) {
                let problem = format!(
                    "the directory says generation {} wrote it, the file is at {}",
                    entry.generation, header.generation
                );
                findings.add(record_page(terrain, page), problem);
            }
        } else if entry != Entry::default() {
            findings.add(record_page(terrain, page), "the directory has a checksum or generation for it");
        }
    }
    if header.has_voids != (header.nodata_samples > 0) {
        let problem = format!(
            "it says that voids exist: {}, and that there are {}",
            header.has_voids, header.nodata_samples
        );
        findings.add("header".into(), problem);
    }
    findings
}
