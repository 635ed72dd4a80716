//! Words of many vertices at once, with what the processor has.
//!
//! One vertex's word by the operations of [`Judge::word`], in a loop over eight that the compiler makes vector instructions of: compiled for AVX2 and for AVX-512, and chosen when the program runs. Whatever else a
//! processor has, it makes one word after another.
//!
//! Invariant: words are the same to the last bit, whichever way they are made; the tests hold all ways against each other. Cost: a fifth of one after another.

use super::Judge;
#[cfg(target_arch = "x86_64")]
use super::clock_of;
use terrasoar_layout::grid::record::Vertex;

/// Vertices that are tested together.
pub(crate) const BATCH: usize = 64;
/// Vertices of a block.
const LANES: usize = 8;

/// Numbers of eight vertices, as records have them.
#[derive(Debug, Clone, Copy, Default)]
struct Block {
    east_m: [f64; LANES],
    north_m: [f64; LANES],
    height_m: [f64; LANES],
    error_m: [f64; LANES],
    radius_m: [f64; LANES],
}

/// Up to [`BATCH`] vertices.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    blocks: [Block; BATCH / LANES],
}

impl Batch {
    /// Sets the `i`-th vertex.
    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, [east_m, north_m]: [f64; 2], vertex: &Vertex) {
        let (block, lane) = (&mut self.blocks[i / LANES % (BATCH / LANES)], i % LANES);
        block.east_m[lane] = east_m;
        block.north_m[lane] = north_m;
        block.height_m[lane] = vertex.height_m;
        block.error_m[lane] = vertex.error_m;
        block.radius_m[lane] = vertex.radius_m;
    }
}

/// Words of a batch, block by block.
pub(crate) type Words = [[u32; LANES]; BATCH / LANES];

/// How words are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// One after another, by [`Judge::word`].
    Single,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Way {
    /// All that this processor has, the best one last.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        let all = [
            Self::Single,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512,
        ];
        all.into_iter().filter(|way| way.is_here())
    }

    /// The best one that this processor has.
    pub(crate) fn best() -> Self {
        Self::all().last().unwrap_or(Self::Single)
    }

    fn is_here(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        {
            let has_avx2 = is_x86_feature_detected!("avx2");
            let has_avx512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl");
            match self {
                Self::Single => true,
                Self::Avx2 => has_avx2,
                Self::Avx512 => has_avx2 && has_avx512,
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        true
    }
}

impl Judge {
    /// Whether many words are made faster by [`Judge::words`].
    #[inline(always)]
    pub(crate) fn makes_batches(&self) -> bool {
        self.way != Way::Single
    }

    /// The words of the first `count` vertices of a batch, if the judge [makes batches](Judge::makes_batches). Those after them are of no vertex.
    #[inline(always)]
    pub(crate) fn words(&self, batch: &Batch, count: usize, words: &mut Words) {
        #[cfg(target_arch = "x86_64")]
        {
            let blocks = count.min(BATCH).div_ceil(LANES);
            let (blocks, words) = (&batch.blocks[..blocks], &mut words[..blocks]);
            #[expect(unsafe_code, reason = "instructions that not every processor has")]
            match self.way {
                // SAFETY: the processor has all that the function is compiled for.
                Way::Avx2 if self.way.is_here() => unsafe { words_avx2(self, blocks, words) },
                // SAFETY: the processor has all that the function is compiled for.
                Way::Avx512 if self.way.is_here() => unsafe { words_avx512(self, blocks, words) },
                _ => unreachable!("only a judge that makes batches is asked"),
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = (batch, count, words);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn words_avx2(judge: &Judge, blocks: &[Block], words: &mut [[u32; LANES]]) {
    words_together(judge, blocks, words);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2")]
fn words_avx512(judge: &Judge, blocks: &[Block], words: &mut [[u32; LANES]]) {
    words_together(judge, blocks, words);
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn words_together(judge: &Judge, blocks: &[Block], words: &mut [[u32; LANES]]) {
    match (judge.moves, judge.culls) {
        (false, false) => words_of::<false, false>(judge, blocks, words),
        (false, true) => words_of::<false, true>(judge, blocks, words),
        (true, false) => words_of::<true, false>(judge, blocks, words),
        (true, true) => words_of::<true, true>(judge, blocks, words),
    }
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn words_of<const MOVES: bool, const CULLS: bool>(
    judge: &Judge,
    blocks: &[Block],
    words: &mut [[u32; LANES]],
) {
    for (block, words) in blocks.iter().zip(words) {
        for i in 0..LANES {
            let at_m = [block.east_m[i], block.north_m[i]];
            let sighting =
                judge.metric.sight_ball(at_m, block.height_m[i], block.error_m[i], block.radius_m[i]);
            let life = judge.ball_life(&sighting, MOVES, CULLS);
            words[i] = judge.word_of_life(&sighting, life, false);
        }
        for word in words {
            *word += judge.now[clock_of(*word)];
        }
    }
}
