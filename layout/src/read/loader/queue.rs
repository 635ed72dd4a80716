//! Which page is read next: the one that is due first.
//!
//! Invariant: a page is handed out at most once for each time it was asked for after it had been handed out. Cost: a heap's logarithm.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// A page that somebody wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageRequest {
    /// Logical page.
    pub page: u64,
    /// Frame by which it is needed.
    pub due: u64,
}

/// Pages that wait, by the frame they are due.
#[derive(Debug, Default)]
pub(super) struct Waiting {
    heap: BinaryHeap<Reverse<(u64, u64)>>,
    /// When each waiting page is due. What the heap says besides is old.
    due: HashMap<u64, u64>,
}

impl Waiting {
    /// Adds a page, or brings forward or puts off one that waits already.
    pub(super) fn ask(&mut self, request: PageRequest) {
        if self.due.insert(request.page, request.due) != Some(request.due) {
            self.heap.push(Reverse((request.due, request.page)));
        }
    }

    /// The page that is due first.
    pub(super) fn pop(&mut self) -> Option<PageRequest> {
        while let Some(Reverse((due, page))) = self.heap.pop() {
            if self.due.get(&page) == Some(&due) {
                self.due.remove(&page);
                return Some(PageRequest { page, due });
            }
        }
        None
    }

    /// Takes a page out if it waits.
    pub(super) fn take(&mut self, page: u64) -> bool {
        self.due.remove(&page).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        /// Against a plain map: always the page that is due first, each once.
        #[test]
        fn pages_come_in_the_order_they_are_due(steps in prop::collection::vec((0u64..20, 0u64..30, 0u8..4), 1..200)) {
            let mut waiting = Waiting::default();
            let mut plain: BTreeMap<u64, u64> = BTreeMap::new();
            for (page, due, what) in steps {
                match what {
                    0 => {
                        let got = waiting.pop();
                        let first = plain.iter().map(|(page, due)| (*due, *page)).min();
                        prop_assert_eq!(got.map(|r| (r.due, r.page)), first);
                        if let Some((_, page)) = first {
                            plain.remove(&page);
                        }
                    }
                    1 => prop_assert_eq!(waiting.take(page), plain.remove(&page).is_some()),
                    _ => {
                        waiting.ask(PageRequest { page, due });
                        plain.insert(page, due);
                    }
                }
                prop_assert_eq!(waiting.due.len(), plain.len());
            }
        }
    }
}
