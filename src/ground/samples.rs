//! Square tiles of heights, from which a renderer computes light: every n-th sample, taken from the records that are in memory.

use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::read::store::CompleteStore;

/// A square of samples at equal steps. It may reach beyond the data, whose nearest sample is taken there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HeightTile {
    /// Column and row of the south-west sample; below 0 beyond the data.
    pub south_west: [i64; 2],
    /// Samples from one to the next; at least 1.
    pub step: u32,
    /// Samples a side.
    pub side: u32,
}

impl HeightTile {
    /// How many samples it has.
    pub fn count(self) -> usize {
        self.side as usize * self.side as usize
    }

    /// Columns (`axis` 0) or rows (1) of its samples in a terrain of so many samples, from the south-west.
    pub fn lines(self, samples: [u32; 2], axis: usize) -> impl Iterator<Item = u32> + Clone {
        let last = i64::from(samples[axis]) - 1;
        let at = move |i: u32| self.south_west[axis] + i64::from(i) * i64::from(self.step);
        (0..self.side).map(move |i| at(i).clamp(0, last) as u32)
    }

    /// Its grid points in a terrain of so many samples, rows from the south, each from the west.
    pub(super) fn points(self, samples: [u32; 2]) -> impl Iterator<Item = GridPoint> {
        self.lines(samples, 1).flat_map(move |y| self.lines(samples, 0).map(move |x| GridPoint::new(x, y)))
    }
}

/// Heights of a tile of records that are all at hand.
pub(super) fn tile_of(records: &impl CompleteStore, tile: HeightTile, heights_m: &mut Vec<f32>) {
    heights_m.clear();
    heights_m.reserve(tile.count());
    heights_m.extend(tile.points(records.grid().samples()).map(|point| shown_m(&records.vertex_at(point))));
}

/// Height of a sample as tiles have it.
pub(super) fn shown_m(vertex: &Vertex) -> f32 {
    if vertex.class.is_void() { f32::NAN } else { vertex.height_m as f32 }
}
