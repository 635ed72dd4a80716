//! Page numbers: every page has one use, and the directory agrees with the header.
//!
//! Opening has checked the checksums of root and leaves and that every page lies in the file; it keeps the entries and forgets the
//! leaves, so the root is read again here. Cost: eight bytes a stored page and a sort.

use super::{Findings, record_page};
use crate::bytes::{PAGE_BYTES, to_usize};
use crate::directory::{ENTRY_BYTES, Entry};
use crate::error::LayoutError;
use crate::terrain::Terrain;

/// What a page is used for: record pages by number, then leaves, then the root.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Use {
    Record(u32),
    Leaf(u32),
    Root,
}

impl Use {
    fn name(self, terrain: &Terrain) -> String {
        match self {
            Self::Record(page) => record_page(terrain, page as usize),
            Self::Leaf(leaf) => format!("directory leaf {leaf}"),
            Self::Root => "directory root".into(),
        }
    }
}

pub(super) fn check(terrain: &Terrain) -> Result<Findings, LayoutError> {
    let header = terrain.header();
    let mut findings = Findings::default();
    let mut uses: Vec<(u32, Use)> = Vec::with_capacity(to_usize(header.stored_pages)?);
    for (page, entry) in (0u32..).zip(terrain.entries()) {
        if entry.is_present() {
            uses.push((entry.page, Use::Record(page)));
            if !(1..=header.generation).contains(&entry.generation) {
                let problem = format!(
                    "the directory says generation {} wrote it, the file is at {}",
                    entry.generation, header.generation
                );
                findings.add(record_page(terrain, page as usize), problem);
            }
        } else if *entry != Entry::default() {
            findings.add(
                record_page(terrain, page as usize),
                "the directory has a checksum or generation for it",
            );
        }
    }
    let mut root = vec![0; to_usize(header.root_entries() * ENTRY_BYTES as u64)?];
    terrain.source().read_at(u64::from(header.root_page) * PAGE_BYTES as u64, &mut root)?;
    for leaf in 0..header.root_entries() as u32 {
        let entry = Entry::read(&root, leaf as usize);
        if entry.is_present() {
            uses.push((entry.page, Use::Leaf(leaf)));
        }
    }
    let root_pages = root.len().div_ceil(PAGE_BYTES) as u32;
    uses.extend((0..root_pages).map(|i| (header.root_page.saturating_add(i), Use::Root)));
    uses.sort_unstable();
    for pair in uses.windows(2) {
        let [(page, first), (other, second)] = [pair[0], pair[1]];
        if page == other {
            findings.add(
                second.name(terrain),
                format!("file page {page} is also that of the {}", first.name(terrain)),
            );
        }
    }
    if header.has_voids != (header.nodata_samples > 0) {
        let problem = format!(
            "it says that voids exist: {}, and that there are {}",
            header.has_voids, header.nodata_samples
        );
        findings.add("header".into(), problem);
    }
    Ok(findings)
}
