//! Largest and smallest of many numbers, voids (NaN) left out.
//!
//! `f64::max` checks both numbers for NaN, in four instructions. Where only the new number can be NaN, one instruction is enough. Eight
//! lanes let the compiler take several numbers at once. It may not do that by itself, because it cannot know that the order does not matter.

const LANES: usize = 8;

/// The larger of `best`, which is not NaN, and `other`; `best` if `other` is NaN.
#[inline(always)]
pub(crate) fn larger(best: f64, other: f64) -> f64 {
    if other > best { other } else { best }
}

/// The smaller of `best`, which is not NaN, and `other`; `best` if `other` is NaN.
#[inline(always)]
pub(crate) fn smaller(best: f64, other: f64) -> f64 {
    if other < best { other } else { best }
}

/// Smallest and largest of `values`; infinite and the wrong way round if all are NaN.
pub(crate) fn range(values: &[f64]) -> [f64; 2] {
    let mut low = [f64::INFINITY; LANES];
    let mut high = [f64::NEG_INFINITY; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks.iter().map(|c| c.as_slice()).chain([rest]) {
        for ((value, low), high) in chunk.iter().zip(&mut low).zip(&mut high) {
            *low = smaller(*low, *value);
            *high = larger(*high, *value);
        }
    }
    [low.into_iter().fold(f64::INFINITY, smaller), high.into_iter().fold(f64::NEG_INFINITY, larger)]
}

/// Largest difference between numbers of `a` and `b` that stand at the same place, as far as the shorter goes; 0 if there are none.
pub(crate) fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let mut largest = [0.0; LANES];
    let count = a.len().min(b.len());
    let ((a, a_rest), (b, b_rest)) = (a[..count].as_chunks::<LANES>(), b[..count].as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        for ((a, b), largest) in a.iter().zip(b).zip(&mut largest) {
            *largest = larger(*largest, (a - b).abs());
        }
    }
    let rest = a_rest.iter().zip(b_rest).map(|(a, b)| (a - b).abs());
    largest.into_iter().chain(rest).fold(0.0, larger)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_are_those_of_all_numbers_that_are_not_void() {
        for count in 0..40usize {
            let value =
                |i: usize| if i % 3 == 1 { f64::NAN } else { ((i * 37 + count * 11) % 23) as f64 - 9.0 };
            let values: Vec<f64> = (0..count).map(value).collect();
            let known = || values.iter().copied().filter(|v| !v.is_nan());
            let naive = [known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max)];
            assert_eq!(range(&values), naive);
            let other: Vec<f64> = values.iter().rev().copied().collect();
            let pairs = values.iter().zip(&other).map(|(a, b)| (a - b).abs());
            assert_eq!(
                largest_difference(&values, &other),
                pairs.filter(|d| !d.is_nan()).fold(0.0, f64::max)
            );
        }
    }
}
