//! Percentiles of the numbers of pictures, exact, in memory of a fixed size.
//!
//! Whole numbers of 16 bits are counted one by one in one pass. Others are counted in two passes in single precision: the first counts the upper 16 bits of their keys, which
//! grow as the numbers do, the second the lower 16 bits of those around each percentile. The counts are sums, so neither threads nor the order of pictures change them.
//!
//! The percentile `p` of `n` numbers is the smallest of them that at least `p` percent of all do not exceed (the nearest rank; 0 is the smallest).

use super::completed::Completed;
use super::stretched::Limits;
use crate::reader::Numbers;
use crate::shown::Stretch;
use rayon::prelude::*;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::ImageSource;

/// Counters of a pass.
const SLOTS: usize = 1 << 16;
/// Texels looked at together.
const TEXELS: usize = 1 << 18;

/// How a number becomes a slot.
#[derive(Debug, Clone, Copy)]
enum Slot {
    /// Whole numbers from this one on.
    Whole(i32),
    Upper,
    /// The lower bits of those that have these upper bits.
    Lower(u16),
}

/// A key that grows as the number does.
fn key(number: f32) -> u32 {
    let bits = number.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

fn number_of(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

impl Slot {
    fn of(self, number: f32) -> Option<usize> {
        match self {
            Self::Whole(first) => usize::try_from(number as i64 - i64::from(first)).ok(),
            Self::Upper => Some((key(number) >> 16) as usize),
            Self::Lower(upper) => {
                let key = key(number);
                (key >> 16 == u32::from(upper)).then_some((key & 0xffff) as usize)
            }
        }
    }
}

/// Counts of one channel.
struct Counts {
    channel: usize,
    slot: Slot,
    counts: Vec<u64>,
}

impl Counts {
    fn new(channel: usize, slot: Slot) -> Self {
        Self { channel, slot, counts: vec![0; SLOTS] }
    }

    fn add(&mut self, texels: &[Numbers]) {
        for texel in texels {
            let number = texel[self.channel];
            if texel[3] > 0.0
                && number.is_finite()
                && let Some(count) = self.slot.of(number).and_then(|slot| self.counts.get_mut(slot))
            {
                *count += 1;
            }
        }
    }

    /// The slot in which the number of a rank lies, counted from 1, and the rank in it.
    fn find(&self, mut rank: u64) -> Option<(usize, u64)> {
        for (slot, count) in self.counts.iter().enumerate() {
            if rank <= *count {
                return Some((slot, rank));
            }
            rank -= count;
        }
        None
    }
}

/// The rank of a percentile among `total` numbers.
fn rank(percent: f64, total: u64) -> u64 {
    ((percent / 100.0 * total as f64).ceil() as u64).clamp(1, total.max(1))
}

/// Counts the texels of all pictures.
fn pass(pictures: &[&Completed], counts: &mut [Counts]) -> Result<(), LayoutError> {
    for picture in pictures {
        let [wide, high] = picture.info().texels.map(|side| side as usize);
        let mut rows = picture.numbers()?;
        let some = (TEXELS / wide.max(1)).clamp(1, high.max(1));
        let mut band = vec![[0.0; 4]; some * wide];
        for first in (0..high).step_by(some) {
            let band = &mut band[..some.min(high - first) * wide];
            rows.read(band)?;
            counts.par_iter_mut().for_each(|counts| counts.add(band));
        }
    }
    Ok(())
}

/// Black and white of all pictures together. Where nothing is seen, 0 and 1.
pub(super) fn limits(pictures: &[&Completed], stretch: Stretch) -> Result<Limits, LayoutError> {
    let (low, high) = match stretch {
        Stretch::Values(black, white) => return Ok([[black, white]; 3]),
        Stretch::Percentiles(low, high) => (low, high),
    };
    let is_grey = pictures.iter().all(|picture| picture.colours() == 1);
    let channels = if is_grey { 1 } else { 3 };
    let ranges: Option<Vec<[i32; 2]>> = pictures.iter().map(|picture| picture.limits()).collect();
    let first = ranges.iter().flatten().map(|range| range[0]).min().unwrap_or(0);
    let last = ranges.iter().flatten().map(|range| range[1]).max().unwrap_or(0);
    let is_whole = ranges.is_some() && (last - first) < SLOTS as i32;
    let slot = if is_whole { Slot::Whole(first) } else { Slot::Upper };
    let mut counts: Vec<Counts> = (0..channels).map(|channel| Counts::new(channel, slot)).collect();
    pass(pictures, &mut counts)?;
    let found: Vec<[Option<(usize, u64)>; 2]> = counts
        .iter()
        .map(|counts| {
            let total = counts.counts.iter().sum();
            [low, high].map(|percent| counts.find(rank(percent, total)))
        })
        .collect();
    let each: Vec<[f64; 2]> = if is_whole {
        let value = |place: Option<(usize, u64)>| place.map(|(slot, _)| f64::from(slot as i32 + first));
        found.iter().map(|ends| or_unit(ends.map(value))).collect()
    } else {
        let wanted = found.iter().enumerate().flat_map(|(channel, ends)| ends.map(|place| (channel, place)));
        let mut lower: Vec<Counts> = wanted
            .map(|(channel, place)| {
                Counts::new(channel, Slot::Lower(place.map_or(0, |(slot, _)| slot as u16)))
            })
            .collect();
        pass(pictures, &mut lower)?;
        let value = |counts: &Counts, place: Option<(usize, u64)>| {
            let (upper, rank) = place?;
            let (lower, _) = counts.find(rank)?;
            Some(f64::from(number_of((upper as u32) << 16 | lower as u32)))
        };
        let pairs = lower.chunks_exact(2).zip(&found);
        pairs.map(|(pair, ends)| or_unit([value(&pair[0], ends[0]), value(&pair[1], ends[1])])).collect()
    };
    Ok([0, 1, 2].map(|channel: usize| each[channel.min(each.len() - 1)]))
}

fn or_unit([black, white]: [Option<f64>; 2]) -> [f64; 2] {
    black.zip(white).map_or([0.0, 1.0], |(black, white)| [black, white])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_grow_as_numbers_do() {
        let numbers = [f32::NEG_INFINITY, -3e38, -1.0, -1e-40, 0.0, 1e-40, 0.5, 1.0, 3e38, f32::INFINITY];
        assert!(numbers.windows(2).all(|pair| key(pair[0]) < key(pair[1])));
        assert!(numbers.iter().all(|number| number_of(key(*number)) == *number));
    }

    #[test]
    fn ranks_are_those_of_a_sorted_list() {
        let numbers: Vec<f32> = (0..1000).map(|i| ((i * 7919 % 1000) as f32 - 300.0) * 0.37).collect();
        let texels: Vec<Numbers> = numbers.iter().map(|number| [*number, 0.0, 0.0, 255.0]).collect();
        let mut sorted = numbers;
        sorted.sort_by(f32::total_cmp);
        for percent in [0.0, 0.05, 2.0, 50.0, 98.0, 99.99, 100.0] {
            let mut upper = Counts::new(0, Slot::Upper);
            upper.add(&texels);
            let (slot, left) = upper.find(rank(percent, 1000)).unwrap();
            let mut lower = Counts::new(0, Slot::Lower(slot as u16));
            lower.add(&texels);
            let (low, _) = lower.find(left).unwrap();
            let wanted = sorted[(rank(percent, 1000) - 1) as usize];
            assert_eq!(number_of((slot as u32) << 16 | low as u32), wanted, "{percent}");
        }
        assert_eq!([0.0, 0.1, 2.0, 100.0].map(|percent| rank(percent, 1000)), [1, 1, 20, 1000]);
    }
}
