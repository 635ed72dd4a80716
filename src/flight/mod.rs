//! Recorded flights: a camera path as data, so that every replay sees the same frames.
//!
//! A flight is a text file (`FLIGHT.md` beside this source specifies it) or is generated over a terrain.
//! **Nothing in a flight depends on a clock or on chance: equal input gives equal frames.**

mod error;
pub(crate) mod format;
pub mod generate;
pub mod incoherence;
mod reader;
pub mod sample;
mod writer;

use crate::view::{ErrorMetric, View, Viewport};
use glam::DVec3;

pub use error::FlightError;
pub use format::MAX_FRAMES;
pub use reader::FlightReader;
#[cfg(feature = "files")]
pub use writer::FlightWriter;

/// One frame of a flight, in the units of the flight file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightFrame {
    /// Seconds since the start.
    pub time_s: f64,
    /// Eye position in metres east, north and up (see [`crate::view`]).
    pub eye_m: [f64; 3],
    /// Heading in degrees, clockwise from north.
    pub yaw_deg: f64,
    /// Climb of the line of sight in degrees, -90..=90.
    pub pitch_deg: f64,
    /// Roll in degrees, positive to the right.
    pub roll_deg: f64,
    /// Vertical field of view in degrees, above 0 and below 180.
    pub vertical_fov_deg: f64,
}

impl FlightFrame {
    /// The frame's camera for a picture of `viewport` at `tolerance_px`.
    pub fn view(&self, viewport: Viewport, tolerance_px: f64) -> View {
        View {
            eye_m: DVec3::from_array(self.eye_m),
            yaw_rad: self.yaw_deg.to_radians(),
            pitch_rad: self.pitch_deg.to_radians(),
            roll_rad: self.roll_deg.to_radians(),
            vertical_fov_rad: self.vertical_fov_deg.to_radians(),
            viewport,
            tolerance_px,
            vertical_exaggeration: 1.0,
            metric: ErrorMetric::default(),
        }
    }
}

/// A camera path: its frames in the order flown, and what its author noted about it.
///
/// Costs 64 bytes a frame; [`FlightReader`] and [`FlightWriter`] pass frames on one by one instead.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flight {
    /// Named notes in file order, such as `("terrain", "alps.iqt")`. Names match `[a-z][a-z0-9-]*`, values
    /// are single lines without surrounding white space; at most 256.
    pub notes: Vec<(String, String)>,
    /// Frames in the order flown, 1..=[`MAX_FRAMES`] of them, whose times never decrease.
    pub frames: Vec<FlightFrame>,
}
