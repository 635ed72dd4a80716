//! What the tests share.

pub mod landscape;
pub mod refiner;
pub mod scene;
