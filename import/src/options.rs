//! What a person says about elevation data that the file does not, or says wrongly.
//!
//! Cost: none. A new format adds a field here with a default that changes nothing.

/// Which way numbers grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Heights: larger is higher.
    Up,
    /// Depths: larger is deeper.
    Down,
}

/// How to read elevation data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OpenOptions {
    /// Which band or variable holds the heights: a number counted from 1, or a name.
    pub band: Option<String>,
    /// How heights are packed into colours: "mapbox", "terrarium", or factors "R,G,B,BASE" of which
    /// `height = R * red + G * green + B * blue + BASE` in metres.
    pub decode: Option<String>,
    /// Raw values that mean "no data", beside what the file declares: numbers in any notation, or "nan". Compared in the sample's own type.
    pub nodata: Vec<String>,
    /// Shape of a file without a header: "WxH:TYPE", such as "1025x1025:u16le".
    pub raw: Option<String>,
    /// Heights or depths, whatever the file says.
    pub positive: Option<Direction>,
    /// Reference system instead of the file's: "EPSG:n", "EPSG:n+m", WKT, or a PROJ string.
    pub crs: Option<String>,
    /// Unit of heights instead of the file's, by name or code or metres a unit: "ft", "ftUS", "dm", "0.1".
    pub height_unit: Option<String>,
    /// Whether samples stay in the rows and columns of the file, where they would be turned north-up.
    pub as_stored: bool,
}
