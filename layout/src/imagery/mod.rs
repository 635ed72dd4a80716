//! Imagery draped over a terrain: a pyramid of colour tiles in a section of the terrain file (FORMAT.md, section 8).
//!
//! [`Imagery`] reads it: shape, directory and single tiles as a GPU takes them. Tile data stay in the file until they are asked for; what
//! is held is 16 bytes a tile. Rows of texels run from south to north everywhere in this module, tiles from the south-west.

mod decode;
mod reader;
mod section;
mod shape;

pub use decode::decode_tile;
pub use reader::Imagery;
pub use shape::{BORDER_TEXELS, INNER_TEXELS, ImageryShape, TILE_TEXELS, TileFormat, TileId};
