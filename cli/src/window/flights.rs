//! Recording what is seen and flying it again.
//!
//! A recorded frame is the camera in the flight file's own units, so **a flight that is read back shows the views that were seen**. Playing goes by
//! the flight's times and shows places between its frames; scrubbing shows its frames as they are. A flight whose times all are the same is played at 30
//! frames a second. Cost: 64 bytes a frame.

use super::camera::{Camera, between};
use anyhow::Result;
use std::path::Path;
use terrasoar::flight::{Flight, FlightError, FlightFrame, MAX_FRAMES};

/// Frames a second of flights without times.
const UNTIMED_FRAMES_S: f64 = 30.0;

/// A flight being recorded.
#[derive(Debug)]
pub(crate) struct Recorder {
    flight: Flight,
    passed_s: f64,
}

impl Recorder {
    /// A recording over the terrain file of that name.
    pub(crate) fn new(terrain: &Path, exaggeration: f64) -> Self {
        let mut notes = vec![("recorded-with".to_owned(), "terrasoar view".to_owned())];
        let name = terrain.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let fits = (1..=200).contains(&name.len()) && name.trim() == name && !name.contains(char::is_control);
        if fits {
            notes.push(("terrain".to_owned(), name.to_owned()));
        }
        notes.push(("exaggeration".to_owned(), exaggeration.to_string()));
        Self { flight: Flight { notes, frames: Vec::new() }, passed_s: 0.0 }
    }

    /// Adds what is seen `span_s` seconds after the frame before.
    pub(crate) fn push(&mut self, span_s: f64, camera: &Camera) {
        if !self.flight.frames.is_empty() {
            self.passed_s += span_s;
        }
        if (self.flight.frames.len() as u64) < MAX_FRAMES {
            self.flight.frames.push(camera.frame(self.passed_s));
        }
    }

    /// Frames so far.
    pub(crate) fn frames(&self) -> usize {
        self.flight.frames.len()
    }

    /// Seconds so far.
    pub(crate) fn seconds(&self) -> f64 {
        self.passed_s
    }

    /// Ends the recording and writes it.
    ///
    /// # Errors
    /// As [`Flight::write`].
    pub(crate) fn finish(self, path: &Path) -> Result<Flight, FlightError> {
        self.flight.write(path)?;
        Ok(self.flight)
    }
}

/// A flight being played.
#[derive(Debug)]
pub(crate) struct Player {
    frames: Vec<FlightFrame>,
    /// Frame that is shown, with the part of the way to the next.
    at: f64,
    playing: bool,
}

impl Player {
    /// At the first frame of a flight, which has one: readers and writers see to that.
    pub(crate) fn new(flight: Flight) -> Option<Self> {
        (!flight.frames.is_empty()).then_some(Self { frames: flight.frames, at: 0.0, playing: false })
    }

    /// Frames of the flight, at least 1.
    pub(crate) fn len(&self) -> usize {
        self.frames.len()
    }

    /// The frame that is shown.
    pub(crate) fn frame(&self) -> usize {
        (self.at as usize).min(self.frames.len() - 1)
    }

    /// Whether it goes on by itself.
    pub(crate) fn is_playing(&self) -> bool {
        self.playing
    }

    /// Goes on or pauses; at its end it begins again.
    pub(crate) fn toggle(&mut self) {
        self.playing = !self.playing;
        if self.playing && self.frame() + 1 == self.len() {
            self.at = 0.0;
        }
    }

    /// Stays where it is.
    pub(crate) fn pause(&mut self) {
        self.playing = false;
    }

    /// Shows a frame, the last one for those past it.
    pub(crate) fn seek(&mut self, frame: usize) {
        self.at = frame.min(self.len() - 1) as f64;
    }

    /// One frame on or back, and pauses.
    pub(crate) fn step(&mut self, by: isize) {
        self.playing = false;
        self.seek(self.frame().saturating_add_signed(by));
    }

    /// Time of the frame that is shown and of the last, in seconds.
    pub(crate) fn times_s(&self) -> [f64; 2] {
        [self.frame(), self.len() - 1].map(|i| {
            if self.is_timed() {
                self.frames[i].time_s - self.frames[0].time_s
            } else {
                i as f64 / UNTIMED_FRAMES_S
            }
        })
    }

