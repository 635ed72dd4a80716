//! The mesh itself: the bin-tree array, its places in clusters, vertices, splitting and merging.

pub(crate) mod bounds;
pub(crate) mod clusters;
pub(crate) mod compact;
pub(crate) mod labels;
pub(crate) mod nodes;
pub(crate) mod patch;
pub(crate) mod rings;
pub(crate) mod tree;
pub(crate) mod vertices;
