//! A page cache as the counting run imagines it: so many pages, the one not touched for longest goes first.
//!
//! Touches stand in a queue in the order they were made; one that was not a page's last is passed over when its turn comes. The queue is swept when most
//! of it is such. Cost: amortised O(1) a touch, three words a page and touch.

use std::collections::{HashMap, VecDeque};

/// Pages in memory.
#[derive(Debug, Clone)]
pub struct PageCache {
    capacity: usize,
    /// When each page was last touched.
    touched: HashMap<u64, u64>,
    /// Touches, oldest first.
    order: VecDeque<(u64, u64)>,
    now: u64,
}

impl PageCache {
    /// An empty cache for `capacity` pages; one at the least.
    pub fn new(capacity: usize) -> Self {
        Self { capacity: capacity.max(1), touched: HashMap::new(), order: VecDeque::new(), now: 0 }
    }

    /// Whether the page is there.
    pub fn contains(&self, page: u64) -> bool {
        self.touched.contains_key(&page)
    }

    /// Pages there.
    pub fn len(&self) -> usize {
        self.touched.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.touched.is_empty()
    }

    /// Touches a page, loading it if need be; whether it was there.
    pub fn touch(&mut self, page: u64) -> bool {
        self.now += 1;
        let was_there = self.touched.insert(page, self.now).is_some();
        self.order.push_back((page, self.now));
        while self.touched.len() > self.capacity {
            match self.order.pop_front() {
                Some((oldest, when)) if self.touched.get(&oldest) == Some(&when) => {
                    self.touched.remove(&oldest);
                }
                Some(_) => {}
                None => break,
            }
        }
        if self.order.len() > 2 * self.touched.len() + 64 {
            let touched = &self.touched;
            self.order.retain(|(page, when)| touched.get(page) == Some(when));
        }
        was_there
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against a list of pages, the last touched at its end.
        #[test]
        fn the_longest_untouched_goes(capacity in 1..12usize, touches in prop::collection::vec(0..20u64, 0..400)) {
            let mut cache = PageCache::new(capacity);
            let mut list: Vec<u64> = Vec::new();
            for page in touches {
                let there = list.iter().position(|p| *p == page);
                prop_assert_eq!(cache.contains(page), there.is_some());
                prop_assert_eq!(cache.touch(page), there.is_some());
                if let Some(at) = there {
                    list.remove(at);
                }
                list.push(page);
                if list.len() > capacity {
                    list.remove(0);
                }
                prop_assert_eq!(cache.len(), list.len());
                prop_assert!(list.iter().all(|p| cache.contains(*p)));
                prop_assert!(cache.order.len() <= 2 * list.len() + 64);
            }
        }
    }
}
