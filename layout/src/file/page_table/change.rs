//! A directory that becomes that of another state.

use super::{Leaf, Node, PER_LEAF, PageTable, read_node, split};
use crate::error::LayoutError;
use crate::file::entries::{ENTRIES_PER_LEAF, Entry};
use crate::file::header::Header;
use crate::file::source::Source;
use std::sync::{Arc, OnceLock};

const NO_ENTRIES: Leaf = [Entry { page: 0, checksum: 0, generation: 0 }; ENTRIES_PER_LEAF];

impl PageTable {
    /// A leaf that was read, or one without pages.
    pub(crate) fn read_leaf(&self, leaf: u64) -> Leaf {
        self.known_leaf(leaf).copied().unwrap_or(NO_ENTRIES)
    }

    /// Where the leaves of a node that was read lie.
    pub(crate) fn node_entries(&self, node: u64) -> Leaf {
        self.known_node(node).flatten().map_or(NO_ENTRIES, |node| node.entries)
    }

    /// Where a leaf of a node that was read lies.
    pub(crate) fn known_leaf_entry(&self, leaf: u64) -> Entry {
        let (node, within) = split(leaf);
        self.node_entries(node)[within]
    }

    /// Puts another leaf in place of one.
    pub(crate) fn set_leaf(&mut self, leaf: u64, here: Entry, entries: Leaf) {
        let (node, within) = split(leaf);
        let place = &mut self.nodes[node as usize];
        let mut node = place.take().unwrap_or_else(|| Node::new(NO_ENTRIES));
        node.entries[within] = here;
        node.leaves[within] = OnceLock::from(Arc::new(entries));
        *place = OnceLock::from(node);
        if !self.shape.has_nodes() {
            self.root[leaf as usize] = here;
        }
    }

    /// Puts the root and the header of another state in place of this one's, when all leaves that differ are those of that state.
    pub(crate) fn set_root(&mut self, header: &Header, root: Vec<Entry>) {
        self.root = root;
        self.header = header.clone();
    }

    /// Makes this, of which all was read, that of the state after a commit with this header: logical pages, and leaves and nodes, that lie elsewhere now.
    pub(crate) fn update(
        &mut self,
        header: &Header,
        entries: &[(usize, Entry)],
        leaves: &[(usize, Entry)],
        nodes: &[(usize, Entry)],
    ) {
        let places: std::collections::HashMap<usize, Entry> = leaves.iter().copied().collect();
        for of_leaf in entries.chunk_by(|a, b| a.0 / ENTRIES_PER_LEAF == b.0 / ENTRIES_PER_LEAF) {
            let at = of_leaf[0].0 / ENTRIES_PER_LEAF;
            let mut leaf = self.read_leaf(at as u64);
            of_leaf.iter().for_each(|(page, entry)| leaf[page % ENTRIES_PER_LEAF] = *entry);
            self.set_leaf(at as u64, places.get(&at).copied().unwrap_or_default(), leaf);
        }
        nodes.iter().for_each(|(node, entry)| self.root[*node] = *entry);
        self.header = header.clone();
    }

    /// Numbers of the leaves that lie elsewhere in the state whose header and root these are, and where. Nodes that differ are read; `spend` is told of each before.
    pub(crate) fn leaves_to(
        &self,
        source: &dyn Source,
        header: &Header,
        root: &[Entry],
        mut spend: impl FnMut(u64) -> Result<(), LayoutError>,
    ) -> Result<Vec<(u64, Entry)>, LayoutError> {
        let differing =
            (0u64..).zip(root.iter().zip(&self.root)).filter(|(_, (theirs, ours))| theirs != ours);
        if !self.shape.has_nodes() {
            return Ok(differing.map(|(leaf, (theirs, _))| (leaf, *theirs)).collect());
        }
        let mut leaves = Vec::new();
        for (i, (here, _)) in differing {
            if here.is_present() {
                spend(i)?;
            }
            let theirs = read_node(source, header, i, *here)?;
            let pairs = (i * PER_LEAF..).zip(theirs.iter().zip(self.node_entries(i)));
            leaves.extend(pairs.filter(|(_, (a, b))| *a != b).map(|(leaf, (a, _))| (leaf, *a)));
        }
        Ok(leaves)
    }

    /// Logical pages whose entries are others in `other`, and their entries there. All of both was read.
    pub(crate) fn differing(&self, other: &Self) -> Vec<(usize, Entry)> {
        let mut differing = Vec::new();
        for node in 0..self.nodes.len() as u64 {
            let (ours, theirs) = (self.node_entries(node), other.node_entries(node));
            let pairs = (node * PER_LEAF..).zip(ours.iter().zip(&theirs));
            for (leaf, _) in pairs.filter(|(_, (a, b))| a != b) {
                let (ours, theirs) = (self.read_leaf(leaf), other.read_leaf(leaf));
                let pairs = (leaf as usize * ENTRIES_PER_LEAF..).zip(ours.iter().zip(&theirs));
                differing.extend(pairs.filter(|(_, (a, b))| a != b).map(|(page, (_, b))| (page, *b)));
            }
        }
        differing
    }
}
