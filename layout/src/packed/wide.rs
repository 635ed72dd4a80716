//! Reading and writing tiles with what the processor has: the same walk, compiled three times, for the instructions of any processor, for AVX2 and for AVX-512.
//!
//! Nothing in it differs but what the compiler makes of loops over rows. Invariant: all of them read the same from any bytes and write the same, which the tests hold against each other. Cost: asking what the processor has is a
//! load.

use super::coder::Coder;
use super::rules::Rules;
use super::shape::TileShape;
use super::tile::TileRecords;
use super::walk::{Scratch, walk};

/// Instructions that tiles are read and written with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Width {
    /// Those that every processor of the target has.
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Width {
    /// All that this processor has, the best one last.
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        all.extend([Self::Avx2, Self::Avx512].into_iter().filter(|width| width.is_here()));
        all
    }

    /// The best one that this processor has.
    pub(crate) fn best() -> Self {
        Self::all().pop().unwrap_or(Self::Portable)
    }

    #[cfg(target_arch = "x86_64")]
    fn is_here(self) -> bool {
        let has_avx2 = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        let has_avx512 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl");
        match self {
            Self::Portable => true,
            Self::Avx2 => has_avx2,
            Self::Avx512 => has_avx2 && has_avx512,
        }
    }

    /// Does some work with these instructions.
    pub(crate) fn run<W: Work>(self, work: W) -> W::Made {
        match self {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "instructions that not every processor has")]
            Self::Avx2 if self.is_here() => {
                // SAFETY: the processor has all that the function is compiled for.
                unsafe { run_avx2(work) }
            }
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "instructions that not every processor has")]
            Self::Avx512 if self.is_here() => {
                // SAFETY: the processor has all that the function is compiled for.
                unsafe { run_avx512(work) }
            }
            _ => run_portable(work),
        }
    }

    /// Takes a tile's values through its segments, as [`walk`] does.
    pub(crate) fn walk<C: Coder>(
        self,
        shape: &TileShape,
        rules: &Rules,
        scratch: &mut Scratch,
        segments: &mut [C],
        truth: Option<&TileRecords>,
    ) -> TileRecords {
        self.run(Walk { shape, rules, scratch, segments, truth })
    }
}

/// What is compiled for each width: all of it that counts is inlined into `run`.
pub(crate) trait Work {
    type Made;

    fn run(self) -> Self::Made;
}

struct Walk<'w, C> {
    shape: &'w TileShape,
    rules: &'w Rules,
    scratch: &'w mut Scratch,
    segments: &'w mut [C],
    truth: Option<&'w TileRecords>,
}

impl<C: Coder> Work for Walk<'_, C> {
    type Made = TileRecords;

    #[inline(always)]
    fn run(self) -> TileRecords {
        walk(self.shape, self.rules, self.scratch, self.segments, self.truth)
    }
}

#[inline(never)]
fn run_portable<W: Work>(work: W) -> W::Made {
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<W: Work>(work: W) -> W::Made {
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx512<W: Work>(work: W) -> W::Made {
    work.run()
}
