//! The triangles of a frame as sets, to be compared with those of other frames and engines.

use crate::mesh::{TriangleKey, is_drawn, parent, with_apex_first};
use crate::refine::Engine;
use std::collections::HashSet;
use std::hash::{BuildHasherDefault, Hasher};
use terrasoar_layout::read::store::RecordStore;

/// How many of sorted `a` are not in sorted `b`.
pub(super) fn not_in(a: &[TriangleKey], b: &[TriangleKey]) -> u64 {
    let mut rest = b;
    let mut count = 0;
    for key in a {
        let skip = rest.iter().position(|k| k >= key).unwrap_or(rest.len());
        rest = &rest[skip..];
        count += u64::from(rest.first() != Some(key));
    }
    count
}

/// Drawn and split triangles of a frame, sorted.
#[derive(Debug, Default)]
pub(super) struct FrameSets {
    pub(super) triangles: Vec<TriangleKey>,
    pub(super) split: Vec<TriangleKey>,
}

/// Hands on the hash that a key has of its own.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.0 = self.0.rotate_left(8) ^ u64::from(*b));
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = value.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    }
}

impl FrameSets {
    /// Those of an engine's mesh. Which are drawn does not change with edits, so `records` may be those of before.
    pub(super) fn of(engine: &impl Engine, records: &impl RecordStore) -> Self {
        let mut triangles = Vec::new();
        // What is split are the ancestors of what is not.
        let mut split: HashSet<TriangleKey, BuildHasherDefault<KeyHasher>> = HashSet::default();
        engine.for_each_triangle(&mut |t| {
            if is_drawn(records, t) {
                triangles.push(TriangleKey::of(t));
            }
            let mut above = parent(records.grid(), with_apex_first(t));
            while let Some([apex, b, d]) = above
                && split.insert(TriangleKey::new(apex, b, d))
            {
                above = parent(records.grid(), [apex, b, d]);
            }
        });
        let mut split: Vec<TriangleKey> = split.into_iter().collect();
        triangles.sort_unstable();
        split.sort_unstable();
        Self { triangles, split }
    }

    pub(super) fn hash(&self) -> u64 {
        self.triangles.iter().fold(self.triangles.len() as u64, |sum, key| sum.wrapping_add(key.hash()))
    }
}
