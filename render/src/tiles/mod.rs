//! Square tiles of a pyramid, held on the device as far as a budget allows.
//!
//! A pyramid covers the terrain, or an image on it, with square tiles, each level twice as coarse as the one below, up to one
//! tile over everything. What a tile contains is its *content* (`gradient.rs`: slopes; `imagery.rs`: colours), and how
//! it gets in and out is *residency*, which knows nothing of content: [`WantedTiles`] says what a
//! view asks for, coarse first; [`Residency`] decides what stays; the pool puts bytes into layers of
//! an array texture and keeps a table of them (`table.rs`), from which the shader takes for every pixel the finest resident tile not finer than it
//! needs, else the next coarser. While the coarsest level is resident there is no hole.

mod gradient;
mod imagery;
mod pool;
mod pyramid;
mod residency;
mod table;
mod wanted;

pub(crate) use gradient::GRADIENT_FORMAT;
pub(crate) use gradient::TILE_BORDER;
pub use gradient::{HEIGHTS_PER_TILE, height_tile, pack_gradients};
pub(crate) use imagery::Imagery;
pub use imagery::ImageryStats;
pub use pool::TileStats;
pub(crate) use pool::{TileLayout, TilePool};
pub use pyramid::{Pyramid, TILE_CELLS};
pub(crate) use residency::Residency;
pub(crate) use table::TileTable;
pub(crate) use wanted::Raster;
pub(crate) use wanted::WantedTiles;
