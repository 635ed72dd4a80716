//! Where pages come from: threads that read a file, or a model of a disk with which every replay is the same.

use std::time::Duration;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::read::loader::{Arrival, Loader, PageRequest};

/// Brings pages that were asked for.
pub trait Fetch {
    /// Asks for pages; it is frame `now`. Asking again changes when a page is due.
    fn ask(&mut self, now: u64, requests: &[PageRequest]);

    /// Says where pages lie from now on. What comes after that was read there, or says that it could not be.
    fn relocate(&mut self, places: &[(u64, Entry)]);

    /// A page that has come by frame `now`; does not wait.
    fn take(&mut self, now: u64) -> Option<Arrival>;

    /// Waits until something may have come.
    fn wait(&mut self);

    /// Whether something has come that was not taken.
    fn has_arrivals(&mut self) -> bool;
}

/// A loader, and the arrival that a wait ended with.
#[derive(Debug)]
pub struct ThreadFetch {
    loader: Loader,
    waited_for: Option<Arrival>,
}

impl From<Loader> for ThreadFetch {
    fn from(loader: Loader) -> Self {
        Self { loader, waited_for: None }
    }
}

impl ThreadFetch {
    /// The loader, for its figures.
    pub fn loader(&self) -> &Loader {
        &self.loader
    }
}

impl Fetch for ThreadFetch {
    fn ask(&mut self, now: u64, requests: &[PageRequest]) {
        self.loader.ask(now, requests);
    }

    fn relocate(&mut self, places: &[(u64, Entry)]) {
        self.loader.relocate(places);
        let is_moved = |arrival: &mut Arrival| places.iter().any(|(page, _)| *page == arrival.page);
        if let Some(arrival) = self.waited_for.take_if(is_moved) {
            self.loader.read_again(arrival.page);
        }
    }

    fn take(&mut self, _: u64) -> Option<Arrival> {
        self.waited_for.take().or_else(|| self.loader.take())
    }

    fn wait(&mut self) {
        if self.waited_for.is_none() {
            self.waited_for = self.loader.take_within(Duration::from_millis(100));
        }
    }

    fn has_arrivals(&mut self) -> bool {
        if self.waited_for.is_none() {
            self.waited_for = self.loader.take();
        }
        self.waited_for.is_some()
    }
}
