//! How many frames before it is needed a page is asked for. It is the time that pages take to come, measured while flying, in frames.
//!
//! A smoothed mean and a smoothed deviation, as networks time their retransmissions (V. Jacobson, "Congestion Avoidance and Control", SIGCOMM 1988). It is counted in
//! frames. So no clock is read, and anything that slows down frames or storage is counted too.

/// Shortest lead.
const LEAST: f32 = 12.0;
/// Longest lead: farther ahead it is not known where the eye will be.
const MOST: f32 = 90.0;
/// Frames to spare.
const SPARE: f32 = 8.0;

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lead {
    mean: f32,
    deviation: f32,
}

impl Lead {
    /// The lead, in frames.
    pub(super) fn frames(self) -> f32 {
        (self.mean + 4.0 * self.deviation + SPARE).clamp(LEAST, MOST)
    }

    /// A page has come so many frames after it was asked for.
    pub(super) fn came_after(&mut self, frames: u64) {
        let off = frames as f32 - self.mean;
        self.mean += off / 8.0;
        self.deviation += (off.abs() - self.deviation) / 4.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lead_covers_what_pages_take() {
        let mut lead = Lead::default();
        assert_eq!(lead.frames(), LEAST);
        for i in 0..200 {
            lead.came_after(20 + i % 5);
        }
        assert!((28.0..50.0).contains(&lead.frames()), "{}", lead.frames());
        for _ in 0..200 {
            lead.came_after(1000);
        }
        assert_eq!(lead.frames(), MOST);
        for _ in 0..200 {
            lead.came_after(1);
        }
        assert_eq!(lead.frames(), LEAST);
    }
}
