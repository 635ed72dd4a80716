//! Methods of projection that crate `proj4rs` does not have: Colombia Urban (EPSG method 1052) and the New Zealand map grid (EPSG method 9811), between metres on the map and longitude and latitude on the
//! ellipsoid.
//!
//! Formulas of the first are those of IOGP Publication 373-7-2. The second is by series of complex numbers: W. I. Reilly, "A conformal mapping projection with minimum scale error", Survey Review 22 (1973),
//! with the coefficients of Land Information New Zealand. Both lead back to where they came from within a millimetre.

use super::super::from_proj::word;
use super::without;
use terrasoar_layout::portable::sin_cos;

const SECOND: f64 = std::f64::consts::PI / 180.0 / 3600.0;

/// A method with its parameters; angles are radians, lengths metres.
#[derive(Debug, Clone, Copy)]
pub(super) enum Method {
    Urban(Urban),
    NewZealand { a: f64, origin: [f64; 2], false_m: [f64; 2] },
}

/// A plane that touches the ellipsoid, raised by a city's height.
#[derive(Debug, Clone, Copy)]
pub(super) struct Urban {
    a: f64,
    e2: f64,
    height_m: f64,
    origin: [f64; 2],
    false_m: [f64; 2],
}

/// The words of a string that are a method's own.
const OWN: [&str; 7] = ["proj", "lat_0", "lon_0", "x_0", "y_0", "h_0", "k_0"];

/// The string of the longitudes and latitudes that a method leads to.
pub(super) fn angles(text: &str) -> String {
    format!("+proj=longlat {}", without(text, &OWN))
}

impl Method {
    /// The method that a PROJ string names, on an ellipsoid of these axes; `None` for those that the library has.
    pub(super) fn of(text: &str, [a, b]: [f64; 2]) -> Option<Self> {
        let number = |key: &str, without: f64| match word(text, key) {
            Some(value) => value.parse().ok().filter(|value: &f64| value.is_finite()),
            None => Some(without),
        };
        match word(text, "proj")? {
            "col_urban" => Some(Self::Urban(Urban {
                a,
                e2: 1.0 - (b / a) * (b / a),
                height_m: number("h_0", 0.0)?,
                origin: [number("lon_0", 0.0)?.to_radians(), number("lat_0", 0.0)?.to_radians()],
                false_m: [number("x_0", 0.0)?, number("y_0", 0.0)?],
            })),
            "nzmg" => Some(Self::NewZealand {
                a,
                origin: [number("lon_0", 173.0)?.to_radians(), number("lat_0", -41.0)?.to_radians()],
                false_m: [number("x_0", 2_510_000.0)?, number("y_0", 6_023_150.0)?],
            }),
            _ => None,
        }
    }

    /// Longitude and latitude of a place on the map.
    pub(super) fn angles_of(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Urban(urban) => urban.angles_of([x, y]),
            Self::NewZealand { a, origin, false_m } => {
                new_zealand::angles_of([(x - false_m[0]) / a, (y - false_m[1]) / a], origin)
            }
        }
    }

    /// The place on the map of longitude and latitude.
    pub(super) fn map_of(self, [lon, lat]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Urban(urban) => urban.map_of([lon, lat]),
            Self::NewZealand { a, origin, false_m } => {
                let [x, y] = new_zealand::map_of([lon, lat], origin);
                [false_m[0] + a * x, false_m[1] + a * y]
            }
        }
    }
}

impl Urban {
    /// Radii of curvature along the meridian and across it.
    fn radii(&self, lat: f64) -> [f64; 2] {
        let (sin, _) = sin_cos(lat);
        let w = 1.0 - self.e2 * sin * sin;
        [self.a * (1.0 - self.e2) / (w * w.sqrt()), self.a / w.sqrt()]
    }

    fn map_of(&self, [lon, lat]: [f64; 2]) -> [f64; 2] {
        let [rho_0, nu_0] = self.radii(self.origin[1]);
        let [_, nu] = self.radii(lat);
        let [rho_m, _] = self.radii(0.5 * (self.origin[1] + lat));
        let (sin_0, cos_0) = sin_cos(self.origin[1]);
        let across = nu * (lon - self.origin[0]) * sin_cos(lat).1;
        let bend = sin_0 / cos_0 / (2.0 * rho_0 * nu_0);
        let raised = 1.0 + self.height_m / rho_m;
        [
            self.false_m[0] + (1.0 + self.height_m / nu_0) * across,
            self.false_m[1] + raised * rho_0 * (lat - self.origin[1] + bend * across * across),
        ]
    }

