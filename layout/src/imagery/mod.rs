//! Imagery draped over a terrain: a pyramid of colour tiles in a section of the terrain file (FORMAT.md, section 8).
//!
//! [`Imagery`] reads it: shape, directory and single tiles as a GPU takes them. Tile data stay in the file until they are asked for; what the directory says of tiles that
//! are stored is held, 16 bytes each. Rows of texels run from south to north everywhere in this module, tiles from the south-west.

#[cfg(feature = "files")]
mod append;
mod decode;
#[cfg(feature = "files")]
mod drape;
mod encode;
mod entries;
mod linear;
#[cfg(feature = "files")]
mod mosaic;
mod paint;
mod place;
#[cfg(feature = "files")]
mod pyramid;
mod reader;
#[cfg(feature = "files")]
mod rows;
mod section;
mod shape;
mod source;

#[cfg(feature = "files")]
pub(crate) use append::Append;
pub use decode::decode_tile;
#[cfg(feature = "files")]
pub use drape::{DrapeOptions, Draped, drape, drape_on};
pub use paint::{
    Fill, OtherState, Paint, PaintChanges, PaintedSection, PaintedTile, Painter, Region, Scorch, TexelRect,
};
pub use place::{Extent, PlaceOrigin};
#[cfg(feature = "files")]
pub(crate) use pyramid::MadeTile;
pub use reader::Imagery;
#[cfg(feature = "files")]
pub(crate) use reader::tile_name;
pub use shape::{BORDER_TEXELS, INNER_TEXELS, ImageryShape, MAX_TEXELS, TILE_TEXELS, TileFormat, TileId};
pub use source::{ImageInfo, ImageSource, MemoryImage, RowReader};
