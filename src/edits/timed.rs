//! At which frame of a flight each batch is done.

use super::{LoadedBatch, Moment};
use crate::flight::FlightFrame;
use crate::flyover::TimedBatch;

impl LoadedBatch {
    /// The frame before which it is done in a flight; `None` if its moment comes after the last frame.
    pub fn frame(&self, frames: &[FlightFrame]) -> Option<usize> {
        let Some(moment) = self.moment else { return (!frames.is_empty()).then_some(0) };
        match moment {
            Moment::Frame(frame) => usize::try_from(frame).ok().filter(|frame| *frame < frames.len()),
            // Times of a flight never decrease.
            Moment::Seconds(seconds) => {
                let frame = frames.partition_point(|frame| frame.time_s < seconds);
                (frame < frames.len()).then_some(frame)
            }
        }
    }
}

/// Batches as a replay takes them, those whose moment never comes left out.
pub fn timed(batches: &[LoadedBatch], frames: &[FlightFrame]) -> Vec<TimedBatch> {
    let batches = batches.iter().filter_map(|batch| Some((batch.frame(frames)?, batch.edits.clone())));
    batches.map(|(frame, edits)| TimedBatch { frame, edits }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_become_frames() {
        let frame = |time_s| FlightFrame {
            time_s,
            eye_m: [0.0; 3],
            yaw_deg: 0.0,
            pitch_deg: 0.0,
            roll_deg: 0.0,
            vertical_fov_deg: 45.0,
        };
        let frames = [0.5, 1.0, 1.0, 2.0].map(frame);
        let at = |moment| LoadedBatch { label: String::new(), moment, edits: Vec::new() }.frame(&frames);
        assert_eq!(at(None), Some(0));
        assert_eq!(at(Some(Moment::Frame(3))), Some(3));
        assert_eq!(at(Some(Moment::Frame(4))), None);
        for (seconds, wanted) in
            [(0.0, Some(0)), (0.5, Some(0)), (0.6, Some(1)), (1.0, Some(1)), (1.5, Some(3)), (2.5, None)]
        {
            assert_eq!(at(Some(Moment::Seconds(seconds))), wanted, "{seconds}");
        }
    }
}
