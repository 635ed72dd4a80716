//! The queue against lists of all words.

use super::super::certificate::with_certificate;
use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Nodes and their words.
#[derive(Default)]
struct Known(BTreeMap<u32, u32>);

impl Words for Known {
    fn word(&self, node: u32) -> u32 {
        self.0.get(&node).copied().unwrap_or(0)
    }

    fn fetch(&self, _: u32) {}
}

#[test]
fn a_sweep_keeps_what_is_true_once() {
    let mut queue = Queue::new();
    let mut known = Known::default();
    for round in 0..100 {
        for node in 0..300 {
            let word = with_certificate(0, 7, 5000 + 100 * node);
            known.0.insert(node, word);
            queue.enter(7, Entry { node, word });
        }
        // Words that have changed since: to another clock, and to none.
        known.0.insert(1000 + round, with_certificate(0, 8, 70_000));
        for node in [1000 + round, 2000 + round] {
            queue.enter(7, Entry { node, word: with_certificate(0, 7, 70_000) });
        }
    }
    for _ in 0..CLOCKS * LEVELS {
        queue.sweep_some(&known);
    }
    assert_eq!(queue.len(), 300);
    let mut rest = Vec::new();
    queue.drain(7, |node| rest.push(node));
    rest.sort_unstable();
    assert_eq!(rest, (0..300).collect::<Vec<_>>());
}

proptest! {
    /// Against a list of all words: a node comes out at its word's time, and before only if it has been entered with another word.
    #[test]
    fn nodes_come_out_when_their_words_are_over(
        steps in prop::collection::vec((0u64..400_000, prop::collection::vec((0u32..3_000_000, 0u32..400), 0..20), any::<bool>()), 1..40),
        sweeps in any::<bool>(),
    ) {
        let mut queue = Queue::new();
        let (mut known, mut entered) = (Known::default(), BTreeMap::<u32, u32>::new());
        let mut now = 0;
        for (step, lives, small) in steps {
            now += if small { step % 70 } else { step };
            let mut got = Vec::new();
            queue.advance(3, now, &known, |node| got.push(node));
            for node in &got {
                *entered.get_mut(node).unwrap() -= 1;
            }
            got.retain(|node| u64::from(expiry_of(known.word(*node))) <= now && clock_of(known.word(*node)) == 3);
            got.sort_unstable();
            got.dedup();
            let is_over = |word: u32| clock_of(word) == 3 && u64::from(expiry_of(word)) <= now;
            let expected: Vec<u32> =
                known.0.iter().filter(|(_, word)| is_over(**word)).map(|(node, _)| *node).collect();
            prop_assert_eq!(got, expected);
            known.0.retain(|_, word| !is_over(*word));
            for (life, node) in lives {
                let expiry = now + u64::from(if node % 3 == 0 { life % 100 } else { life });
                if expiry < 1 << EXPIRY_BITS {
                    // Now and then the word is another clock's, whose queue is not looked at.
                    let clock = if life % 5 == 0 { 4 } else { 3 };
                    let word = with_certificate(0, clock, expiry as u32);
                    known.0.insert(node, word);
                    if clock == 3 {
                        queue.enter(3, Entry { node, word });
                        *entered.entry(node).or_default() += 1;
                    }
                }
            }
            if sweeps {
                (0..3).for_each(|_| queue.sweep_some(&known));
                // What a sweep drops is not counted here.
                entered.values_mut().for_each(|count| *count += 1000);
            }
        }
        let mut rest = Vec::new();
        queue.drain(3, |node| rest.push(node));
        let waiting = known.0.iter().filter(|(_, word)| clock_of(**word) == 3);
        for (node, _) in waiting {
            prop_assert!(rest.contains(node));
        }
    }
}
