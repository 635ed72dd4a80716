//! What changed on the ground when pages got other contents, found by comparing records.

use super::Core;
use crate::edit::{Changes, SampleRect};
use crate::file::bytes::Page;
use crate::grid::order::point_of;
use crate::grid::record::RecordCodec;
use crate::grid::{Grid, GridPoint};
use crate::read::store::records_per_page;
use std::collections::BTreeMap;

impl<C: RecordCodec> Core<C> {
    pub(crate) fn roll_back(&mut self) -> Changes {
        let until_now = self.pages.roll_back();
        let mut changes = Changes::default();
        for (logical, old) in until_now {
            self.note_differences(logical, &old, &mut changes);
        }
        self.set_range(self.committed);
        self.end_replacing(changes)
    }

    /// Notes the vertices of a page whose records are others than they were in `old`.
    pub(super) fn note_differences(&self, logical: u64, old: &Page, changes: &mut Changes) {
        let Some(new) = self.pages.edited(logical) else { return };
        let (k, per_page) = (self.rules.grid.k(), records_per_page::<C>());
        let before = changes.vertices.len();
        let records = old.chunks_exact(C::BYTES).zip(new.chunks_exact(C::BYTES));
        for (i, _) in records.enumerate().filter(|(_, (old, new))| old != new) {
            changes.vertices.extend(point_of(k, logical * per_page + i as u64));
        }
        if changes.vertices.len() > before {
            changes.pages.push(logical);
        }
    }

    /// Where heights changed is not kept apart from the records that did.
    pub(super) fn end_replacing(&self, mut changes: Changes) -> Changes {
        changes.pages.sort_unstable();
        changes.samples = rects_of(&self.rules.grid, &changes.vertices);
        changes
    }
}

/// Rectangles of samples that hold all of `vertices` that are samples of the finest three levels' cells: neighbours share one.
fn rects_of(grid: &Grid, vertices: &[GridPoint]) -> Vec<SampleRect> {
    /// Samples a side of the squares that changed samples are gathered in.
    const SIDE: u32 = 64;
    let mut squares: BTreeMap<(u32, u32), SampleRect> = BTreeMap::new();
    for p in vertices.iter().filter(|p| !grid.is_padding(**p)) {
        let (x, y) = (p.x(), p.y());
        let rect = squares.entry((y / SIDE, x / SIDE)).or_insert(SampleRect {
            west: x,
            south: y,
            east: x,
            north: y,
        });
        *rect = SampleRect {
            west: rect.west.min(x),
            south: rect.south.min(y),
            east: rect.east.max(x),
            north: rect.north.max(y),
        };
    }
    squares.into_values().collect()
}
