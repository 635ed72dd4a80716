//! Which pages have been asked for, when they are due, and which could not be read.
//!
//! Invariant: a page is asked for again only if it is needed earlier than was said before, or is late, or was dropped. A page that failed waits before it is tried again, twice as long
//! each time. Cost: a look into a table for each page that is asked for.

use std::collections::HashMap;
use terrasoar_layout::read::loader::{PageRequest, STALE_FRAMES};

/// A page needed earlier by no more frames than this is not asked for again.
const SLACK: u64 = 4;
/// What is needed in more frames than this is not asked for: it is wanted again when it is nearer.
const FARTHEST: f32 = 1000.0;
/// Frames until a page that failed once is tried again.
const FIRST_RETRY: u64 = 8;
/// Longest wait between two tries, in frames.
const LAST_RETRY: u64 = 512;

#[derive(Debug, Clone, Copy)]
struct Pending {
    asked: u64,
    due: u64,
    /// Whether the mesh has lacked it.
    late: bool,
}

#[derive(Debug, Clone, Copy, Default)]
struct Trouble {
    failures: u32,
    not_before: u64,
}

#[derive(Debug, Default)]
pub(super) struct Requests {
    pending: HashMap<u64, Pending>,
    trouble: HashMap<u64, Trouble>,
    /// The newest frame's, kept for its memory.
    pub asked: Vec<PageRequest>,
}

impl Requests {
    /// Pages that have not come yet.
    pub(super) fn outstanding(&self) -> usize {
        self.pending.len()
    }

    /// The request to be made for a page wanted in so many frames, if there is one to be made.
    pub(super) fn ask(&mut self, page: u64, now: u64, in_frames: f32) -> Option<PageRequest> {
        let is_near = (0.0..FARTHEST).contains(&in_frames);
        if !is_near || self.trouble.get(&page).is_some_and(|trouble| now < trouble.not_before) {
            return None;
        }
        let due = now + in_frames as u64;
        match self.pending.get_mut(&page) {
            // Overdue requests go stale unless they are renewed.
            Some(pending) if due + SLACK >= pending.due && now <= pending.due + STALE_FRAMES / 2 => None,
            Some(pending) => {
                pending.due = due;
                Some(PageRequest { page, due })
            }
            None => {
                self.pending.insert(page, Pending { asked: now, due, late: false });
                Some(PageRequest { page, due })
            }
        }
    }

    /// Whether a page that was asked for and that the mesh lacks was not lacking before.
    pub(super) fn is_newly_late(&mut self, page: u64) -> bool {
        self.pending.get_mut(&page).is_some_and(|pending| !std::mem::replace(&mut pending.late, true))
    }

    /// A page has come. Tells how many frames that took.
    pub(super) fn came(&mut self, page: u64, now: u64) -> Option<u64> {
        self.trouble.remove(&page);
        self.pending.remove(&page).map(|pending| now - pending.asked)
    }

    /// A page could not be read. Tells whether that is news.
    pub(super) fn failed(&mut self, page: u64, now: u64) -> bool {
        self.pending.remove(&page);
        let trouble = self.trouble.entry(page).or_default();
        let wait = (FIRST_RETRY << trouble.failures.min(16)).min(LAST_RETRY);
        trouble.failures += 1;
        trouble.not_before = now + wait;
        trouble.failures == 1
    }

    /// Whether a page failed when it was last tried.
    pub(super) fn is_in_trouble(&self, page: u64) -> bool {
        self.trouble.contains_key(&page)
    }

    /// A page lies elsewhere: where it lay before says nothing about how it can be read now.
    pub(super) fn moved(&mut self, page: u64) {
        self.trouble.remove(&page);
    }

    /// A page was not read, because it was not asked for again.
    pub(super) fn dropped(&mut self, page: u64) {
        self.pending.remove(&page);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_asked_for_once_unless_it_becomes_urgent() {
        let mut requests = Requests::default();
        assert_eq!(requests.ask(7, 100, 50.0), Some(PageRequest { page: 7, due: 150 }));
        assert_eq!(requests.ask(7, 101, 49.0), None);
        assert_eq!(requests.ask(7, 101, 10.0), Some(PageRequest { page: 7, due: 111 }));
        assert!(requests.is_newly_late(7) && !requests.is_newly_late(7));
        assert_eq!(requests.ask(7, 112, 0.0), None);
        assert_eq!(
            requests.ask(7, 140, 0.0),
            Some(PageRequest { page: 7, due: 140 }),
            "renewed before it is stale"
        );
        assert_eq!(requests.came(7, 145), Some(45));
        for never in [1e9, 1e30, f32::INFINITY, f32::NAN] {
            assert_eq!(requests.ask(8, 150, never), None);
        }
        assert_eq!(requests.outstanding(), 0);
    }

    #[test]
    fn what_failed_is_tried_again_ever_later() {
        let mut requests = Requests::default();
        let mut now = 0;
        let mut waits = Vec::new();
        for i in 0..12 {
            assert!(requests.ask(3, now, 0.0).is_some());
            assert_eq!(requests.failed(3, now), i == 0, "told once");
            let failed = now;
            while requests.ask(3, now, 0.0).is_none() {
                now += 1;
            }
            requests.dropped(3);
            waits.push(now - failed);
        }
        assert_eq!(waits[..4], [8, 16, 32, 64]);
        assert_eq!(waits[11], LAST_RETRY);
    }
}
