//! What edits do to heights: functions of a sample's place and its old height alone.

pub(crate) mod area;
pub(crate) mod brush;
pub(crate) mod check;
pub(crate) mod crater;
pub(crate) mod edit;
pub(crate) mod line;
pub(crate) mod stamp;
pub(crate) mod window;
