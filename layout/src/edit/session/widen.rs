//! A terrain file rewritten so that its records have room for other heights.

use super::EditSession;
use super::compact::copy_imagery;
use crate::build::{HeightRoom, rebuild_into};
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::disk::Disk;
use crate::file::header::Header;
use crate::file::lock::WriteLock;
use crate::file::slots::Slots;
use crate::packing::{Check, publish_packed};
use crate::progress::Progress;
use crate::publish::publish_terrain;
use crate::read::terrain::Terrain;
use std::path::Path;

/// Rewrites the terrain file at `path` with room for the heights of `room` beside its own, and for slopes as steep as all of them over one sample. No height and nothing of the
/// imagery changes; errors and radii are rounded up in another scale; where 16 bits do not hold the steps, records take 8 bytes instead of 4. The journal ends: what was edited before can no longer be undone. Readers go on reading
/// the old file. Packed terrain stays packed. Returns the new header.
///
/// # Errors
/// Damage and I/O; [`LayoutError::Usage`] while another program writes to it, for a file with other names (hard links), which would keep the old contents, and as
/// [`rebuild`](crate::build::rebuild). The file is as before then.
pub fn widen(
    disk: &dyn Disk,
    path: &Path,
    room: HeightRoom,
    memory_mib: u64,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    widen_locked(disk, path, &WriteLock::take(path)?, room, memory_mib, progress)
}

/// As [`widen`], by whoever has the right to write.
pub(super) fn widen_locked(
    disk: &dyn Disk,
    path: &Path,
    lock: &WriteLock,
    room: HeightRoom,
    memory_mib: u64,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    lock.check_only_name(path)?;
    let terrain = Terrain::open(path)?;
    let file = AtomicFile::create(path)?;
    let header = rebuild_into(disk, &terrain, &file, Some(room), memory_mib, progress)?;
    let slots = Slots { current: header.to_page(), current_slot: 0, header, packed_end: None };
    copy_imagery(disk, &file, slots, &terrain)?;
    let packs = terrain.source().packed_bytes().is_some();
    // Windows replaces no file that is mapped.
    drop(terrain);
    if packs {
        return Ok(publish_packed(
            disk,
            file,
            AtomicFile::create(path)?,
            Some(lock),
            Check::Pages,
            progress,
        )?
        .0);
    }
    progress.stage("syncing", 0);
    publish_terrain(disk, file, Some(lock))
}

impl EditSession {
    /// As [`widen`], of the file of this session, which keeps the right to edit until the new file has the name. The session ends with it: what was not committed is in neither file, and is to be
    /// applied again in a session of the new one. After an error the session goes on with everything that it has.
    ///
    /// # Errors
    /// As [`widen`]; [`LayoutError::Usage`] for an overlay, whose records are of its terrain's scale, and while a commit is under way. The session comes back, unless the file has the new contents
    /// all the same.
    pub fn widen(
        mut self,
        room: HeightRoom,
        memory_mib: u64,
        progress: &dyn Progress,
    ) -> Result<Header, (Option<Box<Self>>, LayoutError)> {
        let path = self.path.clone();
        let checked = self.check_idle().and_then(|_| match self.start {
            0 => Ok(()),
            _ => Err(LayoutError::Usage(format!("{}: an overlay cannot be rewritten with room for other heights; make one file of it and its terrain, and edit that", path.display()))),
        });
        let widened =
            checked.and_then(|()| widen_locked(&*self.disk, &path, &self.lock, room, memory_mib, progress));
        widened.or_else(|error| {
            if self.lock.is_of(&path) {
                return Err((Some(Box::new(self)), error));
            }
            // The new file has the name, which only has to last.
            header_of_renamed(&*self.disk, &path).ok_or((None, error))
        })
    }
}

/// Brings the name of the file at `path` to the disk, and reads what has it.
fn header_of_renamed(disk: &dyn Disk, path: &Path) -> Option<Header> {
    let real = std::fs::canonicalize(path).ok()?;
    disk.sync_folder(real.parent()?).ok()?;
    Some(Terrain::open_unmapped(path).ok()?.header().clone())
}

/// Room for heights that a file cannot hold, `heights_m` from the lowest to the highest as [`LayoutError::OutOfRange`] tells them: as much again beyond its range as they ask for,
/// so that many edits do not rewrite it many times; less where that would take larger records. Where slopes are too steep these are the heights of the ground with the edit, and [`widen`] makes room for slopes
/// between any of them. Heights that are not numbers ask for nothing.
pub fn room_for(header: &Header, heights_m: [f64; 2]) -> HeightRoom {
    let [low, high] = header.height_range_m;
    let lowest = if heights_m[0].is_nan() { low } else { heights_m[0].min(low) };
    let highest = if heights_m[1].is_nan() { high } else { heights_m[1].max(high) };
    let roomy = HeightRoom { lowest_m: 2.0 * lowest - low, highest_m: 2.0 * highest - high };
    let steps = (roomy.highest_m - roomy.lowest_m) / header.scale.height_step_m;
    if header.record_kind.has_height_codes() && steps > 60_000.0 {
        return HeightRoom { lowest_m: lowest, highest_m: highest };
    }
    roomy
}
