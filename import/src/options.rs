//! What a person states about elevation data where the file says nothing, or something wrong.
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

/// How new samples are made of old ones. Kernels are GDAL's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Resampling {
    /// The nearest sample.
    Nearest,
    /// The four around, by distance.
    #[default]
    Bilinear,
    /// 16 samples, a cubic convolution (Keys, a = -1/2).
    Cubic,
    /// 36 samples, a windowed sine.
    Lanczos,
    /// The mean of all samples under the new one.
    Average,
}

impl Resampling {
    /// Every way, in the order they are named.
    pub const ALL: [Self; 5] = [Self::Nearest, Self::Bilinear, Self::Cubic, Self::Lanczos, Self::Average];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nearest => "nearest",
            Self::Bilinear => "bilinear",
            Self::Cubic => "cubic",
            Self::Lanczos => "lanczos",
            Self::Average => "average",
        }
    }
}

/// Which of several files counts where they overlap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Priority {
    /// The file that was named first; in folders and patterns the first by name.
    First,
    /// The file that was named last.
    Last,
    /// The highest ground, sample by sample.
    Highest,
    /// The file with the shortest steps on the ground; of files alike the first by name.
    #[default]
    Finest,
}

impl Priority {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Last => "last",
            Self::Highest => "highest",
            Self::Finest => "finest",
        }
    }
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
    /// Whether the distance between samples is stated elsewhere, so that nothing needs to be asked about it.
    pub spacing_is_stated: bool,
    /// The factor on heights that is applied later, for judging them.
    pub z_scale: Option<f64>,
    /// The system to bring the data into: "EPSG:n", "utm" (the zone of the centre), "auto" (UTM, or polar stereographic near the poles), WKT or PROJ.
    pub reproject: Option<String>,
    /// Distance between samples in metres when reprojecting or reading several files; without it that of the data, of the finest file.
    pub resolution: Option<f64>,
    /// How new samples are made of old ones; without it bilinear.
    pub resampling: Option<Resampling>,
    /// Memory in MiB that opening and reading may plan with; without it 512.
    pub memory_mib: Option<u64>,
    /// Folder for temporary files; without it the system's.
    pub scratch: Option<std::path::PathBuf>,
    /// Which of several files counts where they overlap.
    pub priority: Priority,
    /// Metres over which the seams between several files are blended; without it they are not.
    pub feather_m: Option<f64>,
    /// Whether a file of several that is missing or damaged is an error, where it would be left out.
    pub strict: bool,
    /// Whether samples stay in the rows and columns of the file, where they would be turned north-up.
    pub as_stored: bool,
    /// What of a pyramid of map tiles is read.
    pub tiles: TileOptions,
}

/// What of a pyramid of map tiles is read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TileOptions {
    /// The zoom; without it the deepest complete one.
    pub zoom: Option<u8>,
    /// West, south, east and north in degrees; without them those that the pyramid states, as far as there are tiles. Elevation data whose west is greater than the east go on across 180 degrees.
    pub bounds_deg: Option<[f64; 4]>,
    /// Whether the rows of a folder of tiles are counted from the south (TMS), where nothing in it says so.
    pub from_south: bool,
}
