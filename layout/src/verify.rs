//! Whether a terrain file is sound: every page matches its checksum, every page number is used once, and records are as section 3 of FORMAT.md
//! promises.
//!
//! Opening checks header, directory root and inert page. This checks the rest: the leaves of the directory first, then, in passes, all that they lead to. `structure` looks at what the directory says besides page numbers,
//! `checksums` below reads every record page once, `nesting` decodes every record of every sound page and looks at its children, `imagery` reads the tiles, `bounds` holds what packed terrain says of errors against its tiles. Of an edited file
//! `journal` looks at all states that it can go back and forth to, by checksums and page numbers; how their records are nested is checked of the current one alone.
//! Cost: each page is read some ten times; each thread holds a few hundred kilobytes at most, and there is the directory. Some bytes are not checked, because nothing depends
//! on them: the header slot that is older than the current one, the bytes after the directory root's last entry, pages that no state reaches.
//!
//! Invariant: a report without problems means that every promise refinement relies on holds for the bytes as they were read.

mod bounds;
mod imagery;
mod journal;
mod nesting;
mod states;
mod structure;
pub mod unused;

use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, checksum};
use crate::grid::record::{Compact, Exact8, Exact16, RecordKind};
use crate::read::lost::LostHeader;
use crate::read::terrain::Terrain;
use rayon::prelude::*;
use std::fmt;

/// Problems that a report lists one by one.
pub(crate) const LISTED_PROBLEMS: usize = 20;

/// Pages that one task works through.
const TASK_PAGES: usize = 64;

/// Something in a file that is not as FORMAT.md says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Where: "record page 17 (file page 20)", "directory leaf 3", "header".
    pub place: String,
    /// What is wrong there.
    pub problem: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.problem)
    }
}

/// What [`verify`] found.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct VerifyReport {
    /// Record pages read and held against their checksum.
    pub pages_checked: u64,
    /// Vertices whose records were decoded and compared with their children's.
    pub vertices_checked: u64,
    /// Tiles of imagery read and held against their checksum.
    pub tiles_checked: u64,
    /// The first 20 problems, in file order within each pass; at most one a page and pass.
    pub problems: Vec<Problem>,
    /// All problems.
    pub problem_count: u64,
    /// The newest header, if it is damaged. It is no problem of the state that was checked, which is the one before it, and a power cut may leave it so, as [`LostHeader::was_saved`] tells.
    pub lost_header: Option<LostHeader>,
}

impl VerifyReport {
    /// Whether the file is sound, in the state that it is read in.
    pub fn is_sound(&self) -> bool {
        self.problem_count == 0
    }
}

/// Problems as they are found: the first ones kept, all counted. Merging in file order keeps the first in file order.
#[derive(Debug, Default)]
struct Findings {
    listed: Vec<Problem>,
    count: u64,
}

impl Findings {
    fn add(&mut self, place: String, problem: impl Into<String>) {
        self.count += 1;
        if self.listed.len() < LISTED_PROBLEMS {
            self.listed.push(Problem { place, problem: problem.into() });
        }
    }

    fn merge(mut self, other: Self) -> Self {
        self.count += other.count;
        let room = LISTED_PROBLEMS - self.listed.len();
        self.listed.extend(other.listed.into_iter().take(room));
        self
    }
}

/// What is told apart when a page is named.
fn record_page(terrain: &Terrain, page: u64) -> String {
    match terrain.known_entry(page) {
        Some(entry) if entry.is_present() => format!("record page {page} (file page {})", entry.page),
        _ => format!("record page {page} (absent)"),
    }
}

/// Pages of work that [`verify`] reports to its `progress`, in sum.
pub fn verify_pages(terrain: &Terrain) -> u64 {
    2 * terrain.header().stored_pages + imagery::pages(terrain)
}

/// Checks the whole file on the current rayon pool. `progress` hears how many more pages are done, [`verify_pages`] in sum.
///
/// # Errors
/// Only if the file cannot be read; what is wrong in it is the report's business. Of a file with a damaged directory it says that alone.
pub fn verify(terrain: &Terrain, progress: &(dyn Fn(u64) + Sync)) -> Result<VerifyReport, LayoutError> {
    // Without the directory nothing is known of what it leads to.
    let present: Vec<u64> = match terrain.present_pages() {
        Ok(pages) => pages.map(|(page, _)| page).collect(),
        Err(LayoutError::Damaged { place, problem, .. }) => {
            let problems = vec![Problem { place, problem }];
            return Ok(VerifyReport { problems, problem_count: 1, ..VerifyReport::default() });
        }
        Err(other) => return Err(other),
    };
    let findings = structure::check(terrain);
    let (damaged, wrong_sums) = checksums(terrain, &present, progress)?;
    let (grid, scale) = (terrain.grid(), &terrain.header().scale);
    let (records, vertices) = match terrain.header().record_kind {
        RecordKind::Compact | RecordKind::Fine => {
            nesting::check(terrain, &Compact::new(grid, scale), &present, &damaged, progress)?
        }
        RecordKind::Exact8 => {
            nesting::check(terrain, &Exact8::new(grid, scale), &present, &damaged, progress)?
        }
        RecordKind::Exact16 => {
            nesting::check(terrain, &Exact16::new(grid, scale), &present, &damaged, progress)?
        }
    };
    let (tiles, pictures) = imagery::check(terrain, progress)?;
    let history = journal::check(terrain)?;
    let bounds = bounds::check(terrain)?;
    let findings = findings.merge(wrong_sums).merge(bounds).merge(records).merge(pictures);
    let Findings { listed, count } = findings.merge(history);
    Ok(VerifyReport {
        pages_checked: present.len() as u64,
        vertices_checked: vertices,
        tiles_checked: tiles,
        problems: listed,
        problem_count: count,
        lost_header: terrain.lost_header()?,
    })
}

/// Reads every record page and holds it against its checksum; gives the pages that do not match, sorted.
fn checksums(
    terrain: &Terrain,
    present: &[u64],
    progress: &(dyn Fn(u64) + Sync),
) -> Result<(Vec<u64>, Findings), LayoutError> {
    let task = |pages: &[u64]| {
        let mut bytes = Box::new([0; PAGE_BYTES]);
        let mut damaged = Vec::new();
        for &page in pages {
            let entry = terrain.entry(page)?;
            terrain.source().read_at(u64::from(entry.page) * PAGE_BYTES as u64, &mut bytes[..])?;
            if checksum(&bytes[..]) != entry.checksum {
                damaged.push(page);
            }
        }
        progress(pages.len() as u64);
        Ok::<_, LayoutError>(damaged)
    };
    let damaged: Vec<Vec<u64>> = present.par_chunks(TASK_PAGES).map(task).collect::<Result<_, _>>()?;
    let damaged = damaged.concat();
    let mut findings = Findings::default();
    for &page in &damaged {
        findings.add(record_page(terrain, page), "the checksum does not match");
    }
    Ok((damaged, findings))
}
