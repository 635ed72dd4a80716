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

    /// Takes a tile's values through its segments, as [`walk`] does.
    pub(crate) fn walk<C: Coder>(
        self,
        shape: &TileShape,
        rules: &Rules,
        scratch: &mut Scratch,
        segments: &mut [C],
        truth: Option<&TileRecords>,
    ) -> TileRecords {
        match self {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "instructions that not every processor has")]
            Self::Avx2 if self.is_here() => {
                // SAFETY: the processor has all that the function is compiled for.
                unsafe { walk_avx2(shape, rules, scratch, segments, truth) }
            }
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "instructions that not every processor has")]
            Self::Avx512 if self.is_here() => {
                // SAFETY: the processor has all that the function is compiled for.
                unsafe { walk_avx512(shape, rules, scratch, segments, truth) }
            }
            _ => walk_portable(shape, rules, scratch, segments, truth),
        }
    }
}

#[inline(never)]
fn walk_portable<C: Coder>(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    segments: &mut [C],
    truth: Option<&TileRecords>,
) -> TileRecords {
    walk(shape, rules, scratch, segments, truth)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn walk_avx2<C: Coder>(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    segments: &mut [C],
    truth: Option<&TileRecords>,
) -> TileRecords {
    walk(shape, rules, scratch, segments, truth)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,bmi1,bmi2,lzcnt,popcnt")]
fn walk_avx512<C: Coder>(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    segments: &mut [C],
    truth: Option<&TileRecords>,
) -> TileRecords {
    walk(shape, rules, scratch, segments, truth)
}
