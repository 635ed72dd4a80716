//! Visible ranges, merged where they touch, and drawn by one indirect call where that pays.

use std::ops::Range;

use crate::error::{RenderError, Result};

/// The ranges of one frame.
#[derive(Debug, Default)]
pub(crate) struct DrawList {
    /// Ascending, disjoint, not touching.
    pub ranges: Vec<Range<u32>>,
    /// How often they were replaced.
    pub number: u64,
}

impl DrawList {
    /// Replaces the ranges.
    pub(crate) fn set(&mut self, draws: &[Range<u32>], uploaded: u32) -> Result<()> {
        if let Some(bad) = draws.iter().find(|r| r.end > uploaded && r.start < r.end) {
            return Err(RenderError::RangeOutside { start: bad.start, end: bad.end, uploaded });
        }
        self.number += 1;
        self.ranges.clear();
        self.ranges.extend(draws.iter().filter(|r| r.start < r.end).cloned());
        if !self.ranges.is_sorted_by_key(|r| r.start) {
            self.ranges.sort_unstable_by_key(|r| (r.start, r.end));
        }
        // dedup_by hands the later element first.
        self.ranges.dedup_by(|later, kept| {
            let touches = later.start <= kept.end;
            if touches {
                kept.end = kept.end.max(later.end);
            }
            touches
        });
        Ok(())
    }

    /// Forgets all ranges.
    pub(crate) fn clear(&mut self) {
        self.number += 1;
        self.ranges.clear();
    }

    /// Triangle slots in all ranges.
    pub(crate) fn triangles(&self) -> u64 {
        self.ranges.iter().map(|r| u64::from(r.end - r.start)).sum()
    }

    /// Arguments of indexed indirect draws, five words each.
    pub(crate) fn indirect_words(&self) -> Vec<u32> {
        self.ranges.iter().flat_map(|r| [3 * (r.end - r.start), 1, 3 * r.start, 0, 0]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_touch_or_overlap_become_one() {
        let mut list = DrawList::default();
        list.set(&[8..9, 0..2, 2..4, 3..5, 7..7, 8..8], 9).unwrap();
        assert_eq!(list.ranges, [0..5, 8..9]);
        assert_eq!(list.triangles(), 6);
        assert_eq!(list.indirect_words(), [15, 1, 0, 0, 0, 3, 1, 24, 0, 0]);
        assert!(matches!(list.set(&[3..10, 0..1], 9), Err(RenderError::RangeOutside { end: 10, .. })));
        assert_eq!(list.ranges, [0..5, 8..9], "a refused list changes nothing");
    }
}
