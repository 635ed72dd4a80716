//! What can go wrong, divided by what the caller can do about it.

/// Errors of this crate.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// No graphics adapter, neither hardware nor software. Install one and try again.
    #[error(
        "no graphics adapter found ({detail}). Install a driver; without graphics hardware a software one does \
         (Debian and Ubuntu: apt install mesa-vulkan-drivers libvulkan1; Fedora: dnf install mesa-vulkan-drivers)"
    )]
    NoAdapter {
        /// Why, in words.
        detail: String,
    },
    /// The adapter gave no device.
    #[error("adapter {adapter} gave no device: {detail}")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// Why, in words.
        detail: String,
    },
    /// The device went away: driver reset, unplugged, put to sleep. Make a new one, a new renderer on it, and apply
    /// one patch with everything.
    #[error("the graphics device was lost ({reason}); a new device and renderer are needed")]
    DeviceLost {
        /// Why, in words.
        reason: String,
    },
    /// The driver layer refused a command; the picture may be incomplete.
    #[error("graphics error: {message}")]
    Device {
        /// Why, in words.
        message: String,
    },
    /// More than the device can hold. A larger tolerance makes a smaller mesh.
    #[error(
        "{what} would need {needed_bytes} bytes where the device allows {limit_bytes}; a larger tolerance needs less"
    )]
    TooLarge {
        /// Which buffer.
        what: &'static str,
        /// Bytes asked for.
        needed_bytes: u64,
        /// Bytes the device allows in one binding.
        limit_bytes: u64,
    },
    /// A picture of no pixels, or of more than the device draws.
    #[error(
        "a picture of {wide} x {high} pixels cannot be drawn: this device draws up to {most} pixels a side; ask for a smaller one"
    )]
    PictureSize {
        /// Pixels across.
        wide: u32,
        /// Pixels down.
        high: u32,
        /// Most pixels either way.
        most: u32,
    },
    /// A draw range names triangles that were never uploaded.
    #[error("triangles {start}..{end} are to be drawn where {uploaded} were uploaded")]
    RangeOutside {
        /// First triangle slot.
        start: u32,
        /// One past the last.
        end: u32,
        /// Triangle slots that exist.
        uploaded: u32,
    },
    /// A tile's content does not have the number of values its kind asks for.
    #[error("tile {tile} has {got} values, {expected} are needed")]
    TileSize {
        /// Level and position.
        tile: String,
        /// Values needed.
        expected: usize,
        /// Values given.
        got: usize,
    },
    /// A tile outside the pyramid.
    #[error("tile {tile} is not of this terrain")]
    NoSuchTile {
        /// Level and position.
        tile: String,
    },
    /// A material's text is no WGSL, or does not fit the ground.
    #[error("line {line} of the material: {message}")]
    Material {
        /// Line of the text, from 1.
        line: u32,
        /// What is wrong, and what to do, in words.
        message: String,
    },
    /// Layers of a material that cannot be drawn.
    #[error("layer {layer} of the material: {message}")]
    Layer {
        /// Which, from 0.
        layer: usize,
        /// What is wrong, in words.
        message: String,
    },
    /// Wrong use that is none of the above.
    #[error("{0}")]
    Usage(&'static str),
}

/// Result with this crate's error.
pub type Result<T> = std::result::Result<T, RenderError>;