    fn angles_of(&self, point: [f64; 2]) -> [f64; 2] {
        let [rho_0, nu_0] = self.radii(self.origin[1]);
        let [dx, dy] = [point[0] - self.false_m[0], point[1] - self.false_m[1]];
        let (sin_0, cos_0) = sin_cos(self.origin[1]);
        let bend = sin_0 / cos_0 / (2.0 * rho_0 * nu_0);
        let along = dx / (1.0 + self.height_m / self.a);
        let lat = self.origin[1] + dy / (rho_0 * (1.0 + self.height_m / (self.a * (1.0 - self.e2))))
            - bend * along * along;
        let [_, nu] = self.radii(lat);
        [self.origin[0] + along / (nu * sin_cos(lat).1), lat]
    }
}

mod new_zealand {
    use super::SECOND;

    /// A complex number: real and imaginary part.
    type Complex = [f64; 2];

    /// From latitude, in hundred thousand seconds, to isometric latitude, and back.
    const TO_ISOMETRIC: [f64; 10] = [
        0.639_917_507_3,
        -0.135_879_761_3,
        0.063_294_409,
        -0.025_268_53,
        0.011_787_9,
        -0.005_516_1,
        0.002_690_6,
        -0.001_333,
        0.000_67,
        -0.000_34,
    ];
    const FROM_ISOMETRIC: [f64; 9] = [
        1.562_701_424_3,
        0.518_540_639_8,
        -0.033_330_98,
        -0.105_290_6,
        -0.036_859_4,
        0.007_317,
        0.012_20,
        0.003_94,
        -0.001_3,
    ];
    /// From isometric latitude and longitude to the map.
    const TO_MAP: [Complex; 6] = [
        [0.755_785_322_8, 0.0],
        [0.249_204_646, 0.003_371_507],
        [-0.001_541_739, 0.041_058_560],
        [-0.101_629_07, 0.017_276_09],
        [-0.266_234_89, -0.362_492_18],
        [-0.687_098_3, -1.165_196_7],
    ];

    fn times(a: Complex, b: Complex) -> Complex {
        [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
    }

    /// A polynomial without a constant.
    fn series(coefficients: &[f64], at: f64) -> f64 {
        at * coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * at + coefficient)
    }

    /// The map's polynomial and its derivative.
    fn to_map(at: Complex) -> [Complex; 2] {
        let (mut value, mut slope) = ([0.0; 2], [0.0; 2]);
        for coefficient in TO_MAP.iter().rev().chain([&[0.0; 2]]) {
            slope = times(slope, at);
            slope = [slope[0] + value[0], slope[1] + value[1]];
            value = times(value, at);
            value = [value[0] + coefficient[0], value[1] + coefficient[1]];
        }
        [value, slope]
    }

    /// East and north in radii of the equator.
    pub(super) fn map_of([lon, lat]: [f64; 2], origin: [f64; 2]) -> [f64; 2] {
        let isometric = series(&TO_ISOMETRIC, (lat - origin[1]) / SECOND * 1e-5);
        let [[north, east], _] = to_map([isometric, lon - origin[0]]);
        [east, north]
    }

    /// By Newton's method, from the map's middle on.
    pub(super) fn angles_of([east, north]: [f64; 2], origin: [f64; 2]) -> [f64; 2] {
        let mut at = [north / TO_MAP[0][0], east / TO_MAP[0][0]];
        for _ in 0..20 {
            let [value, slope] = to_map(at);
            let length = slope[0] * slope[0] + slope[1] * slope[1];
            let step = times([value[0] - north, value[1] - east], [slope[0] / length, -slope[1] / length]);
            at = [at[0] - step[0], at[1] - step[1]];
            if step[0].abs() + step[1].abs() < 1e-14 {
                break;
            }
        }
        [origin[0] + at[1], origin[1] + series(&FROM_ISOMETRIC, at[0]) * 1e5 * SECOND]
    }
}
