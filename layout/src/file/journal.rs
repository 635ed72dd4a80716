//! The journal of an edited file: one page a commit, each with the state that it led to and the commit before it (FORMAT.md, section 7).
//!
//! Nothing is ever written over, so every state that a file was in is still there, and a journal page says where. To go back, a header is written that names an older state.

use super::bytes::{
    PAGE_BYTES, Page, checksum, get_f64, get_text, get_u16, get_u32, get_u64, put_f64, put_text, put_u16,
    put_u32, put_u64,
};
use super::header::{Header, History, ImageryPlace, seal};
use super::source::Source;
use crate::error::LayoutError;
use std::path::Path;

/// First bytes of a journal page.
const MAGIC: [u8; 8] = *b"IQTCOMIT";

/// Everything of a file that edits change, as far as a header says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct State {
    pub(crate) root_page: u32,
    pub(crate) root_checksum: u32,
    pub(crate) stored_pages: u64,
    pub(crate) height_range_m: [f64; 2],
    pub(crate) error_top_m: f64,
    pub(crate) imagery: Option<ImageryPlace>,
}

impl State {
    /// The state that a header names.
    pub(crate) fn of(header: &Header) -> Self {
        Self {
            root_page: header.root_page,
            root_checksum: header.root_checksum,
            stored_pages: header.stored_pages,
            height_range_m: header.height_range_m,
            error_top_m: header.scale.error_top_m,
            imagery: header.imagery,
        }
    }

    /// `header` with this state in place of its own.
    pub(crate) fn put_into(&self, header: &Header) -> Header {
        let mut header = Header {
            root_page: self.root_page,
            root_checksum: self.root_checksum,
            stored_pages: self.stored_pages,
            height_range_m: self.height_range_m,
            imagery: self.imagery,
            ..header.clone()
        };
        header.scale.error_top_m = self.error_top_m;
        header
    }

    fn write(&self, p: &mut [u8], at: usize) {
        put_u32(p, at, self.root_page);
        put_u32(p, at + 0x04, self.root_checksum);
        put_u64(p, at + 0x08, self.stored_pages);
        put_f64(p, at + 0x10, self.height_range_m[0]);
        put_f64(p, at + 0x18, self.height_range_m[1]);
        put_f64(p, at + 0x20, self.error_top_m);
        put_u64(p, at + 0x28, self.imagery.map_or(0, |place| place.offset));
        put_u64(p, at + 0x30, self.imagery.map_or(0, |place| place.bytes));
    }

    fn read(p: &[u8], at: usize) -> Self {
        Self {
            root_page: get_u32(p, at),
            root_checksum: get_u32(p, at + 0x04),
            stored_pages: get_u64(p, at + 0x08),
            height_range_m: [get_f64(p, at + 0x10), get_f64(p, at + 0x18)],
            error_top_m: get_f64(p, at + 0x20),
            imagery: match [get_u64(p, at + 0x28), get_u64(p, at + 0x30)] {
                [0, 0] => None,
                [offset, bytes] => Some(ImageryPlace { offset, bytes }),
            },
        }
    }
}

/// What the next commit of a file follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lineage {
    /// Journal page of the commit that the file is at; 0 if it is as it was built.
    parent: u32,
    /// Of the commit after it.
    sequence: u32,
    /// The state before all commits.
    pub(crate) original: State,
}

impl Lineage {
    /// Of the file that `header` is the current one of.
    ///
    /// # Errors
    /// As [`Commit::read`].
    pub(crate) fn read(source: &dyn Source, header: &Header) -> Result<Self, LayoutError> {
        let Some(History { commit_page, tip_page }) = header.history else {
            return Ok(Self { parent: 0, sequence: 1, original: State::of(header) });
        };
        let tip = Commit::read(source, header, tip_page)?;
        let sequence = match commit_page {
            0 => 0,
            page if page == tip_page => tip.sequence,
            page => Commit::read(source, header, page)?.sequence,
        };
        Ok(Self { parent: commit_page, sequence: sequence.saturating_add(1), original: tip.original })
    }

    /// Commits that led to the state that is current.
    pub(crate) fn commits(&self) -> u32 {
        self.sequence - 1
    }

    /// The commit that follows and leads to `state`.
    pub(crate) fn commit(&self, state: State, edits: u64, label: &str) -> Commit {
        let Self { parent, sequence, original } = *self;
        Commit { parent, sequence, edits, state, original, label: label.to_owned() }
    }
}

/// One commit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Commit {
    /// Journal page of the commit before it; 0 if that is how the file was built.
    pub(crate) parent: u32,
    /// 1 for the first commit of a file.
    pub(crate) sequence: u32,
    /// Edits in it.
    pub(crate) edits: u64,
    /// What it led to.
    pub(crate) state: State,
    /// What was there before all commits.
    pub(crate) original: State,
    /// What it was, in words.
    pub(crate) label: String,
}

impl Commit {
    pub(crate) fn to_page(&self) -> Box<Page> {
        let mut page = Box::new([0; PAGE_BYTES]);
        let p = &mut page[..];
        p[..8].copy_from_slice(&MAGIC);
        put_u16(p, 0x008, 1);
        put_u32(p, 0x00c, self.sequence);
        put_u32(p, 0x010, self.parent);
        put_u64(p, 0x018, self.edits);
        self.state.write(p, 0x040);
        self.original.write(p, 0x080);
        put_text(p, 0x200, &self.label);
        seal(&mut page);
        page
    }

    /// Reads and checks the journal page `number` of the file that `header` describes.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the page; [`LayoutError::Unsupported`] for a later version of it; I/O.
    pub(crate) fn read(source: &dyn Source, header: &Header, number: u32) -> Result<Self, LayoutError> {
        let mut page = Box::new([0; PAGE_BYTES]);
        source.read_at(u64::from(number) * PAGE_BYTES as u64, &mut page[..])?;
        Self::parse(source.path(), header, number, &page)
    }

    /// As [`Commit::read`], of a page in memory.
    pub(crate) fn parse(path: &Path, header: &Header, number: u32, page: &Page) -> Result<Self, LayoutError> {
        let p = &page[..];
        let damaged = |problem: &str| {
            LayoutError::damaged(
                path,
                format!("journal (file page {number})"),
                format!(
                    "{problem}; the terrain itself reads, `terrasoar compact` writes it without its journal"
                ),
            )
        };
        if p[..8] != MAGIC || get_u32(p, 0xffc) != checksum(&p[..0xffc]) {
            return Err(damaged("the checksum does not match"));
        }
        if get_u16(p, 0x008) != 1 {
            let version = get_u16(p, 0x008);
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "the journal has version {version}, this program reads version 1; use a newer terrasoar"
                ),
            ));
        }
        let Some(label) = get_text(p, 0x200) else { return Err(damaged("its label is not text")) };
        let commit = Self {
            parent: get_u32(p, 0x010),
            sequence: get_u32(p, 0x00c),
            edits: get_u64(p, 0x018),
            state: State::read(p, 0x040),
            original: State::read(p, 0x080),
            label,
        };
        // A header with the state must be one that opening accepts.
        let is_sound = |state: &State| Header::parse(path, &state.put_into(header).to_page()).is_ok();
        // Commits lie behind one another, so that a journal cannot go round in circles.
        if commit.parent >= number || !is_sound(&commit.state) || !is_sound(&commit.original) {
            return Err(damaged("it names places that are not in the file"));
        }
        Ok(commit)
    }
}
