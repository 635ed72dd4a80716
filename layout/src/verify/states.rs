//! Older and newer states of an edited file, down to the pages that only they lead to.
//!
//! States share most of their pages. So of each only what differs from the state looked at before is read: leaves where the root names another one, record pages
//! and tiles once, however many states have them. Nothing that writers make overlaps, so all of it together is no longer than the file. A file that claims more is
//! refused; otherwise a small file could keep a reader busy for long. Cost: a read of what the file holds besides its current state, 24 bytes a record page or tile read, and what
//! opening takes.

use super::Findings;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, checksum, to_usize};
use crate::file::entries::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, PageUses};
use crate::file::header::Header;
use crate::file::journal::State;
use crate::file::page_table::{Leaf, PageTable, present, read_leaf, read_root};
use crate::imagery::Imagery;
use crate::read::terrain::Terrain;
use rayon::prelude::*;
use std::collections::BTreeSet;

const PAGE: u64 = PAGE_BYTES as u64;
/// States with problems after which the rest is not looked at.
const MOST_BAD_STATES: usize = 20;

/// Bytes of the file, and what a state says of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Wanted {
    page: u32,
    bytes: u32,
    checksum: u32,
    is_tile: bool,
    /// Logical page, or place in the directory of tiles.
    index: u64,
    /// Place in [`States::names`].
    state: u32,
}

impl Wanted {
    /// What makes two of them one read.
    fn what(&self) -> (u32, u32, u32) {
        (self.page, self.bytes, self.checksum)
    }
}

/// States, one after the other.
pub(super) struct States<'t> {
    terrain: &'t Terrain,
    names: Vec<String>,
    /// The sound state looked at last: its header, root, entries, and the pages that these take.
    header: Header,
    table: PageTable,
    uses: PageUses,
    journal: Vec<u32>,
    /// Roots and imagery seen.
    roots: BTreeSet<(u32, u32, u64)>,
    sections: BTreeSet<(u64, u64)>,
    wanted: Vec<Wanted>,
    /// Bytes of directories that may still be read.
    left: u64,
    bad: usize,
}

impl<'t> States<'t> {
    /// Begins with the state that the terrain is in, whose whole directory was checked.
    pub(super) fn of(terrain: &'t Terrain) -> Result<Self, LayoutError> {
        let (source, header) = (terrain.source(), terrain.header());
        let state = State::of(header);
        let mut states = Self {
            terrain,
            names: Vec::new(),
            header: header.clone(),
            table: terrain.table().clone(),
            uses: PageUses::new(source, header.file_bytes)?,
            journal: Vec::new(),
            roots: BTreeSet::from([root_of(&state)]),
            sections: header.imagery.iter().map(|place| (place.offset, place.bytes)).collect(),
            wanted: Vec::new(),
            left: source.byte_count(),
            bad: 0,
        };
        states.take_all()?;
        Ok(states)
    }

    /// No state may use the journal page `page` for anything else.
    pub(super) fn take_journal(&mut self, page: u32, findings: &mut Findings) {
        match self.uses.take(page.into(), 1) {
            Ok(()) => self.journal.push(page),
            Err(problem) => findings.add(format!("journal (file page {page})"), problem),
        }
    }

    /// Takes all pages of the state held, from none.
    fn take_all(&mut self) -> Result<(), LayoutError> {
        let source = self.terrain.source();
        self.uses = PageUses::new(source, self.terrain.header().file_bytes)?;
        self.table.take_all(source, &mut self.uses)?;
        // They were free before.
        self.journal.iter().for_each(|page| _ = self.uses.take((*page).into(), 1));
        Ok(())
    }

    /// Checks what `state` has that none had before it; `name` says in messages which it is.
    pub(super) fn look_at(
        &mut self,
        name: String,
        state: &State,
        findings: &mut Findings,
    ) -> Result<(), LayoutError> {
        if self.bad >= MOST_BAD_STATES {
            return Ok(());
        }
        let header = state.put_into(self.terrain.header());
        self.names.push(name);
        let found = [
            if self.roots.insert(root_of(state)) { self.directory(&header) } else { Ok(()) },
            self.imagery(&header),
        ];
        for error in found.into_iter().filter_map(Result::err) {
            let LayoutError::Damaged { place, problem, .. } = error else { return Err(error) };
            findings.add(format!("{place} {}", self.name(self.names.len() - 1)), problem);
            self.bad += 1;
        }
        Ok(())
    }

    fn name(&self, state: usize) -> &str {
        self.names.get(state).map_or("", String::as_str)
    }

    /// Takes `bytes` off those that may be read of directories.
    fn spend(&mut self, bytes: u64, place: &str) -> Result<(), LayoutError> {
        let left = self.left.checked_sub(bytes);
        self.left = left.unwrap_or(0);
        left.map(|_| ()).ok_or_else(|| over_one_another(self.terrain, place))
    }

