//! Reading and writing tiles with what the processor has: the same walk over coders, and the same coders, compiled three times, for the instructions of any processor, for AVX2 and for AVX-512.
//!
//! Nothing in it differs but what the compiler makes of loops over rows. Invariant: all of them read the same from any bytes and write the same, which the tests hold against each other. Cost: a branch.

/// Instructions that tiles are read and written with. Only those that this processor has can be had.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Width(Instructions);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Instructions {
    /// Those that every processor of the target has.
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Instructions {
    /// All there are, the best ones last.
    const ALL: &[Self] = &[
        Self::Portable,
        #[cfg(target_arch = "x86_64")]
        Self::Avx2,
        #[cfg(target_arch = "x86_64")]
        Self::Avx512,
    ];

    /// Whether this processor has them.
    fn are_here(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("bmi2")
                    && is_x86_feature_detected!("lzcnt")
                    && is_x86_feature_detected!("popcnt")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.are_here()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
        }
    }
}

impl std::fmt::Debug for Width {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl Width {
    /// What every processor has.
    pub(crate) const PORTABLE: Self = Self(Instructions::Portable);

    /// All that this processor has, the best one last.
    pub(crate) fn all() -> Vec<Self> {
        Instructions::ALL.iter().copied().filter(|set| set.are_here()).map(Self).collect()
    }

    /// The best one that this processor has.
    pub(crate) fn best() -> Self {
        Self::all().pop().unwrap_or(Self::PORTABLE)
    }

    /// Does some work with these instructions.
    pub(crate) fn run<W: Work>(self, work: W) -> W::Made {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "instructions that not every processor has")]
            Instructions::Avx2 => {
                // SAFETY: `all` alone makes this width, where the processor has what the function is compiled for.
                unsafe { run_avx2(work) }
            }
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "instructions that not every processor has")]
            Instructions::Avx512 => {
                // SAFETY: `all` alone makes this width, where the processor has what the function is compiled for.
                unsafe { run_avx512(work) }
            }
            Instructions::Portable => run_portable(work),
        }
    }
}

/// What is compiled for each width: all of it that counts is inlined into `run`.
pub(crate) trait Work {
    type Made;

    fn run(self) -> Self::Made;
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
