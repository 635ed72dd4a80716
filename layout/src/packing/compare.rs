//! What was packed against the terrain file that it was made of, before it gets its name.

use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::bytes::{PAGE_BYTES, to_usize};
use crate::file::header::INERT_PAGE;
use crate::file::slots::Slots;
use crate::file::source::{PreadSource, Source};
use crate::packed::source::PackedSource;
use crate::progress::Progress;
use crate::read::terrain::Terrain;
use rayon::prelude::*;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;
/// Bytes compared, or copied, at a time.
pub(super) const CHUNK_BYTES: usize = 256 << 10;
/// Pages that a thread compares one after the other.
const PAGES: usize = 64;

/// How it is made sure that what was packed is the terrain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Check {
    /// All that the file reads as is compared, page by page: whatever laid the terrain out.
    Pages,
    /// Each tile is unpacked again where it was packed: for terrain that was built a moment ago, which holds nothing beside what tiles give.
    Tiles,
}

/// The bytes of a file that has no name yet.
pub(super) fn read_back(file: &AtomicFile) -> Result<PreadSource, LayoutError> {
    let path = file.target();
    let again = file
        .file()
        .try_clone()
        .map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
    PreadSource::over(path, again)
}

pub(super) fn refused(path: &Path, problem: &str) -> LayoutError {
    LayoutError::unsupported(path, format!("the terrain cannot be packed: {problem}"))
}

/// Whether what was written reads as the terrain file, byte for byte: of record pages where `check` asks for it.
pub(super) fn compare(
    terrain: &Terrain,
    built: &Terrain,
    file: &AtomicFile,
    check: Check,
    progress: &dyn Progress,
) -> Result<(), LayoutError> {
    let packed = PackedSource::open(Box::new(read_back(file)?))?;
    let (bytes, stored) = (terrain.header().file_bytes, built.header().stored_pages);
    progress.stage("comparing", bytes / 4);
    if Slots::read(terrain.source(), 0)?.current != Slots::read(&packed, 0)?.current {
        return Err(refused(terrain.path(), "its header holds what no build writes"));
    }
    let same = |from: u64, count: u64| {
        let count = to_usize(count)?;
        let (mut ours, mut theirs) = (vec![0; count], vec![0; count]);
        terrain.source().read_at(from, &mut ours)?;
        packed.read_at(from, &mut theirs)?;
        progress.advance(count as u64 / 4);
        let Some(at) = ours.iter().zip(&theirs).position(|(a, b)| a != b) else { return Ok(()) };
        let page = (from + at as u64) / PAGE;
        Err(refused(
            terrain.path(),
            &format!("file page {page} holds what no build writes; check it with `terrasoar verify`"),
        ))
    };
    // The header page that does not count may hold anything.
    let first = u64::from(INERT_PAGE);
    same(first * PAGE, PAGE)?;
    let behind = (first + 1 + stored) * PAGE;
    (0..bytes.saturating_sub(behind).div_ceil(CHUNK_BYTES as u64)).into_par_iter().try_for_each(|chunk| {
        let from = behind + chunk * CHUNK_BYTES as u64;
        same(from, (bytes - from).min(CHUNK_BYTES as u64))
    })?;
    if check == Check::Tiles {
        return Ok(());
    }
    // Pages that lie side by side one after the other, so that a tile is unpacked once for all of them.
    let mut pages: Vec<u64> = (first + 1..first + 1 + stored).collect();
    pages.par_sort_by_cached_key(|number| packed.place_of(*number));
    pages.par_iter().with_min_len(PAGES).try_for_each(|number| same(number * PAGE, PAGE))
}
