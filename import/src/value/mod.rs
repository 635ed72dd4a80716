//! What a raw number means: which band it stands in, how heights are packed into colours, which numbers are void, what unit they count.

mod band;
mod decode;
mod suspicion;
mod unit;
mod voids;

pub(crate) use band::band;
pub(crate) use decode::{Decode, decode};
pub(crate) use suspicion::Suspicion;
pub(crate) use unit::{STANDARD_GRAVITY, US_SURVEY_FOOT_M, unit_m};
pub(crate) use voids::Voids;
