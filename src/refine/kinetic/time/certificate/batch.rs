//! Words of many vertices at once, with what the processor has.
//!
//! One vertex's word by the operations of [`Judge::word`], in a loop over eight that the compiler makes vector instructions of: compiled for AVX2 and for AVX-512, and chosen when the program runs. Whatever else a
//! processor has, it makes one word after another.
//!
//! Invariant: words are the same to the last bit, whichever way they are made; the tests hold all ways against each other. Cost: a fifth of one after another.

use super::Judge;
#[cfg(target_arch = "x86_64")]
use super::{Motion, clock_of};
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

/// A loop for each motion, in which all else is without branches.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn words_together(judge: &Judge, blocks: &[Block], words: &mut [[u32; LANES]]) {
    match (judge.motion(), judge.culls) {
        (Motion::None, false) => words_of(judge, blocks, words, Motion::None, false),
        (Motion::None, true) => words_of(judge, blocks, words, Motion::None, true),
        (Motion::Way, false) => words_of(judge, blocks, words, Motion::Way, false),
        (Motion::Way, true) => words_of(judge, blocks, words, Motion::Way, true),
        (Motion::Turn, _) => words_of(judge, blocks, words, Motion::Turn, true),
        (Motion::Bend, _) => words_of(judge, blocks, words, Motion::Bend, true),
        (Motion::Curve, _) => words_of(judge, blocks, words, Motion::Curve, false),
        (Motion::CurvedBend, _) => words_of(judge, blocks, words, Motion::CurvedBend, true),
    }
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn words_of(judge: &Judge, blocks: &[Block], words: &mut [[u32; LANES]], motion: Motion, culls: bool) {
    for (block, words) in blocks.iter().zip(words) {
        for (i, word) in words.iter_mut().enumerate() {
            let at_m = [block.east_m[i], block.north_m[i]];
            let sighting =
                judge.metric.sight_ball(at_m, block.height_m[i], block.error_m[i], block.radius_m[i]);
            let life = judge.ball_life(&sighting, motion, culls);
            *word = judge.word_of_life(&sighting, life, motion);
        }
        for word in words {
            *word += judge.now[clock_of(*word)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::clocks::Clocks;
    use super::super::super::course::{Course, Pose, RATE, STEADY_RATES};
    use super::super::ACTIVE;
    use super::*;
    use crate::metric::Metric;
    use crate::view::View;
    use glam::DVec3;
    use terrasoar_layout::grid::record::VertexClass;

    /// Every way that this processor has, against one word after another: every bit, on all motions, near the borders of both tests too.
    #[test]
    fn words_are_the_same_whichever_way_they_are_made() {
        let mut random = 1u64;
        let mut next = |below: f64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1u64 << 53) as f64 * below
        };
        let mut made = std::collections::BTreeMap::new();
        for round in 0..2000 {
            let view = View::new([next(7000.0), next(7000.0), next(2000.0)], next(360.0), 20.0 - next(90.0))
                .exaggeration([1.0, 0.3, 2.5][round % 3]);
            let metric = Metric::new(&view);
            let mut clocks = Clocks::new([10.0, 0.3, 90.0][round % 5 % 3], 3000.0);
            clocks.move_to(Pose::of(&view, &metric));
            let mut unit = || DVec3::new(next(2.0) - 1.0, next(2.0) - 1.0, next(2.0) - 1.0).normalize();
            let (along, about) = (unit(), unit());
            let (moves, turns) = (round % 4 > 1, round % 2 > 0);
            let curve = if moves && round % 3 > 0 { about * (next(0.01) + 1e-9) } else { DVec3::ZERO };
            let course = Course {
                direction: if moves { along } else { DVec3::ZERO },
                curve,
                axis: if turns { about } else { DVec3::ZERO },
                turn_per_m: if moves && turns { next(0.01) + 1e-9 } else { 0.0 },
                rate: if turns { RATE } else { STEADY_RATES[round % 2].0 },
            };
            clocks.take_course(1 + round % 3, course);
            let judge = Judge::new(metric, &clocks, round % 7 > 0);
            let count = 1 + round % BATCH;
            let (mut batch, mut single) = (Batch::default(), Vec::new());
            for i in 0..count {
                let at_m = [view.eye_m.x + next(8000.0) - 4000.0, view.eye_m.y + next(8000.0) - 4000.0];
                let mut vertex = Vertex {
                    height_m: next(1000.0),
                    error_m: [next(20.0), 0.0, f64::INFINITY][next(2.05) as usize],
                    radius_m: [next(500.0), 0.0][next(1.2) as usize],
                    class: VertexClass::Plain,
                };
                if i % 4 == 0 {
                    // It reaches about as far as it lies.
                    vertex.error_m = 0.0;
                    vertex.radius_m =
                        judge.metric.sight(at_m, &vertex).distance_m() / view.vertical_exaggeration.max(1.0);
                }
                batch.set(i, at_m, &vertex);
                single.push(judge.word(&judge.metric.sight(at_m, &vertex)));
            }
            for way in Way::all().filter(|way| *way != Way::Single) {
                let judge = Judge { way, ..judge.clone() };
                assert!(judge.makes_batches());
                let mut words = [[u32::MAX; LANES]; BATCH / LANES];
                judge.words(&batch, count, &mut words);
                assert_eq!(words.as_flattened()[..count], single, "{way:?}, round {round}");
            }
            for word in single {
                // Motion, kind of the clock, and status.
                *made.entry((round % 4, clock_of(word) / 16 % 2, word & ACTIVE)).or_insert(0) += 1;
            }
        }
        // Unselected; selected and in view; selected and culled.
        assert!(made.len() >= 4 * 3 && made.values().all(|n| *n > 100), "all kinds are met: {made:?}");
    }
}
