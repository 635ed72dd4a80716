//! The other ways to find expired words, measured on a column of as many words: what a flat scan costs, with and without minima of blocks.
//!
//! The words have as many clocks as the engine's, so each is compared with a tick looked up by its clock's number.

use std::hint::black_box;
use std::time::Instant;

const CLOCKS: usize = 128;
const EXPIRY_BITS: u32 = 23;
const BLOCK: usize = 64;

/// Prints the costs for columns of `nodes` words and of a million.
pub fn report(nodes: usize) {
    println!("\n## A column of words, one word in a thousand over\n");
    println!("| words | read once, us | one clock, us | 128 clocks, us | 128 clocks, block minima, us |");
    println!("|---|---|---|---|---|");
    for count in [nodes, 1 << 20] {
        let words: Vec<u32> = (0..count as u32).map(word).collect();
        let now: Vec<u32> = vec![1000; CLOCKS];
        let sum = |words: &[u32]| words.iter().fold(0u32, |sum, w| sum.wrapping_add(*w));
        let read = least(|| u64::from(black_box(sum(black_box(&words)))));
        let mut over = Vec::with_capacity(count);
        let mask = (1 << EXPIRY_BITS) - 1;
        let one = least(|| {
            over.clear();
            for (block, words) in words.chunks(BLOCK).enumerate() {
                // A branch a block, so that the comparison is vectorised.
                if words.iter().map(|w| w & mask).min().is_some_and(|least| least <= 1000) {
                    let found = words.iter().enumerate().filter(|(_, w)| *w & mask <= 1000);
                    over.extend(found.map(|(i, _)| (block * BLOCK + i) as u32));
                }
            }
            over.len() as u64
        });
        let many = least(|| {
            over.clear();
            for (block, words) in words.chunks(BLOCK).enumerate() {
                let is_over = |w: u32| w & mask <= now[(w >> EXPIRY_BITS) as usize % CLOCKS];
                if words.iter().fold(false, |any, w| any | is_over(*w)) {
                    let found = words.iter().enumerate().filter(|(_, w)| is_over(**w));
                    over.extend(found.map(|(i, _)| (block * BLOCK + i) as u32));
                }
            }
            over.len() as u64
        });
        // Minima of what is left, all clocks having advanced alike: blocks without an expired word are passed over, the others scanned and their minima made
        // anew.
        let mut minima: Vec<u32> =
            words.chunks(BLOCK).map(|b| b.iter().map(|w| w & mask).min().unwrap_or(0)).collect();
        let minima_us = least(|| {
            over.clear();
            for (block, words) in words.chunks(BLOCK).enumerate() {
                if minima[block] <= 1000 {
                    let is_over = |w: u32| w & mask <= now[(w >> EXPIRY_BITS) as usize % CLOCKS];
                    let found = words.iter().enumerate().filter(|(_, w)| is_over(**w));
                    over.extend(found.map(|(i, _)| (block * BLOCK + i) as u32));
                    minima[block] = black_box(words.iter().map(|w| w & mask).min().unwrap_or(0));
                }
            }
            over.len() as u64
        });
        println!("| {count} | {read:.1} | {one:.1} | {many:.1} | {minima_us:.1} |");
    }
}

/// A repeatable word: any clock, one in a thousand expired.
fn word(i: u32) -> u32 {
    let mixed = i.wrapping_mul(0x9e37_79b9) ^ i.wrapping_mul(0x85eb_ca6b).rotate_left(13);
    let expiry = if mixed.is_multiple_of(1000) { 900 } else { 1001 + mixed % 1_000_000 };
    (mixed % CLOCKS as u32) << EXPIRY_BITS | expiry
}

/// Least microseconds of many repetitions.
fn least(mut work: impl FnMut() -> u64) -> f64 {
    let times = (0..200).map(|_| {
        let start = Instant::now();
        black_box(work());
        start.elapsed().as_secs_f64() * 1e6
    });
    times.fold(f64::INFINITY, f64::min)
}
