//! The terrain file that a packed one was made of, again.

use super::compare::CHUNK_BYTES;
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::bytes::to_usize;
use crate::file::disk::Disk;
use crate::file::header::Header;
use crate::file::mark::Mark;
use crate::progress::Progress;
use crate::publish::publish_terrain;
use crate::read::terrain::Terrain;
use rayon::prelude::*;
use std::path::Path;

/// Chunks unpacked before they are written.
const CHUNKS_AT_ONCE: u64 = 64;

/// Unpacks `from` into a new file `to`: the same bytes that were packed, every page of them checked.
///
/// # Errors
/// Damage and I/O of the packed file; I/O of `to`; [`LayoutError::Usage`] if `from` is not packed.
pub fn unpack(
    disk: &dyn Disk,
    from: &Path,
    to: &Path,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    let terrain = Terrain::open_unmapped(from)?;
    if terrain.source().packed_bytes().is_none() {
        return Err(LayoutError::Usage(format!("{}: the terrain is not packed", from.display())));
    }
    let file = AtomicFile::create(to)?;
    let bytes = terrain.header().file_bytes;
    let per_page = terrain.header().records_per_page();
    progress.stage("unpacking", terrain.header().stored_pages * per_page);
    let failed = |e| {
        let when_full = "cannot write the terrain file, for which there is no room; make some on its disk, or name an output on another";
        LayoutError::write(file.target(), "cannot write the terrain file", when_full, e)
    };
    // Record pages are checked one by one; what is around them follows from what was checked when it was read.
    let chunks = bytes.div_ceil(CHUNK_BYTES as u64);
    for first in (0..chunks).step_by(CHUNKS_AT_ONCE as usize) {
        let made: Vec<Vec<u8>> = (first..chunks.min(first + CHUNKS_AT_ONCE))
            .into_par_iter()
            .map(|chunk| {
                let from = chunk * CHUNK_BYTES as u64;
                let mut made = vec![0; to_usize((bytes - from).min(CHUNK_BYTES as u64))?];
                terrain.source().read_at(from, &mut made)?;
                progress.advance(made.len() as u64 / 4);
                Ok(made)
            })
            .collect::<Result<_, LayoutError>>()?;
        for (chunk, made) in (first..).zip(made) {
            disk.write_at(file.file(), &made, chunk * CHUNK_BYTES as u64).map_err(failed)?;
        }
    }
    if let Some(mark) = Mark::to_carry(terrain.source(), terrain.header())? {
        disk.write_at(file.file(), &mark, bytes).map_err(failed)?;
    }
    progress.stage("checking", terrain.header().stored_pages * per_page);
    check(&terrain, &file, progress)?;
    progress.stage("syncing", 0);
    publish_terrain(disk, file, None)
}

/// Holds every record page that was written against its checksum.
fn check(terrain: &Terrain, file: &AtomicFile, progress: &dyn Progress) -> Result<(), LayoutError> {
    let path = file.target();
    let again = file
        .file()
        .try_clone()
        .map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
    let unpacked = Terrain::from_source(Box::new(crate::file::source::PreadSource::over(path, again)?))?;
    let per_page = terrain.header().records_per_page();
    let present: Vec<u64> = unpacked.present_pages()?.map(|(page, _)| page).collect();
    present
        .into_par_iter()
        .try_for_each(|page| unpacked.checked_page(page).map(|_| progress.advance(per_page)))
}
