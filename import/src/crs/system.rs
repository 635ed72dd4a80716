//! A reference system as far as it concerns a terrain: its name, its units, what its heights are measured from, and how it is projected.

use crate::reader::HorizontalSize;
use crate::value::US_SURVEY_FOOT_M;

/// What the coordinates are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Lengths on a map of a body.
    Projected,
    /// Longitude and latitude.
    Geographic,
    /// Lengths on a site, which no one has tied to a body.
    Local,
    /// Nothing is known.
    Unknown,
}

/// A unit with its name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Unit {
    pub(crate) name: String,
    pub(crate) size: HorizontalSize,
}

/// What heights are measured from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Vertical {
    pub(crate) name: String,
    pub(crate) code: Option<u32>,
    pub(crate) unit_name: String,
    /// Metres a unit.
    pub(crate) metres: f64,
    /// Whether depths are counted, not heights.
    pub(crate) is_down: bool,
}

/// A reference system.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct System {
    pub(crate) kind: Kind,
    /// Short name of the horizontal part.
    pub(crate) name: String,
    /// EPSG code of the horizontal part.
    pub(crate) code: Option<u32>,
    pub(crate) unit: Option<Unit>,
    pub(crate) vertical: Option<Vertical>,
    /// Semi-major axis of the ellipsoid, in metres.
    pub(crate) radius_m: Option<f64>,
    /// The datum by its name, letters and digits alone; empty where it is not told. Systems of one datum are not shifted against each other.
    pub(crate) datum: String,
    /// How it is projected, as a PROJ string.
    pub(crate) proj: Option<String>,
    /// Metres by which places of other datums may be off, for the shift differs from region to region.
    pub(crate) off_m: Option<f64>,
    /// Rectangles of longitude and latitude of WGS 84, west, south, east and north in degrees, outside of which the shift is none that anyone states; empty where nothing is known of that.
    pub(crate) reach_deg: Vec<[f64; 4]>,
    /// Whether x grows to the east and y to the north (1) or the other way (-1).
    pub(crate) signs: [f64; 2],
    /// Whether its first axis points south and its second west, so that its first number is no easting or westing.
    pub(crate) is_south_first: bool,
    /// The system in full: WKT or a PROJ string.
    pub(crate) text: String,
    /// Where it was found.
    pub(crate) by: String,
}

impl System {
    /// A system of which nothing is known.
    pub(crate) fn unknown() -> Self {
        Self {
            kind: Kind::Unknown,
            name: String::new(),
            code: None,
            unit: None,
            vertical: None,
            radius_m: None,
            datum: String::new(),
            proj: None,
            off_m: None,
            reach_deg: Vec::new(),
            signs: [1.0; 2],
            is_south_first: false,
            text: String::new(),
            by: String::new(),
        }
    }
}

/// The size of a unit that a text gives with some fifteen digits, exactly.
pub(crate) fn exact_metres(metres: f64) -> f64 {
    let near = |exact: f64| (metres / exact - 1.0).abs() < 1e-9;
    [1.0, 0.3048, US_SURVEY_FOOT_M, 1000.0].into_iter().find(|exact| near(*exact)).unwrap_or(metres)
}

/// As [`exact_metres`], of radians.
pub(crate) fn exact_radians(radians: f64) -> f64 {
    let degree = 1f64.to_radians();
    let near = |exact: f64| (radians / exact - 1.0).abs() < 1e-9;
    [degree, degree / 60.0, degree / 3600.0, std::f64::consts::PI / 200.0, 1.0]
        .into_iter()
        .find(|exact| near(*exact))
        .unwrap_or(radians)
}
