//! What would help where something was refused, as a value.
//!
//! A library does not know by which flag or button a program asks for more memory or another spacing. Its messages say in words what to change.
//! The error has the same as a [`Remedy`], which a program turns into the name of its flag or button. Cost: none.

/// Something that can be asked for and would mend a refusal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Remedy {
    /// The distance between samples, stated: [`BuildOptions::spacing_m`](crate::build::BuildOptions::spacing_m).
    Spacing,
    /// The raw value that means "no data": [`BuildOptions::nodata`](crate::build::BuildOptions::nodata).
    Nodata,
    /// The unit of heights, stated when elevation data is opened.
    HeightUnit,
    /// Which way heights are counted, stated when elevation data is opened.
    Direction,
    /// Which band of several holds the heights.
    Band,
    /// How heights are packed into colours.
    Decode,
    /// Which zoom of a pyramid of map tiles is read.
    Zoom,
    /// Which part of a pyramid of map tiles is read.
    Bounds,
    /// The reference system, stated when elevation data is opened.
    ReferenceSystem,
    /// The shape of a file that does not tell it.
    RawShape,
    /// The distance between samples when elevation data is brought into another system.
    Resolution,
    /// Elevation data brought into another reference system while it is read.
    Reproject,
    /// Another factor on heights: [`BuildOptions::z_scale`](crate::build::BuildOptions::z_scale).
    HeightFactor,
    /// Larger steps between heights: [`BuildOptions::height_step_m`](crate::build::BuildOptions::height_step_m).
    HeightStep,
    /// More memory, in `memory_mib` of the options.
    Memory {
        /// Mebibytes that are enough, where known.
        enough_mib: Option<u64>,
    },
    /// An image to drape.
    Image,
    /// Which numbers of an image are black and white.
    Stretch,
    /// The place of an image, stated: [`DrapeOptions::extent`](crate::imagery::DrapeOptions::extent).
    Extent,
    /// Another format of tiles: [`DrapeOptions::format`](crate::imagery::DrapeOptions::format).
    TileFormat,
    /// Edits kept in a file of their own, an overlay.
    Overlay,
    /// Another folder for scratch files.
    ScratchFolder,
}
