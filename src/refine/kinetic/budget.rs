//! How much a frame may do: a number of tests, a time, or both.

use std::time::{Duration, Instant};

/// Bounds of a frame's work; none by default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Budget {
    /// Vertex tests of one frame. The last split may go beyond it by the tests of its children, at most 4.
    pub tests: Option<u64>,
    /// Time from the first test of one frame to its last split. Exceeded by the tests of 256 vertices at most and by the merges, which always go
    /// through. Results then depend on the machine's speed, as nothing else here does.
    pub time: Option<Duration>,
}

/// Splits and tests between two looks at the clock.
const STRIDE: u32 = 32;

/// What is left of a frame's budget.
#[derive(Debug)]
pub(super) struct Allowance {
    tests: u64,
    until: Option<Instant>,
    stride: u32,
    over: bool,
}

impl Allowance {
    pub(super) fn new(budget: Budget) -> Self {
        let until = budget.time.map(|time| Instant::now() + time);
        Self { tests: budget.tests.unwrap_or(u64::MAX), until, stride: 0, over: false }
    }

    /// How many of `wanted` tests may be made; takes them off.
    pub(super) fn tests(&mut self, wanted: usize) -> usize {
        let allowed =
            if self.is_over() { 0 } else { wanted.min(usize::try_from(self.tests).unwrap_or(usize::MAX)) };
        self.tests -= allowed as u64;
        allowed
    }

    /// Whether one more vertex may be split; takes off the tests of its children.
    #[inline]
    pub(super) fn split(&mut self) -> bool {
        if self.tests == 0 || self.until.is_some() && self.is_over_by_now() {
            return false;
        }
        if self.tests != u64::MAX {
            self.tests = self.tests.saturating_sub(2);
        }
        true
    }

    fn is_over_by_now(&mut self) -> bool {
        self.stride += 1;
        if self.stride.is_multiple_of(STRIDE) { self.is_over() } else { self.over }
    }

    fn is_over(&mut self) -> bool {
        self.over = self.over || self.until.is_some_and(|until| Instant::now() >= until);
        self.over
    }
}
