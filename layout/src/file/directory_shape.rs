//! How many pages a directory is made up of, by the square that it is of (FORMAT.md, section 5).

/// Entries a leaf page, or a node page.
const PER_PAGE: u64 = 256;
/// Least `k` of squares whose directory has nodes between root and leaves.
const LEAST_K_WITH_NODES: u32 = 18;

/// How a directory is made up: a root that leads to leaves, or to nodes that lead to them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DirectoryShape {
    record_pages: u64,
    has_nodes: bool,
}

impl DirectoryShape {
    /// Of a square of 2^k steps a side with so many logical pages.
    pub(crate) const fn new(k: u32, record_pages: u64) -> Self {
        Self { record_pages, has_nodes: k >= LEAST_K_WITH_NODES }
    }

    /// Whether there are nodes.
    pub(crate) const fn has_nodes(&self) -> bool {
        self.has_nodes
    }

    /// Leaves, absent ones included.
    pub(crate) const fn leaves(&self) -> u64 {
        self.record_pages.div_ceil(PER_PAGE)
    }

    /// Groups of as many leaves as a node has, whether they are nodes or not.
    pub(crate) const fn nodes(&self) -> u64 {
        self.leaves().div_ceil(PER_PAGE)
    }

    /// Entries of the root.
    pub(crate) const fn root_entries(&self) -> u64 {
        if self.has_nodes { self.nodes() } else { self.leaves() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::entries::ENTRIES_PER_LEAF;
    use crate::grid::order::slot_count;

    /// Roots stay small, whatever the side.
    #[test]
    fn a_root_has_few_entries() {
        assert_eq!(PER_PAGE, ENTRIES_PER_LEAF as u64);
        for (k, per_page, entries) in [
            (10, 1024, 7),
            (17, 1024, 109_227),
            (17, 256, 436_907),
            (18, 1024, 1707),
            (20, 1024, 27_307),
            (20, 256, 109_227),
        ] {
            let shape = DirectoryShape::new(k, slot_count(k).div_ceil(per_page));
            assert_eq!((shape.root_entries(), shape.has_nodes()), (entries, k > 17), "{k}");
        }
    }
}
