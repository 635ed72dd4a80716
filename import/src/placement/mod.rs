//! Where samples lie: north-up rows out of any grid, and metres out of any unit.
//!
//! [`orient`] finds how the rows and columns of a file lie on the ground and turns them exactly where they lie along the axes; [`spacing`] says how far apart samples
//! are; [`warp`] resamples what is turned, sheared, or wanted in another system.

mod guess;
mod orient;
mod spacing;

pub(crate) use orient::{Lie, Turn, Turning, turned_by};
pub(crate) use spacing::{Spacing, spacing};
