//! A patch as words for the device: slots ascending, each once, so that no two threads of the scatter write to one place
//! and neighbours in memory are neighbours in the list.
//!
//! Cost: sorting the patch, unless it came sorted. Keeps its arrays.

use terrasoar::refine::kinetic::MeshVertex;

/// Words of one vertex entry: slot and content.
pub(super) const VERTEX_WORDS: usize = 9;
/// Words of one triangle entry.
pub(super) const TRIANGLE_WORDS: usize = 4;

/// Turns patches into words.
#[derive(Debug, Default)]
pub(super) struct PatchPacker {
    order: Vec<u32>,
    pub words: Vec<u32>,
}

impl PatchPacker {
    /// Fills `words` with the entries of both kinds, vertices first. Returns how many of each and one past the
    /// highest slot of each (0 for none).
    pub(super) fn pack(
        &mut self,
        vertices: &[(u32, MeshVertex)],
        triangles: &[(u32, [u32; 3])],
    ) -> ([u32; 2], [u64; 2]) {
        self.words.clear();
        let vertex_count = sort_slots(&mut self.order, vertices);
        for &i in &self.order {
            let (slot, vertex) = &vertices[i as usize];
            self.words.extend_from_slice(&vertex_words(*slot, vertex));
        }
        let vertex_end = self.order.last().map_or(0, |&i| u64::from(vertices[i as usize].0) + 1);
        let triangle_count = sort_slots(&mut self.order, triangles);
        for &i in &self.order {
            let (slot, corners) = &triangles[i as usize];
            self.words.push(*slot);
            self.words.extend_from_slice(corners);
        }
        let triangle_end = self.order.last().map_or(0, |&i| u64::from(triangles[i as usize].0) + 1);
        ([vertex_count, triangle_count], [vertex_end, triangle_end])
    }
}

/// A vertex as the shaders read it, behind its slot.
fn vertex_words(slot: u32, vertex: &MeshVertex) -> [u32; VERTEX_WORDS] {
    let MeshVertex { x, y, height_m, error_m, radius_m, ends, flags } = *vertex;
    [slot, x, y, height_m.to_bits(), error_m.to_bits(), radius_m.to_bits(), ends[0], ends[1], flags]
}

/// Positions of the entries by ascending slot, of equal slots the last.
fn sort_slots<T>(order: &mut Vec<u32>, entries: &[(u32, T)]) -> u32 {
    order.clear();
    order.extend(0..entries.len() as u32);
    if !entries.is_sorted_by(|a, b| a.0 < b.0) {
        let slot = |i: u32| entries[i as usize].0;
        order.sort_unstable_by_key(|&i| (slot(i), std::cmp::Reverse(i)));
        order.dedup_by_key(|i| slot(*i));
    }
    order.len() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_entries_win_and_slots_ascend() {
        let mut packer = PatchPacker::default();
        let (counts, ends) =
            packer.pack(&[], &[(7, [1, 1, 1]), (2, [2, 2, 2]), (7, [3, 3, 3]), (0, [4, 4, 4])]);
        assert_eq!((counts, ends), ([0, 3], [0, 8]));
        assert_eq!(packer.words, [0, 4, 4, 4, 2, 2, 2, 2, 7, 3, 3, 3]);
    }

    #[test]
    fn words_are_the_vertex() {
        let vertex =
            MeshVertex { x: 1, y: 2, height_m: 3.0, error_m: 4.0, radius_m: 5.0, ends: [6, 7], flags: 8 };
        let mut packer = PatchPacker::default();
        let (counts, ends) = packer.pack(&[(10, vertex)], &[]);
        assert_eq!((counts, ends), ([1, 0], [11, 0]));
        assert_eq!(packer.words.len(), VERTEX_WORDS);
        assert_eq!(packer.words, [10, 1, 2, 3f32.to_bits(), 4f32.to_bits(), 5f32.to_bits(), 6, 7, 8]);
    }
}
