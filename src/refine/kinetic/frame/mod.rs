//! What happens in a frame, in this order: what is over is collected, tested and carried out; what is shown is listed; the next pages are wanted.

pub(crate) mod ahead;
pub(crate) mod budget;
pub(crate) mod collect;
pub(crate) mod edited;
pub(crate) mod resolve;
pub(crate) mod shown;
pub(crate) mod whole;
