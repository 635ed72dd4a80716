//! Edits in a file of their own, beside a terrain that stays as it is. What would be written behind the terrain's end is written to the overlay instead (FORMAT.md, section 7.3).
//!
//! Page numbers and offsets in an overlay go on where those of the base ended when it was made, so that both read as one file; only the header slots are the overlay's own. It names
//! the state of the base that it was made over. **A base that was edited, draped or undone since still holds that state, for nothing in it is written over, and the overlay shows it.** It is
//! refused over a base that was written anew, and over another terrain. Cost over a base that has grown: that of opening its older state, and a read of each page of its last commit.

use super::bytes::{PAGE_BYTES, Page, checksum, get_text, get_u32, get_u64, put_text, put_u32, put_u64};
use super::disk::Disk;
use super::header::{Header, seal};
use super::journal::{Lineage, State};
use super::page_table::PageTable;
use super::source::{LayeredSource, PreadSource, Source, split_of};
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::slots::Slots;
use std::path::Path;

/// First bytes of an overlay.
pub(crate) use super::version::OVERLAY_MAGIC as MAGIC;
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
/// As [`AtomicFile`]'s; damage of the base's picture; I/O.
pub(crate) fn create_overlay(
    disk: &dyn Disk,
    base: &dyn Source,
    slots: &Slots,
    overlay: &Path,
) -> Result<(), LayoutError> {
    if overlay.exists() {
        return Ok(());
    }
    let picture = picture_of(base, &slots.header)?;
    let file = AtomicFile::create(overlay)?;
    let name = base.path().file_name().unwrap_or_default().to_string_lossy();
    let when_full =
        "cannot write the overlay, for which there is no room; make some on its disk, or name one on another";
    disk.write_at(file.file(), &empty_overlay(slots, picture, &name), 0)
        .map_err(|e| LayoutError::write(overlay, "cannot write the overlay", when_full, e))?;
    // Another who made one meanwhile was as quick to be right.
    file.publish_new_on(disk).map(drop)
}

/// The first pages of an overlay without edits over the base with these header slots.
fn empty_overlay(base: &Slots, picture: u32, base_name: &str) -> Vec<u8> {
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
    put_u32(&mut page[..], 0x100, picture);
    put_text(&mut page[..], 0x400, base_name);
    seal(&mut page);
    let mut bytes = page.to_vec();
    bytes.resize(FIRST_PAGES as usize * PAGE_BYTES, 0);
    bytes
}

/// The checksum of the first page of the picture that a header leads to, which those of all its tiles are part of; 0 where there is none.
fn picture_of(source: &dyn Source, header: &Header) -> Result<u32, LayoutError> {
    let Some(place) = header.imagery else { return Ok(0) };
    let mut page = [0; PAGE_BYTES];
    source.read_at(place.offset, &mut page)?;
    let stored = get_u32(&page, 0xffc);
    if checksum(&page[..0xffc]) != stored {
        return Err(LayoutError::damaged(
            source.path(),
            format!("byte {}", place.offset),
            "the picture's first page does not match its checksum; restore a copy of the file, or drape the picture again",
        ));
    }
    Ok(stored)
}

/// An overlay over its base, checked as far as their headers go.
pub(crate) struct Overlaid {
    /// The overlay's header slots.
    pub(crate) slots: Slots,
    /// Where in the two together it begins.
    pub(crate) split: u64,
    /// Whether the base was written to since the overlay was made.
    has_grown: bool,
    /// The generation of the base that it was made over.
    generation: u32,
    /// The checksum of the picture that the base had then.
    picture: u32,
}

impl Overlaid {
    /// Reads the header slots of both.
    pub(crate) fn read(base: &mut dyn Source, overlay: &mut PreadSource) -> Result<Self, LayoutError> {
        let found = Slots::read(base, 0)?;
        // What the header counts was in the file before the header was, and may not have been when the file was opened.
        base.measure_again()?;
        if overlay.byte_count() < FIRST_PAGES * PAGE_BYTES as u64 {
            return Err(not_an_overlay(overlay.path()));
        }
        let slots = Slots::read_as(&*overlay, 0, MAGIC).map_err(|error| match error {
            LayoutError::NotThisFormat { .. } => not_an_overlay(overlay.path()),
            other => other,
        })?;
        let wanted = Base::read(&slots.current);
        let is_same = wanted == Base::of(&found);
        let name = get_text(&slots.current[..], 0x400).unwrap_or_default();
        if !is_same && !is_same_ground(&slots.header, &found.header) {
            return Err(over_another(overlay.path(), base.path(), &name));
        }
        let (then, now) = (wanted, &found.header);
        let has_grown = is_kin(&slots.header, now)
            && now.generation > then.generation
            && now.file_bytes >= then.file_bytes;
        if !is_same && !has_grown {
            return Err(written_anew(overlay.path(), base.path()));
        }
        // The header first and then the length: what a header counts was in the file before the header was.
        overlay.measure_again()?;
        let split = split_of(wanted.file_bytes);
        if split.saturating_add(overlay.byte_count()) < slots.header.file_bytes {
            return Err(LayoutError::damaged(
                overlay.path(),
                format!("byte {}", overlay.byte_count()),
                "the file is cut short; restore a copy of it",
            ));
        }
        let picture = get_u32(&slots.current[..], 0x100);
        // A header says where a picture lies and not what is in it. Overlays of before it was noted say 0.
        if is_same && picture != 0 && picture_of(base, &found.header)? != picture {
            return Err(written_anew(overlay.path(), base.path()));
        }
        Ok(Self { slots, split, has_grown: !is_same, generation: wanted.generation, picture })
    }

