//! A flight between its frames: where the eye is at a moment.
//!
//! Places, climbs and fields of view go straight from frame to frame, headings and rolls the shorter way round. **At a frame's own time it is the frame.** Cost: a binary search a moment.

use super::FlightFrame;

/// Seconds from the first to the last frame.
pub fn duration_s(frames: &[FlightFrame]) -> f64 {
    match frames {
        [first, .., last] => last.time_s - first.time_s,
        _ => 0.0,
    }
}

/// How many moments there are, `per_second` to a second, from the first frame's time to the last one's. At least 1.
pub fn moments(frames: &[FlightFrame], per_second: f64) -> u64 {
    // Whole steps, where rounding may have taken a hair of the last one.
    (duration_s(frames) * per_second * (1.0 + 1e-12) + 1e-9).floor() as u64 + 1
}

/// The eye so many seconds after the first frame; before it the first frame's, after the last one the last one's. `None` where there are no frames.
pub fn frame_at(frames: &[FlightFrame], since_first_s: f64) -> Option<FlightFrame> {
    let time_s = frames.first()?.time_s + since_first_s;
    let after = frames.partition_point(|frame| frame.time_s <= time_s);
    let Some(b) = frames.get(after) else { return frames.last().copied() };
    let Some(a) = after.checked_sub(1).and_then(|before| frames.get(before)) else { return Some(*b) };
    // Above 0, for a's time is not after the moment and b's is.
    let share = (time_s - a.time_s) / (b.time_s - a.time_s);
    let between = |a: f64, b: f64| a + (b - a) * share;
    Some(FlightFrame {
        time_s,
        eye_m: [0, 1, 2].map(|i| between(a.eye_m[i], b.eye_m[i])),
        yaw_deg: a.yaw_deg + turn_deg(a.yaw_deg, b.yaw_deg) * share,
        pitch_deg: between(a.pitch_deg, b.pitch_deg),
        roll_deg: a.roll_deg + turn_deg(a.roll_deg, b.roll_deg) * share,
        vertical_fov_deg: between(a.vertical_fov_deg, b.vertical_fov_deg),
    })
}

/// The shorter way from one angle to another, from -180 to 180 degrees.
fn turn_deg(from_deg: f64, to_deg: f64) -> f64 {
    let turn = (to_deg - from_deg).rem_euclid(360.0);
    if turn > 180.0 { turn - 360.0 } else { turn }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(time_s: f64, east_m: f64, yaw_deg: f64) -> FlightFrame {
        FlightFrame {
            time_s,
            eye_m: [east_m, 2.0 * east_m, 100.0],
            yaw_deg,
            pitch_deg: -10.0,
            roll_deg: 0.0,
            vertical_fov_deg: 45.0,
        }
    }

    #[test]
    fn between_frames_the_eye_goes_straight_and_turns_the_shorter_way() {
        let frames =
            [frame(5.0, 0.0, 350.0), frame(7.0, 40.0, 10.0), frame(7.0, 80.0, 10.0), frame(8.0, 80.0, -90.0)];
        assert_eq!(duration_s(&frames), 3.0);
        assert_eq!(frame_at(&frames, 0.0), Some(frames[0]));
        let middle = frame_at(&frames, 1.0).unwrap();
        assert_eq!((middle.eye_m, middle.yaw_deg), ([20.0, 40.0, 100.0], 360.0));
        // Of two frames of one moment the later one counts.
        assert_eq!(frame_at(&frames, 2.0), Some(frames[2]));
        let later = frame_at(&frames, 2.5).unwrap();
        assert_eq!((later.eye_m[0], later.yaw_deg), (80.0, -40.0));
        for after in [3.0, 99.0] {
            assert_eq!(frame_at(&frames, after), Some(frames[3]));
        }
        assert_eq!(frame_at(&[], 0.0), None);
    }

    #[test]
    fn moments_are_counted_to_the_last_frame() {
        // A thousand frames at thirty a second, times as they are written.
        let frames: Vec<_> = (0..1000).map(|i| frame(f64::from(i) / 30.0, f64::from(i), 0.0)).collect();
        assert_eq!(moments(&frames, 30.0), 1000);
        assert_eq!(moments(&frames, 60.0), 1999);
        assert_eq!(moments(&frames, 10.0), 334);
        for i in 0..1000_u32 {
            let at = frame_at(&frames, f64::from(i) / 30.0).unwrap();
            assert!((at.eye_m[0] - f64::from(i)).abs() < 1e-9);
        }
        assert_eq!(moments(&frames[..1], 30.0), 1);
        assert_eq!(moments(&[], 30.0), 1);
    }
}
