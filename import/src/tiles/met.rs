//! Where a pyramid has something to read: squares of tiles, of which those without any tile are passed over as a whole.
//!
//! A missing tile counts where a coarser one stands in for it. Squares are as large as it takes for their number to stay small, whatever the pyramid says of itself. Memory: 20 bytes a square, 40 MB at most. Cost: a
//! look at the entry of each tile of a few zooms.

use super::Pyramid;
use super::grid::{Span, Tile};
use crate::cells::{Cells, each_block_met};
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;

/// Binary logarithm of the side of a square in tiles, at least.
const LEAST_LOG2: u32 = 3;
/// Squares, at most.
const MOST_SQUARES: u64 = 1 << 21;
/// Memory that a square takes, with what a table of them leaves empty.
const SQUARE_BYTES: u64 = 20;

/// Squares that cover a grid of tiles.
fn squares(sides: [u32; 2], log2: u32) -> u64 {
    sides.map(|side| u64::from(side >> log2) + 1).iter().product()
}

/// Binary logarithm of the side of a square.
fn side_log2(sides: [u32; 2]) -> u32 {
    (LEAST_LOG2..32).find(|log2| squares(sides, *log2) <= MOST_SQUARES).unwrap_or(31)
}

impl Pyramid {
    /// Memory that knowing the squares takes.
    pub(super) fn met_bytes(&self) -> u64 {
        let sides = self.plan.span.sides().map(|side| side as u32);
        squares(sides, side_log2(sides)) * SQUARE_BYTES
    }

    /// Calls `make` with every tile of the squares that have any, on all threads, each with a state of its own; and `pass` with the texels of the others.
    pub(super) fn each_tile_met<S: Default>(
        &self,
        pass: impl Fn(Window) -> Result<(), LayoutError>,
        make: impl Fn(&mut S, Tile) -> Result<(), LayoutError> + Sync,
    ) -> Result<(), LayoutError> {
        let span = self.plan.span;
        let zoom = self.plan.zoom;
        // Tiles of a grid that is no larger than a terrain, nor are their numbers.
        let sides = span.sides().map(|side| side as u32);
        let met = self.met(sides)?;
        let tile = |window: Window| Tile { zoom, x: span.x[0] + window.col, y: span.y[0] + window.row };
        let texels = |window: Window| {
            let last =
                Window { col: window.col + window.width - 1, row: window.row + window.height - 1, ..window };
            let [from, to] = [window, last].map(|window| self.part(tile(window)));
            let size = [0, 1].map(|i| to.to[i] + to.size[i] - from.to[i]);
            Window { col: from.to[0], row: from.to[1], width: size[0], height: size[1] }
        };
        each_block_met(
            sides,
            [1, 1],
            met.side(),
            |window| met.touch([window.col.into(), window.row.into()], [window.width, window.height]),
            |window| pass(texels(window)),
            S::default,
            |state, window| make(state, tile(window)),
        )
    }

    /// The squares of a grid of tiles that have any.
    fn met(&self, sides: [u32; 2]) -> Result<Cells, LayoutError> {
        let plan = &self.plan;
        let mut met = Cells::of(side_log2(sides));
        for zoom in plan.above.iter().copied().chain([plan.zoom]) {
            let levels = plan.zoom - zoom;
            let within = Span { x: plan.span.x.map(|x| x >> levels), y: plan.span.y.map(|y| y >> levels) };
            self.archive.each_span(zoom, within, &mut |found: Span| {
                let below =
                    |[first, last]: [u32; 2]| [first << levels, (last << levels) + ((1 << levels) - 1)];
                let under = Span { x: below(found.x), y: below(found.y) };
                if let Some(Span { x, y }) = plan.span.shared(under) {
                    let [col, row] = [plan.span.x[0], plan.span.y[0]];
                    met.add([x[0] - col, y[0] - row], [x[1] - col + 1, y[1] - row + 1]);
                }
            })?;
        }
        Ok(met)
    }
}
