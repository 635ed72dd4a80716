//! One triangle strip through a conforming mesh, a vertex at a time.
//!
//! Based on: P. Lindstrom, V. Pascucci, "Visualization of Large Terrains Made Easy", IEEE Visualization 2001: vertices alternate in the parity of
//! their level; where two of the same parity meet, the second-last vertex again turns the strip.

use terrasoar_layout::grid::GridPoint;

/// A strip under construction, of whatever stands for a vertex.
#[derive(Debug)]
pub(super) struct StripBuilder<'s, T> {
    strip: &'s mut Vec<T>,
    last: [GridPoint; 2],
    parity: u32,
}

impl<'s, T: Copy> StripBuilder<'s, T> {
    /// Starts over in `strip` with the vertex `first`, at `at`, twice.
    pub(super) fn start(strip: &'s mut Vec<T>, at: GridPoint, first: T) -> Self {
        strip.clear();
        strip.extend([first, first]);
        Self { strip, last: [at; 2], parity: 1 }
    }

    /// Continues to the vertex at `at`, unless it is one of the last two.
    #[inline(always)]
    pub(super) fn append(&mut self, at: GridPoint, parity: u32, vertex: T) {
        if at == self.last[0] || at == self.last[1] {
            return;
        }
        if parity == self.parity {
            let turn = self.strip[self.strip.len() - 2];
            self.strip.push(turn);
            self.last = [self.last[1], self.last[0]];
        }
        self.strip.push(vertex);
        self.last = [self.last[1], at];
        self.parity = parity;
    }
}
