//! What happens in a frame, in this order. Words that are over are collected and their vertices tested; vertices are split and merged; what is shown is listed; the next pages are asked for.

pub(crate) mod ahead;
pub(crate) mod budget;
pub(crate) mod collect;
pub(crate) mod edited;
pub(crate) mod jump;
pub(crate) mod resolve;
pub(crate) mod shown;
pub(crate) mod whole;
