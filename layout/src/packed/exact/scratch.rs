//! What a thread keeps from tile to tile. Cost: about half a megabyte.

use crate::packed::plane::Lattices;
use crate::packed::walk::MOST;

/// An error or radius that the tile does not give, or that says nothing of others. No code is so large.
pub(super) const UNKNOWN: u32 = u32::MAX;

/// What a thread keeps from tile to tile. Flat rows have room for the vertices of an octave, whites first, then those on edges that run east, then the others.
#[derive(Debug)]
pub(crate) struct Scratch {
    pub(super) heights: Lattices<f64>,
    pub(super) errors: Lattices<u32>,
    pub(super) radii: Lattices<u32>,
    pub(super) kinds: Vec<u8>,
    /// Heights as bits and as numbers.
    pub(super) flat_heights: Vec<u64>,
    pub(super) values: Vec<f64>,
    pub(super) flat_errors: Vec<u32>,
    pub(super) flat_radii: Vec<u32>,
    /// What is expected of those that are coded, and what is coded.
    pub(super) expected: Vec<u32>,
    pub(super) is_folded: Vec<bool>,
    pub(super) numbers: Vec<u64>,
    pub(super) contexts: Vec<u8>,
    pub(super) heads: Vec<u16>,
    pub(super) chosen: Vec<u32>,
    pub(super) predicted: Vec<f64>,
    pub(super) uneven: Vec<f64>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            heights: Lattices::default(),
            errors: Lattices::default(),
            radii: Lattices::default(),
            kinds: vec![0; MOST],
            flat_heights: vec![0; MOST],
            values: vec![0.0; MOST],
            flat_errors: vec![0; MOST],
            flat_radii: vec![0; MOST],
            expected: vec![0; MOST],
            is_folded: vec![false; MOST],
            numbers: vec![0; MOST],
            contexts: vec![0; MOST],
            heads: vec![0; MOST],
            chosen: Vec::with_capacity(MOST),
            predicted: vec![0.0; MOST],
            uneven: vec![0.0; MOST],
        }
    }
}
