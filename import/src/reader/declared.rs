//! What a file says about its samples, where they lie and what they mean: statements, not conclusions.
//!
//! Every number comes with the place where it was found (`by`: "tag ModelPixelScale", "N46E007.prj"), because people ask where it came from. A field that the file says nothing about
//! stays empty; a reader never fills in a default.

use crate::options::Direction;
use terrasoar_layout::dem::{SampleType, Warning};

/// A statement and where it was found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Said<T> {
    pub(crate) value: T,
    /// Where, in words that can follow "from": "tag GDAL_NODATA", "dem.asc.aux.xml".
    pub(crate) by: String,
}

impl<T> Said<T> {
    pub(crate) fn new(value: T, by: impl Into<String>) -> Self {
        Self { value, by: by.into() }
    }
}

/// All that one file says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Declared {
    /// Columns and rows of the file, at least 2 each.
    pub(crate) samples: [u32; 2],
    /// Storage type of the samples.
    pub(crate) sample_type: SampleType,
    /// Name of the format in words, for messages: "16-bit PNG".
    pub(crate) format: String,
    /// Which of the file's bands this is, counted from 1; for what stands beside the file.
    pub(crate) band_number: u32,
    /// Affine map from *sample centres* (column, row, both counted from 0 in the order of the file) to coordinates of the reference system:
    /// `x = m[0] + m[1]*col + m[2]*row`, `y = m[3] + m[4]*col + m[5]*row`, x east (or longitude), y north (or latitude). Any signs, any turn.
    pub(crate) place: Option<Said<[f64; 6]>>,
    /// The reference system.
    pub(crate) crs: CrsSaid,
    /// What raw numbers mean.
    pub(crate) value: ValueSaid,
    /// What a person may want to know: which of several bands was read, an overview that was passed over.
    pub(crate) notes: Vec<String>,
    /// What was chosen and should be said aloud: which zoom of a pyramid is read.
    pub(crate) aloud: Vec<String>,
    /// What may make the ground wrong, each with what would mend it.
    pub(crate) warnings: Vec<Warning>,
    /// Whether the file's first row is the southernmost, and GDAL turns the rows round.
    pub(crate) rows_from_south: bool,
    /// What GDAL's `.aux.xml` beside the file corrects of all this.
    pub(crate) corrects: Corrects,
}

/// What of GDAL's `.aux.xml` counts before what a file says itself, as GDAL has it in the file's format. The rest counts where the file says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Corrects {
    /// The place, also before a world file.
    pub(crate) place: bool,
    /// The reference system.
    pub(crate) system: bool,
    /// Voids.
    pub(crate) nodata: bool,
    /// Scale, offset and unit.
    pub(crate) scale: bool,
    /// Nothing counts at all: GDAL does not look for it.
    pub(crate) nothing: bool,
}

impl Declared {
    /// A file that says nothing but its size and type.
    pub(crate) fn new(samples: [u32; 2], sample_type: SampleType, format: impl Into<String>) -> Self {
        Self {
            samples,
            sample_type,
            format: format.into(),
            band_number: 1,
            place: None,
            crs: CrsSaid::default(),
            value: ValueSaid::default(),
            notes: Vec::new(),
            aloud: Vec::new(),
            warnings: Vec::new(),
            rows_from_south: false,
            corrects: Corrects::default(),
        }
    }
}

/// The size of a horizontal unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum HorizontalSize {
    /// Metres a unit.
    Metres(f64),
    /// Radians a unit.
    Radians(f64),
}

/// What a file says about its reference system. The more exact statement wins: a size in the file before that of a code, a text before a code's registry entry.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct CrsSaid {
    /// The system as text, as found: WKT 1 or 2, ESRI's WKT (.prj), a PROJ string, "EPSG:n", "EPSG:n+m", "OGC:CRS84".
    pub(crate) text: Option<Said<String>>,
    /// EPSG code of the horizontal system, of a compound one, or of a three-dimensional one.
    pub(crate) code: Option<Said<u32>>,
    /// EPSG code of the vertical system.
    pub(crate) vertical_code: Option<Said<u32>>,
    /// A name in words, where nothing else names the system.
    pub(crate) name: String,
    /// The unit of coordinates, where the file states it by itself.
    pub(crate) unit: Option<Said<HorizontalSize>>,
    /// Whether that unit is a rounded word of a label, which yields to the unit of the system.
    pub(crate) unit_yields: bool,
    /// Equatorial radius of the body in metres, where the file states it by itself and there is no text.
    pub(crate) radius_m: Option<f64>,
    /// Whether the file says that its coordinates are of a local site or an engineering system: lengths, never degrees.
    pub(crate) is_local: bool,
}

/// A unit of heights.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum VerticalUnit {
    /// By its name as found: "ft", "International feet", "mm".
    Name(String),
    /// Metres a unit.
    #[allow(dead_code, reason = "for readers of formats that give a unit's size")]
    Metres(f64),
    /// Unit code of EPSG: 9001 metre, 9002 foot, 9003 US survey foot, ...
    Code(u32),
}

/// What raw numbers mean: metres of height are `(raw * scale + offset) * unit`, negated where they are depths.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct ValueSaid {
    /// Units a raw number, of any sign; 0, which makes no heights, is passed over with a warning.
    pub(crate) scale: Option<Said<f64>>,
    /// Units at raw number 0.
    pub(crate) offset: Option<Said<f64>>,
    /// Unit of heights, where the band or the file states it apart from the reference system.
    pub(crate) unit: Option<Said<VerticalUnit>>,
    /// Heights or depths, where the file says so.
    pub(crate) direction: Option<Said<Direction>>,
    /// Raw values that mean "no data", as text: decimal, "nan", any notation; compared in the sample's own type.
    pub(crate) nodata: Vec<Said<String>>,
    /// The lowest and the highest raw number that is data, where the file says so; infinite where one is not said.
    pub(crate) valid: Option<Said<[f64; 2]>>,
}
