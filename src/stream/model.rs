//! A model of a disk: so many reads a frame, each after so many frames, the earliest deadline first. Replays over it are the same every time, on any machine.

use super::Fetch;
use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::read::loader::{Arrival, Outcome, PageRequest, STALE_FRAMES};
use terrasoar_layout::read::terrain::Terrain;

/// The model over a terrain, whose source it reads at once and hands over later.
#[derive(Debug)]
pub struct ModelDisk {
    terrain: Arc<Terrain>,
    reads_a_frame: usize,
    latency_frames: u64,
    now: u64,
    /// When each waiting page is due.
    waiting: BTreeMap<u64, u64>,
    /// Pages on their way, and the frame they come in.
    coming: VecDeque<(u64, u64)>,
    dropped: VecDeque<u64>,
    /// Where pages lie that have moved since the terrain was opened.
    places: HashMap<u64, Entry>,
}

impl ModelDisk {
    /// A disk that begins `reads_a_frame` reads each frame, at least one, and takes `latency_frames` for each.
    pub fn new(terrain: Arc<Terrain>, reads_a_frame: usize, latency_frames: u64) -> Self {
        Self {
            terrain,
            reads_a_frame: reads_a_frame.max(1),
            latency_frames,
            now: 0,
            waiting: BTreeMap::new(),
            coming: VecDeque::new(),
            dropped: VecDeque::new(),
            places: HashMap::new(),
        }
    }
}

impl Fetch for ModelDisk {
    fn ask(&mut self, now: u64, requests: &[PageRequest]) {
        self.now = now;
        self.waiting.extend(requests.iter().map(|request| (request.page, request.due)));
        let mut by_due: Vec<(u64, u64)> = self.waiting.iter().map(|(page, due)| (*due, *page)).collect();
        by_due.sort_unstable();
        let mut begun = 0;
        for (due, page) in by_due {
            if begun == self.reads_a_frame {
                break;
            }
            self.waiting.remove(&page);
            if due + STALE_FRAMES < now {
                self.dropped.push_back(page);
                continue;
            }
            self.coming.push_back((now + self.latency_frames, page));
            begun += 1;
        }
    }

    fn relocate(&mut self, places: &[(u64, Entry)]) {
        self.places.extend(places.iter().copied());
    }

    fn take(&mut self, now: u64) -> Option<Arrival> {
        if let Some(page) = self.dropped.pop_front() {
            return Some(Arrival { page, outcome: Outcome::Dropped });
        }
        let (_, page) = self.coming.pop_front_if(|(frame, _)| *frame <= now)?;
        let read = match self.places.get(&page) {
            Some(entry) => self.terrain.checked_page_at(page, *entry),
            None => self.terrain.checked_page(page),
        };
        let outcome = match read {
            Ok(bytes) => Outcome::Read(bytes),
            Err(error) => Outcome::Failed(error),
        };
        Some(Arrival { page, outcome })
    }

    fn wait(&mut self) {}

    fn has_arrivals(&mut self) -> bool {
        !self.coming.is_empty() || !self.dropped.is_empty() || !self.waiting.is_empty()
    }
}
