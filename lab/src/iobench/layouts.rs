//! Where a vertex's record lies in a file, under four layouts of the same terrain.
//!
//! | layout | record | order |
//! |---|---|---|
//! | `row` | 20 bytes | row by row over the square of 2^k + 1 samples a side |
//! | `tiled` | 20 bytes | Z-order over the square of 2^k: every aligned tile of 2^i samples a side is contiguous, one of 32 is five pages; the east column and the north row follow |
//! | `soar` | 20 bytes | the interleaved quadtrees of Lindstrom and Pascucci, ghosts included |
//! | `ours` | the file's own | the terrain file as it is, by its page directory |
//!
//! 20 bytes are SOAR's record: x, y, z, error and radius in single precision. In `row` and `tiled`, which are not ordered by level, only the place
//! differs. A 20-byte record may lie across two lines or pages and then touches both. Invariant: no two grid points share a byte, but for those whose page is
//! absent from the terrain file, which all read the inert page. Cost: a few shifts a record.

use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::file::header::INERT_PAGE;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{point_of, slot_count, spread};
use terrasoar_layout::read::terrain::Terrain;

/// Bytes of a record that holds what SOAR's does.
pub(crate) const SOAR_RECORD_BYTES: u64 = 20;

/// Bytes a cache line.
pub const LINE_BYTES: u64 = 64;

/// Bytes of the larger unit that counts are given in: what one read of a disk may as well bring.
pub(crate) const UNIT_BYTES: u64 = 65_536;

/// The layouts, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LayoutKind {
    /// Row-major.
    Row,
    /// Tiles in Z-order.
    Tiled,
    /// SOAR's interleaved quadtrees.
    Soar,
    /// The terrain file.
    Ours,
}

impl LayoutKind {
    /// All layouts.
    pub const ALL: [Self; 4] = [Self::Row, Self::Tiled, Self::Soar, Self::Ours];

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Row => "row",
            Self::Tiled => "tiled",
            Self::Soar => "soar",
            Self::Ours => "ours",
        }
    }
}

/// A layout of one terrain.
#[derive(Debug, Clone, Copy)]
pub struct Layout<'t> {
    kind: LayoutKind,
    terrain: &'t Terrain,
    k: u32,
    record_bytes: u64,
    /// Of the terrain file.
    records_per_page: u64,
}

impl<'t> Layout<'t> {
    /// The layout `kind` of `terrain`.
    pub fn new(kind: LayoutKind, terrain: &'t Terrain) -> Self {
        let header = terrain.header();
        let record_bytes = match kind {
            LayoutKind::Ours => header.record_kind.bytes() as u64,
            _ => SOAR_RECORD_BYTES,
        };
        Self {
            kind,
            terrain,
            k: terrain.grid().k(),
            record_bytes,
            records_per_page: header.records_per_page(),
        }
    }

    /// Which layout it is.
    pub fn kind(&self) -> LayoutKind {
        self.kind
    }

    /// Bytes a record.
    pub fn record_bytes(&self) -> u64 {
        self.record_bytes
    }

    /// Bytes of a file in this layout.
    pub fn file_bytes(&self) -> u64 {
        let side = (1 << self.k) + 1;
        match self.kind {
            LayoutKind::Row | LayoutKind::Tiled => side * side * self.record_bytes,
            LayoutKind::Soar => slot_count(self.k) * self.record_bytes,
            LayoutKind::Ours => self.terrain.header().file_bytes,
        }
    }

    /// First byte of the record at `slot`; `None` for ghosts and slots past the end.
    pub fn offset(&self, slot: u64) -> Option<u64> {
        let record = match self.kind {
            LayoutKind::Row => row_index(self.k, point_of(self.k, slot)?),
            LayoutKind::Tiled => tiled_index(self.k, point_of(self.k, slot)?),
            LayoutKind::Soar => point_of(self.k, slot).map(|_| slot)?,
            LayoutKind::Ours => return self.offset_in_file(slot),
        };
        Some(record * self.record_bytes)
    }

    fn offset_in_file(&self, slot: u64) -> Option<u64> {
        let page = slot / self.records_per_page;
        // A directory leaf that cannot be read has no records whose place could be told.
        let entry = self.terrain.entry(page).ok().filter(|_| page < self.terrain.page_count())?;
        let page = if entry.is_present() { entry.page } else { INERT_PAGE };
        Some(u64::from(page) * PAGE_BYTES as u64 + slot % self.records_per_page * self.record_bytes)
    }

    /// Cache lines of the record at `slot`, first and last: the same one or neighbours.
    pub fn lines(&self, slot: u64) -> Option<[u64; 2]> {
        let first = self.offset(slot)?;
        Some([first, first + self.record_bytes - 1].map(|byte| byte / LINE_BYTES))
    }
}

/// Row-major index.
fn row_index(k: u32, p: GridPoint) -> u64 {
    u64::from(p.y()) * ((1 << k) + 1) + u64::from(p.x())
}