    /// Goes from the directory held to that of `header`.
    fn directory(&mut self, header: &Header) -> Result<(), LayoutError> {
        let source = self.terrain.source();
        self.spend(header.directory().root_entries() * ENTRY_BYTES as u64, "directory root")?;
        let root = read_root(source, header)?;
        let mut left = self.left;
        let mut nodes = 0;
        let differing = self.table.leaves_to(source, header, &root, |i| {
            nodes += PAGE;
            left = left
                .checked_sub(PAGE)
                .ok_or_else(|| over_one_another(self.terrain, format!("directory node {i}")))?;
            Ok(())
        })?;
        self.spend(nodes, "directory")?;
        let mut leaves = Vec::new();
        for (i, here) in differing {
            if here.is_present() {
                self.spend(PAGE, &format!("directory leaf {i}"))?;
            }
            leaves.push((i, here, read_leaf(source, header, i, here)?));
        }
        let taken = self.exchange(header, &root, &leaves);
        if taken.is_err() {
            self.take_all()?;
            return taken;
        }
        let state = (self.names.len() - 1) as u32;
        for (i, here, leaf) in leaves {
            let first = i * ENTRIES_PER_LEAF as u64;
            let ours = self.table.read_leaf(i);
            let pairs = (first..).zip(ours.iter().zip(&leaf));
            for (index, (_, theirs)) in pairs.filter(|(_, (a, b))| a != b && b.is_present()) {
                let Entry { page, checksum, .. } = *theirs;
                let bytes = PAGE_BYTES as u32;
                self.wanted.push(Wanted { page, bytes, checksum, is_tile: false, index, state });
            }
            self.table.set_leaf(i, here, leaf);
        }
        self.table.set_root(header, root);
        self.header = header.clone();
        Ok(())
    }

    /// Gives back the pages of root, nodes and leaves that are not the new state's, and takes those that are.
    fn exchange(
        &mut self,
        header: &Header,
        root: &[Entry],
        leaves: &[(u64, Entry, Leaf)],
    ) -> Result<(), LayoutError> {
        let source = self.terrain.source();
        let has_nodes = header.directory().has_nodes();
        self.uses.give_back_root(&self.header, self.table.root());
        let mut stored = self.header.stored_pages;
        for (i, ..) in leaves {
            if has_nodes {
                self.uses.give_back_entries(&[self.table.known_leaf_entry(*i)]);
            }
            let ours = self.table.read_leaf(*i);
            self.uses.give_back_entries(&ours);
            stored -= present(&ours);
        }
        self.uses.take_root(source, header, root)?;
        for (i, here, leaf) in leaves {
            if has_nodes {
                self.uses.take_leaves(source, *i, &[*here])?;
            }
            self.uses.take_entries(source, i * ENTRIES_PER_LEAF as u64, leaf)?;
            stored += present(leaf);
        }
        if stored != header.stored_pages {
            let problem = "it holds another number of pages than the state says";
            return Err(LayoutError::damaged(source.path(), "directory", problem));
        }
        Ok(())
    }

    /// The imagery of `header`, if no state before had it.
    fn imagery(&mut self, header: &Header) -> Result<(), LayoutError> {
        let Some(place) = header.imagery else { return Ok(()) };
        if !self.sections.insert((place.offset, place.bytes)) {
            return Ok(());
        }
        let imagery = Imagery::open_at(self.terrain, place, header.file_bytes)?;
        self.spend(imagery.directory_bytes() + PAGE, "imagery directory")?;
        let state = (self.names.len() - 1) as u32;
        for (index, id) in (0u64..).zip(imagery.shape().ids()) {
            if let Some((page, bytes, checksum)) = imagery.stored_place(id) {
                self.wanted.push(Wanted { page, bytes, checksum, is_tile: true, index, state });
            }
        }
        Ok(())
    }

    /// Reads each page and tile that was noted, once, and holds it against its checksum.
    pub(super) fn read_pages(mut self, findings: &mut Findings) -> Result<(), LayoutError> {
        self.wanted.sort_unstable();
        self.wanted.dedup_by_key(|wanted| wanted.what());
        let sum: u64 = self.wanted.iter().map(|wanted| u64::from(wanted.bytes)).sum();
        if sum > self.terrain.source().byte_count() {
            let problem =
                "what its states lead to is longer than the file, so pages of some lie over those of others";
            findings.add("journal".into(), problem);
            return Ok(());
        }
        let source = self.terrain.source();
        let is_wrong = |bytes: &mut Vec<u8>, wanted: &Wanted| -> Result<bool, LayoutError> {
            bytes.resize(to_usize(wanted.bytes.into())?, 0);
            source.read_at(u64::from(wanted.page) * PAGE, bytes)?;
            Ok(checksum(bytes) != wanted.checksum)
        };
        let wrong: Vec<bool> =
            self.wanted.par_iter().map_init(Vec::new, is_wrong).collect::<Result<_, LayoutError>>()?;
        for (wanted, _) in self.wanted.iter().zip(wrong).filter(|(_, is_wrong)| *is_wrong) {
            let what = if wanted.is_tile { "tile in place" } else { "record page" };
            let name = self.name(wanted.state as usize);
            let place = format!("{what} {} (file page {}) {name}", wanted.index, wanted.page);
            findings.add(place, "the checksum does not match");
        }
        Ok(())
    }
}

fn over_one_another(terrain: &Terrain, place: impl Into<String>) -> LayoutError {
    let problem = "with those of other states it is longer than the file, so they lie over one another";
    LayoutError::damaged(terrain.path(), place.into(), problem)
}

/// What tells one root from another.
fn root_of(state: &State) -> (u32, u32, u64) {
    (state.root_page, state.root_checksum, state.stored_pages)
}
