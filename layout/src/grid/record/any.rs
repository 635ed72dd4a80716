//! The codec of a file, of whichever kind. Compact and fine records have one codec with two sets of tables.

use super::{Compact, Exact8, Exact16, RecordCodec, RecordKind, RecordScale, Vertex};
use crate::grid::Grid;

/// One of the three codecs. A terrain has one, boxed: their sizes do not matter.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "a terrain has one, in a box")]
pub(crate) enum AnyCodec {
    Compact(Compact),
    Exact8(Exact8),
    Exact16(Exact16),
}

impl AnyCodec {
    pub(crate) fn new(kind: RecordKind, grid: &Grid, scale: &RecordScale) -> Self {
        match kind {
            RecordKind::Compact | RecordKind::Fine => Self::Compact(Compact::new(grid, scale)),
            RecordKind::Exact8 => Self::Exact8(Exact8::new(grid, scale)),
            RecordKind::Exact16 => Self::Exact16(Exact16::new(grid, scale)),
        }
    }

    /// The vertex whose record begins `bytes`, of a level (0 for corners).
    pub(crate) fn decode(&self, bytes: &[u8], level: u32) -> Vertex {
        match self {
            Self::Compact(codec) => codec.decode(Compact::read(bytes), level),
            Self::Exact8(codec) => codec.decode(Exact8::read(bytes), level),
            Self::Exact16(codec) => codec.decode(Exact16::read(bytes), level),
        }
    }
}
