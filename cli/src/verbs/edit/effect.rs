//! What a script did to the ground, in words that its author knows: how much ground is another now, and by how much it was lowered and raised.
//!
//! Where edits overlap it is the end that counts. Only squares that some edit changed are compared. Cost: two reads of each of these; of scripts that reach more than [`MOST_SAMPLES`] nothing is measured.

use anyhow::Result;
use std::collections::BTreeSet;
use terrasoar_layout::edit::{Changes, Editor, SampleRect};

/// Samples along a square's side.
const SIDE: u32 = 64;
/// Most samples that are compared.
const MOST_SAMPLES: usize = 1 << 24;

/// Squares that edits changed.
#[derive(Debug, Default)]
pub(super) struct Touched {
    squares: BTreeSet<[u32; 2]>,
}

/// How ground differs from what it was.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Effect {
    pub(super) samples: u64,
    /// The largest lowering (negative) and raising in metres; 0 where there is none.
    pub(super) by_m: [f64; 2],
}

impl Touched {
    pub(super) fn note(&mut self, changes: &Changes) {
        for rect in &changes.samples {
            for row in rect.south / SIDE..=rect.north / SIDE {
                if self.squares.len() * (SIDE * SIDE) as usize > MOST_SAMPLES {
                    return;
                }
                self.squares.extend((rect.west / SIDE..=rect.east / SIDE).map(|column| [row, column]));
            }
        }
    }

    /// Compares the ground before and after; `None` if there is too much of it.
    pub(super) fn effect(&self, before: &mut Editor, after: &mut Editor) -> Result<Option<Effect>> {
        if self.squares.len() * (SIDE * SIDE) as usize > MOST_SAMPLES {
            return Ok(None);
        }
        let grid = *after.terrain().grid();
        let mut effect = Effect::default();
        for [row, column] in &self.squares {
            let (west, south) = (column * SIDE, row * SIDE);
            let rect = SampleRect { west, south, east: west + SIDE - 1, north: south + SIDE - 1 };
            let rect = rect.grown(0, &grid);
            let (old, new) = (before.heights(rect)?, after.heights(rect)?);
            for (old, new) in old.heights_m().iter().zip(new.heights_m()) {
                let by = new - old;
                // Voids stay voids.
                if by != 0.0 && !by.is_nan() {
                    effect.samples += 1;
                    effect.by_m = [effect.by_m[0].min(by), effect.by_m[1].max(by)];
                }
            }
        }
        Ok(Some(effect))
    }
}