/// Z-order index, the last column and the last row aside.
fn tiled_index(k: u32, p: GridPoint) -> u64 {
    let n = 1u64 << k;
    let (x, y) = (u64::from(p.x()), u64::from(p.y()));
    if x == n {
        n * n + y
    } else if y == n {
        n * n + n + 1 + x
    } else {
        spread(x) | spread(y) << 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use terrasoar::testing::{padded_terrain, square_terrain};
    use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, child_slots, corners, slot_of};

    fn points(k: u32) -> impl Iterator<Item = GridPoint> {
        let n = 1 << k;
        (0..=n).flat_map(move |y| (0..=n).map(move |x| GridPoint::new(x, y)))
    }

    #[test]
    fn no_two_points_share_a_record_and_all_lie_in_the_file() {
        for terrain in [square_terrain(6), padded_terrain()] {
            let k = terrain.grid().k();
            for kind in LayoutKind::ALL {
                let layout = Layout::new(kind, &terrain);
                let mut seen = HashSet::new();
                for p in points(k) {
                    let slot = slot_of(k, p);
                    let page = slot / terrain.header().records_per_page();
                    if kind == LayoutKind::Ours && !terrain.entry(page).unwrap().is_present() {
                        assert!(terrain.grid().is_padding(p));
                        continue;
                    }
                    let at = layout.offset(slot).unwrap();
                    assert!(at + layout.record_bytes() <= layout.file_bytes(), "{kind:?} {p:?}");
                    assert!(at.is_multiple_of(layout.record_bytes()) && seen.insert(at), "{kind:?} {p:?}");
                }
            }
        }
    }

    #[test]
    fn row_and_tiled_files_have_no_gap() {
        let k = 5;
        for index in [row_index, tiled_index] {
            let mut all: Vec<u64> = points(k).map(|p| index(k, p)).collect();
            all.sort_unstable();
            assert!(all.iter().copied().eq(0..33 * 33));
        }
    }

    #[test]
    fn an_aligned_tile_is_contiguous() {
        let k = 7;
        for (tile_x, tile_y) in [(0, 0), (1, 0), (2, 3), (3, 3)] {
            let tile = (0..32u32 * 32).map(|i| GridPoint::new(tile_x * 32 + i % 32, tile_y * 32 + i / 32));
            let mut indices: Vec<u64> = tile.map(|p| tiled_index(k, p)).collect();
            indices.sort_unstable();
            assert!(indices[0].is_multiple_of(1024));
            assert!(indices.windows(2).all(|w| w[1] == w[0] + 1));
        }
    }

    /// The walk by slots meets, triangle by triangle, the vertices that coordinates name, where the layouts have them.
    #[test]
    fn the_walk_by_slots_agrees_with_the_layout_and_the_directory() {
        fn walk(
            check: &mut dyn FnMut(u64, GridPoint),
            level: u32,
            [i, j]: [u64; 2],
            [a, b, d]: [GridPoint; 3],
        ) {
            let v = b.midpoint(d);
            check(j, v);
            if level > 0 {
                let [left, right] = child_slots(i, j);
                walk(check, level - 1, [j, left], [v, b, a]);
                walk(check, level - 1, [j, right], [v, a, d]);
            }
        }
        let terrain = square_terrain(5);
        let (k, c) = (5, corners(5));
        let soar = Layout::new(LayoutKind::Soar, &terrain);
        let ours = Layout::new(LayoutKind::Ours, &terrain);
        let bytes = terrain.header().record_kind.bytes() as u64;
        let records = terrain.records().unwrap();
        let mut met = HashSet::new();
        for (split, [b, d]) in ROOTS {
            let root = [GridPoint::new(16, 16), c[b], c[d]];
            let mut check = |slot: u64, p: GridPoint| {
                met.insert(p);
                assert_eq!(soar.offset(slot_of(k, p)), Some(SOAR_RECORD_BYTES * slot));
                let at = ours.offset(slot).unwrap();
                let entry = terrain.entry(slot * bytes / PAGE_BYTES as u64).unwrap();
                assert_eq!(at / PAGE_BYTES as u64, u64::from(entry.page));
                // The bytes there are the vertex's record.
                terrasoar_layout::with_records!(&records, records => {
                    let [x, y] = [p.x(), p.y()].map(f64::from);
                    let [dx, dy] = terrain.grid().spacing_m();
                    let height_m = terrain.height_m(x * dx, y * dy).unwrap().unwrap();
                    assert_eq!(records.vertex_at(p).height_m, height_m);
                });
            };
            walk(&mut check, 2 * k - 2, [CENTRE_SLOT, split], root);
        }
        assert_eq!(met.len(), 33 * 33 - 5, "all but the corners and the centre");
        assert_eq!(soar.offset(slot_count(k)), None);
        assert_eq!(ours.offset(u64::MAX), None);
    }

    #[test]
    fn ghosts_have_no_place() {
        let terrain = square_terrain(4);
        let ghost = (0..slot_count(4)).find(|slot| point_of(4, *slot).is_none()).unwrap();
        for kind in [LayoutKind::Row, LayoutKind::Tiled, LayoutKind::Soar] {
            assert_eq!(Layout::new(kind, &terrain).lines(ghost), None);
        }
    }

    #[test]
    fn a_record_across_a_line_touches_both() {
        let terrain = square_terrain(4);
        let soar = Layout::new(LayoutKind::Soar, &terrain);
        assert_eq!(soar.lines(3), Some([0, 1]), "bytes 60 to 79");
        assert_eq!(soar.lines(4), Some([1, 1]));
    }
}