    /// Both as one source.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if the base no longer holds the state that the overlay was made over; a damaged journal of the overlay, without which that cannot be known; I/O.
    pub(crate) fn source(
        &self,
        base: Box<dyn Source>,
        overlay: Box<dyn Source>,
    ) -> Result<Box<dyn Source>, LayoutError> {
        if self.has_grown {
            let both = LayeredSource::new(Box::new(&*base), self.split, Box::new(&*overlay), true);
            self.check_older_state(&both, base.path())?;
        }
        Ok(Box::new(LayeredSource::new(base, self.split, overlay, self.has_grown)))
    }

    /// Whether the base still holds the state that the overlay was made over: its directory by checksums, which those of all its pages are part of, and the pages of the commit that led
    /// to it, which a power cut could have undone under another program's eyes.
    fn check_older_state(&self, both: &LayeredSource<'_>, base: &Path) -> Result<(), LayoutError> {
        let now = &self.slots.header;
        let original = Lineage::read(both, now).map_err(|error| match error {
            LayoutError::Damaged { .. } => LayoutError::damaged(
                both.path(),
                "its journal",
                format!("without it nobody knows whether {}, which was changed since, still holds what these edits refer to; name a copy of it from when they were made, over which they read, or restore a copy of the overlay", base.display()),
            ),
            other => other,
        })?.original;
        let header = Header { history: None, ..original.put_into(now) };
        let anew = |error| match error {
            LayoutError::Damaged { .. } => written_anew(both.path(), base),
            other => other,
        };
        let pages = PageTable::open(both, &header).map_err(anew)?;
        pages.check(both).map_err(anew)?;
        // A picture changes neither the directory nor any page in it.
        if picture_of(both, &header).map_err(anew)? != self.picture {
            return Err(written_anew(both.path(), base));
        }
        let mut page = [0; PAGE_BYTES];
        // Pages as built came all at once, with a header behind them.
        let of_last = |generation| generation == self.generation && generation > 1;
        for (_, entry) in pages.present().filter(|(_, entry)| of_last(entry.generation)) {
            both.read_at(u64::from(entry.page) * PAGE_BYTES as u64, &mut page)?;
            if checksum(&page) != entry.checksum {
                return Err(written_anew(both.path(), base));
            }
        }
        Ok(())
    }
}

/// Whether two headers may be those of one terrain at different times: whether they agree in all that edits and pictures leave alone.
fn is_kin(a: &Header, b: &Header) -> bool {
    let b = State::of(a).put_into(b);
    *a == Header { generation: a.generation, file_bytes: a.file_bytes, history: a.history, ..b }
}

/// Whether two headers are those of terrains with the same samples, for the words of a refusal.
fn is_same_ground(a: &Header, b: &Header) -> bool {
    let of = |h: &Header| (h.grid, h.sample_to_crs, h.epsg, h.crs_name.clone());
    of(a) == of(b)
}

fn over_another(overlay: &Path, base: &Path, name: &str) -> LayoutError {
    let (overlay, base) = (overlay.display(), base.display().to_string());
    let called = match name {
        "" => String::new(),
        name if name == base => ", which had the same name".into(),
        name => format!(", which was called {name}"),
    };
    LayoutError::Usage(format!(
        "{overlay}: these edits were made over another terrain{called}, not over {base}; name the terrain they were made over"
    ))
}

fn written_anew(overlay: &Path, base: &Path) -> LayoutError {
    let (overlay, base) = (overlay.display(), base.display());
    LayoutError::Usage(format!(
        "{overlay}: {base} was written anew after these edits were begun (built again, compacted, given room for other heights, or put back from an older copy), and what they refer to is no longer in it; name a copy of {base} from before, or make the edits again in a new overlay"
    ))
}

fn not_an_overlay(path: &Path) -> LayoutError {
    LayoutError::not_this_format(
        path,
        "this is no overlay of edits (.iqo); name one, or a new file for one, when the terrain is edited",
    )
}