    /// Goes on by `span_s` seconds if it is playing; it pauses at the end.
    pub(crate) fn advance(&mut self, span_s: f64) {
        if !self.playing {
            return;
        }
        let last = self.len() - 1;
        let mut at = self.at;
        if self.is_timed() {
            let mut left_s = span_s;
            while (at as usize) < last {
                let i = at as usize;
                let gap_s = self.frames[i + 1].time_s - self.frames[i].time_s;
                let rest_s = gap_s * (1.0 - at.fract());
                if left_s < rest_s {
                    at += left_s / gap_s;
                    break;
                }
                left_s -= rest_s;
                at = (i + 1) as f64;
            }
        } else {
            at += span_s * UNTIMED_FRAMES_S;
        }
        self.at = at.min(last as f64);
        self.playing = self.at < last as f64;
    }

    /// The camera that is shown.
    pub(crate) fn camera(&self) -> Camera {
        let i = self.frame();
        let here = Camera::from(&self.frames[i]);
        match self.frames.get(i + 1) {
            Some(next) if self.at.fract() > 0.0 => between(&here, &Camera::from(next), self.at.fract()),
            _ => here,
        }
    }

    fn is_timed(&self) -> bool {
        let times = |frame: Option<&FlightFrame>| frame.map(|f| f.time_s);
        times(self.frames.last()) > times(self.frames.first())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::camera::Controls;
    use crate::window::camera::tests::high;
    use crate::window::pick::tests::Hills;
    use terrasoar::view::Viewport;

    #[test]
    fn a_recorded_flight_shows_the_views_that_were_seen() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.flight");
        let mut rig = high();
        let mut recorder = Recorder::new(Path::new("/x/hills.iqt"), 1.5);
        let mut seen = Vec::new();
        let viewport = Viewport { width_px: 640, height_px: 400 };
        for i in 0..200 {
            let turn = f64::from(i % 7) - 2.7;
            let controls =
                Controls { thrust: [0.3, 1.0, -0.2], look_deg: [turn, 0.3 * turn], ..Default::default() };
            let span_s = 0.011 + 1e-4 * f64::from(i % 13);
            rig.advance(span_s, &controls, &Hills, 1.5);
            recorder.push(span_s, &rig.camera);
            seen.push(rig.camera.view(viewport, 2.0, 1.5));
        }
        assert_eq!(recorder.frames(), 200);
        let written = recorder.finish(&path).unwrap();
        let read = Flight::read(&path).unwrap();
        assert_eq!(read, written);
        assert!(read.notes.contains(&("terrain".into(), "hills.iqt".into())));
        let mut player = Player::new(read).unwrap();
        for (i, view) in seen.iter().enumerate() {
            player.seek(i);
            assert_eq!(player.camera().view(viewport, 2.0, 1.5), *view, "frame {i}");
        }
    }

    fn flight(times: &[f64]) -> Flight {
        let frame = |(i, time_s): (usize, &f64)| FlightFrame {
            time_s: *time_s,
            eye_m: [i as f64 * 10.0, 0.0, 0.0],
            yaw_deg: 350.0 + 20.0 * i as f64,
            pitch_deg: 0.0,
            roll_deg: 0.0,
            vertical_fov_deg: 45.0,
        };
        Flight { notes: Vec::new(), frames: times.iter().enumerate().map(frame).collect() }
    }

    #[test]
    fn playing_goes_by_the_flights_own_times() {
        let mut player = Player::new(flight(&[5.0, 6.0, 6.0, 10.0])).unwrap();
        player.advance(1.0);
        assert_eq!(player.camera().eye_m.x, 0.0, "it waits to be started");
        player.toggle();
        player.advance(0.5);
        assert_eq!((player.camera().eye_m.x, player.camera().yaw_deg), (5.0, 360.0));
        player.advance(2.5);
        assert_eq!(player.camera().eye_m.x, 25.0, "two frames of one time are passed at once");
        assert_eq!(player.times_s(), [1.0, 5.0]);
        player.advance(100.0);
        assert_eq!((player.frame(), player.is_playing()), (3, false));
        player.toggle();
        assert_eq!((player.frame(), player.is_playing()), (0, true));
        player.step(1);
        assert_eq!((player.frame(), player.is_playing()), (1, false));
        player.step(-5);
        assert_eq!(player.frame(), 0);
        player.seek(99);
        assert_eq!(player.frame(), 3);
    }

    #[test]
    fn flights_without_times_are_played_all_the_same() {
        let mut player = Player::new(flight(&[0.0; 31])).unwrap();
        player.toggle();
        player.advance(0.5);
        assert_eq!(player.frame(), 15);
        player.advance(9.0);
        assert_eq!((player.frame(), player.times_s()), (30, [1.0, 1.0]));
        assert!(Player::new(flight(&[])).is_none());
        let one = Player::new(flight(&[3.0])).unwrap();
        assert_eq!((one.times_s(), one.camera().yaw_deg), ([0.0, 0.0], 350.0));
    }
}
