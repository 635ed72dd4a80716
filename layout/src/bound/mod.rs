//! How a vertex's record follows from heights and its children's records: the one place that says so, for builds and for edits.
//!
//! `diamond` looks at every sample, `plane` is a triangle's plane over the samples, `padding` says how padding deforms triangles, `rules` puts error, radius and class together. All of it is
//! arithmetic in a fixed order, so every caller gets the same bits.

mod diamond;
mod extremes;
mod padding;
mod plane;
mod rules;

pub(crate) use diamond::{Samples, farthest_diagonal, farthest_level, farthest_upright};
pub(crate) use extremes::{larger, largest_difference, range, smaller};
pub(crate) use plane::Plane;
pub(crate) use rules::{Below, FIRST_SCANNED, Rules, scanned_error_m};
