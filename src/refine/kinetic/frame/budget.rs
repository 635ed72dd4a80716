//! How much a frame may do: a number of tests, a time, or both.

use std::time::Duration;
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
use std::time::Instant;
#[cfg(all(target_family = "wasm", target_os = "unknown"))]
use web_time::Instant;

/// Bounds of a frame's work; none by default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Budget {
    /// Vertex tests of one frame. The last split may go beyond it by the tests of its children, at most 3.
    pub tests: Option<u64>,
    /// Time from the first test of one frame to its last split. Exceeded by no more than some 6,000 tests or 32 splits, and by the merges, which always go
    /// through. Results then depend on the machine's speed, as nothing else here does.
    pub time: Option<Duration>,
}

impl Budget {
    /// This budget with so many vertex tests a frame at most.
    pub fn tests(self, tests: u64) -> Self {
        Self { tests: Some(tests), ..self }
    }

    /// This budget with so much time a frame at most.
    pub fn time(self, time: Duration) -> Self {
        Self { time: Some(time), ..self }
    }
}

/// Splits between two looks at the clock.
const STRIDE: u32 = 32;
/// Splits whose children are tested before more are split, where time counts.
const ROUND: usize = 2048;
/// Tests between two looks at the clock.
const BATCH: usize = 256;

/// What is left of a frame's budget.
#[derive(Debug)]
pub(crate) struct Allowance {
    tests: u64,
    until: Option<Instant>,
    /// Tests kept for the children of splits that wait.
    kept: usize,
    stride: u32,
    /// Splits left in this round.
    round: usize,
    over: bool,
}

impl Allowance {
    pub(crate) fn new(budget: Budget) -> Self {
        let until = budget.time.map(|time| Instant::now() + time);
        let tests = budget.tests.unwrap_or(u64::MAX);
        let kept = budget.tests.map_or(0, |tests| usize::try_from(tests.div_ceil(2)).unwrap_or(usize::MAX));
        Self { tests, until, kept, stride: STRIDE - 1, round: 0, over: false }
    }

    /// How many of `wanted` tests may be made before asking again; takes them off. While splits wait, half is kept for them, lest tests alone use up every
    /// frame.
    pub(crate) fn tests(&mut self, wanted: usize, splits_wait: bool) -> usize {
        if self.is_over() {
            return 0;
        }
        let left = usize::try_from(self.tests).unwrap_or(usize::MAX);
        let most = if splits_wait { left.saturating_sub(self.kept) } else { left };
        let allowed = wanted.min(most).min(if self.until.is_some() { BATCH } else { usize::MAX });
        self.tests -= allowed as u64;
        allowed
    }

    /// Whether time counts.
    pub(crate) fn counts_time(&self) -> bool {
        self.until.is_some()
    }

    /// Begins a round of splits; their children are tested when it is over.
    pub(crate) fn start_round(&mut self) {
        self.round = if self.counts_time() { ROUND } else { usize::MAX };
    }

    /// Whether one more vertex may be split in this round.
    #[inline]
    pub(crate) fn split(&mut self) -> bool {
        self.tests > 0 && self.round > 0 && !(self.counts_time() && self.is_over_by_now())
    }

    /// Takes off a split and the tests that will be made of its children.
    #[inline]
    pub(crate) fn charge(&mut self, tests: usize) {
        self.tests = self.tests.saturating_sub(tests as u64);
        self.round = self.round.saturating_sub(1);
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
