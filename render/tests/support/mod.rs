//! What the tests share.

pub mod image;
pub mod landscape;
pub mod picture;
pub mod refiner;
pub mod scene;
pub mod stream;
