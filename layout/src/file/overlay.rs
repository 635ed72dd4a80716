//! Edits in a file of their own, beside a terrain that stays as it is. What would be written behind the terrain's end is written to the overlay instead (FORMAT.md, section 7.3).
//!
//! Page numbers and offsets in an overlay go on where those of the base end, so that both read as one file; only the header slots are the overlay's own. It names
//! the state of the base that it belongs to, and is refused with any other.

use super::bytes::{PAGE_BYTES, Page, get_text, get_u32, get_u64, put_text, put_u32, put_u64};
use super::disk::Disk;
use super::header::{Header, seal};
use super::source::{PreadSource, Source, split_of};
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::slots::Slots;
use std::path::Path;

/// First bytes of an overlay.
pub(crate) const MAGIC: [u8; 8] = *b"\x89IQO\r\n\x1a\n";
/// Pages that an overlay begins with: its header slots.
pub(crate) const FIRST_PAGES: u64 = 2;

/// The state of a base that an overlay belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Base {
    generation: u32,
    /// Of its current header page.
    checksum: u32,
    file_bytes: u64,
}

impl Base {
    fn of(slots: &Slots) -> Self {
        Self {
            generation: slots.header.generation,
            checksum: get_u32(&slots.current[..], 0xffc),
            file_bytes: slots.header.file_bytes,
        }
    }

    fn read(page: &Page) -> Self {
        Self {
            generation: get_u32(page, 0x0f0),
            checksum: get_u32(page, 0x0f4),
            file_bytes: get_u64(page, 0x0f8),
        }
    }
}

/// Makes the overlay `overlay`, without edits, of the terrain file `base` with these header slots, if nothing has its name.
///
/// # Errors
/// As [`AtomicFile`]'s.
pub(crate) fn create_overlay(
    disk: &dyn Disk,
    base: &Path,
    slots: &Slots,
    overlay: &Path,
) -> Result<(), LayoutError> {
    if overlay.exists() {
        return Ok(());
    }
    let file = AtomicFile::create(overlay)?;
    let name = base.file_name().unwrap_or_default().to_string_lossy();
    let when_full =
        "cannot write the overlay, for which there is no room; make some on its disk, or name one on another";
    disk.write_at(file.file(), &empty_overlay(slots, &name), 0)
        .map_err(|e| LayoutError::write(overlay, "cannot write the overlay", when_full, e))?;
    // Another who made one meanwhile was as quick to be right.
    file.publish_new_on(disk).map(drop)
}

/// The first pages of an overlay without edits over the base with these header slots.
fn empty_overlay(base: &Slots, base_name: &str) -> Vec<u8> {
    let split = split_of(base.header.file_bytes);
    let header =
        Header { file_bytes: split + FIRST_PAGES * PAGE_BYTES as u64, history: None, ..base.header.clone() };
    let mut page = header.amended(&base.current);
    page[..8].copy_from_slice(&MAGIC);
    // An overlay's history is its own.
    put_u64(&mut page[..], 0x0e8, 0);
    let identity = Base::of(base);
    put_u32(&mut page[..], 0x0f0, identity.generation);
    put_u32(&mut page[..], 0x0f4, identity.checksum);
    put_u64(&mut page[..], 0x0f8, identity.file_bytes);
    put_text(&mut page[..], 0x400, base_name);
    seal(&mut page);
    let mut bytes = page.to_vec();
    bytes.resize(FIRST_PAGES as usize * PAGE_BYTES, 0);
    bytes
}

/// The header slots of the overlay over `base`, and where in the two together it begins.
pub(crate) fn overlay_slots(
    base: &PreadSource,
    overlay: &mut PreadSource,
) -> Result<(Slots, u64), LayoutError> {
    let base_slots = Slots::read(base, 0)?;
    if overlay.byte_count() < FIRST_PAGES * PAGE_BYTES as u64 {
        return Err(not_an_overlay(overlay.path()));
    }
    let slots = Slots::read_as(&*overlay, 0, MAGIC).map_err(|error| match error {
        LayoutError::NotThisFormat { .. } => not_an_overlay(overlay.path()),
        other => other,
    })?;
    let (wanted, found) = (Base::read(&slots.current), Base::of(&base_slots));
    if wanted != found {
        let name = get_text(&slots.current[..], 0x400).unwrap_or_default();
        return Err(LayoutError::Usage(format!(
            "{}: these edits belong to {}, not to {}; {}",
            overlay.path().display(),
            if name.is_empty() { "another terrain" } else { &name },
            base.path().display(),
            "name the terrain they were made over, as it was then (an edit or a picture of its own makes it another)"
        )));
    }
    // The header first and then the length: what a header counts was in the file before the header was.
    overlay.measure_again()?;
    let split = split_of(found.file_bytes);
    if split + overlay.byte_count() < slots.header.file_bytes {
        return Err(LayoutError::damaged(
            overlay.path(),
            format!("byte {}", overlay.byte_count()),
            "the file is cut short; restore a copy of it",
        ));
    }
    Ok((slots, split))
}

fn not_an_overlay(path: &Path) -> LayoutError {
    LayoutError::not_this_format(
        path,
        "this is no overlay of edits (.iqo); name one, or a new file for one, when the terrain is edited",
    )
}
