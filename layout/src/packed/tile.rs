//! A tile as its vertices' records in rows.

use super::shape::TileShape;

/// The record of an inert vertex.
pub(crate) const INERT: u32 = 0xff00_0000;

/// Records of a tile, down to some octave. Those that the tile does not give are inert ones, or whatever else.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct TileRecords {
    /// The finest octave there is.
    pub(crate) finest: u32,
    side: usize,
    records: Vec<u32>,
}

impl TileRecords {
    /// All inert, down to octave `finest`, counted from the tile's own finest.
    pub(crate) fn inert(shape: &TileShape, finest: u32) -> Self {
        let finest = finest.min(shape.tile_log);
        let side = (1 << (shape.tile_log - finest)) + 1;
        Self { finest, side, records: vec![INERT; side * side] }
    }

    /// As [`TileRecords::inert`], of what `record` says of every vertex in steps of the tile.
    pub(crate) fn from_fn(shape: &TileShape, mut record: impl FnMut([u32; 2]) -> u32) -> Self {
        let side = (1 << shape.tile_log) + 1;
        let records = (0..side * side).map(|i| record([(i % side) as u32, (i / side) as u32])).collect();
        Self { finest: 0, side, records }
    }

    /// The record at a place in steps of the tile.
    #[inline(always)]
    pub(crate) fn at(&self, at: [u32; 2]) -> u32 {
        let [x, y] = at.map(|v| (v >> self.finest) as usize);
        self.records.get(y * self.side + x).copied().unwrap_or(INERT)
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, at: [u32; 2], record: u32) {
        let [x, y] = at.map(|v| (v >> self.finest) as usize);
        if let Some(place) = self.records.get_mut(y * self.side + x) {
            *place = record;
        }
    }

    /// Bytes it takes.
    pub(crate) fn bytes(&self) -> usize {
        4 * self.records.len() + size_of::<Self>()
    }

    /// Whether all records that a tile gives are inert ones.
    pub(crate) fn gives_nothing(&self, shape: &TileShape) -> bool {
        let last = 1 << shape.tile_log;
        let step_log = shape.delivered();
        let mut places = (0..=last).flat_map(|y| (0..=last).map(move |x: u32| [x, y]));
        places.all(|[x, y]| {
            let is_given = if x % last == 0 && y % last == 0 {
                shape.is_top
            } else {
                (x | y) % (1 << step_log) != 0
                    && (x < last || shape.is_last[0])
                    && (y < last || shape.is_last[1])
            };
            !is_given || self.at([x, y]) == INERT
        })
    }
}
