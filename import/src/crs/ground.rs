//! From coordinates of a system to longitude and latitude and back, and how long a step is on the ground. Projections are crate `proj4rs`'s.
//!
//! Units and the directions of axes are taken out of PROJ strings, because this program applies them itself. Where the grid of a datum's shift is missing, the shift is left out, which is some hundred metres at
//! most; the place remains known. Angles are radians. Cost: a microsecond a point.

use super::from_proj;
use super::system::{Kind, System};
use crate::guard::quiet;
use crate::reader::HorizontalSize;
use proj4rs::proj::Proj;
use proj4rs::transform::transform;
use terrasoar_layout::portable::{hypot, sin_cos};

/// Words of a PROJ string that are dealt with here, or say nothing about the plane.
const LEFT_OUT: [&str; 12] = [
    "units",
    "to_meter",
    "vunits",
    "vto_meter",
    "axis",
    "type",
    "wktext",
    "no_defs",
    "geoidgrids",
    "geoid_crs",
    "over",
    "init",
];

/// A system that coordinates can be brought out of and into.
#[derive(Clone)]
pub(crate) struct Ground {
    proj: Proj,
    /// Longitude and latitude on the same ellipsoid, without a shift of datum.
    own: Proj,
    /// Longitude and latitude of WGS 84, or of the same body.
    world: Proj,
    /// Metres or radians a unit.
    size: f64,
    signs: [f64; 2],
    /// Once around the globe in the system's unit, where that leads to the same place.
    turn: Option<f64>,
    /// Semi-axes of the ellipsoid in metres.
    axes_m: [f64; 2],
    /// The datum, or the grid of its shift, that is not here.
    lost: Option<String>,
}

impl std::fmt::Debug for Ground {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Ground")
            .field("size", &self.size)
            .field("axes_m", &self.axes_m)
            .finish_non_exhaustive()
    }
}

/// The string without the words `left_out`.
fn without(text: &str, left_out: &[&str]) -> String {
    let kept: Vec<&str> = text
        .split_whitespace()
        .filter(|word| {
            let key = word.trim_start_matches('+').split('=').next().unwrap_or("");
            !left_out.contains(&key)
        })
        .collect();
    kept.join(" ")
}

/// Semi-axes of the ellipsoid of WGS 84 in metres.
const WGS84_M: [f64; 2] = [6_378_137.0, 6_356_752.314_245_179];

/// Whether latitudes of the ellipsoid are drawn by the formulas of a sphere of its equator, as the maps of web pages do: distances on the ground are the ellipsoid's.
fn is_web_mercator(proj: &Proj, text: &str) -> bool {
    let number = |key: &str| from_proj::word(text, key).and_then(|value| value.parse::<f64>().ok());
    let is_sphere = [number("a"), number("b")] == [Some(WGS84_M[0]); 2] || number("R") == Some(WGS84_M[0]);
    proj.projname() == "webmerc" || (proj.projname() == "merc" && is_sphere)
}

/// Whether a radius is that of one of the Earth's ellipsoids.
pub(crate) fn is_earth(radius_m: f64) -> bool {
    (6_300_000.0..6_450_000.0).contains(&radius_m)
}

impl Ground {
    /// The way to the ground of a system; `None` where there is none: local systems, projections that are not known.
    pub(crate) fn new(system: &System) -> Option<Self> {
        let text = match (&system.proj, system.kind) {
            (Some(text), _) => text.clone(),
            (None, Kind::Geographic) => match system.radius_m {
                Some(radius) if !is_earth(radius) => format!("+proj=longlat +a={radius} +b={radius}"),
                _ => "+proj=longlat +datum=WGS84".into(),
            },
            (None, _) => return None,
        };
        let bare = quiet(|| on_sphere(without(&text, &LEFT_OUT)))?;
        let (no_grid, grid) = match from_proj::word(&bare, "nadgrids") {
            Some("@null") | None => (bare, None),
            Some(grid) => (without(&bare, &["nadgrids"]), Some(grid.to_owned())),
        };
        let size = match system.unit.as_ref()?.size {
            HorizontalSize::Metres(metres) => metres,
            HorizontalSize::Radians(radians) => radians,
        };
        // Others' code on a stranger's text.
        quiet(|| {
            let whole = Self::of(&no_grid, size, system.signs);
            let whole = whole.map(|ground| Self { lost: grid.clone(), ..ground });
            whole.or_else(|| {
                let rough = Self::of(&plain(&no_grid), size, system.signs)?;
                let datum = from_proj::word(&no_grid, "datum").map(str::to_owned);
                Some(Self { lost: grid.or(datum).or_else(|| Some(String::new())), ..rough })
            })
        })
        .flatten()
    }

    fn of(text: &str, size: f64, signs: [f64; 2]) -> Option<Self> {
        let proj = Proj::from_proj_string(text).ok()?;
        // A projection may have taken its scale into its own axes, so the ellipsoid is asked apart.
        let [a, b] = axes_of(text)?;
        let axes_m = if is_web_mercator(&proj, text) { WGS84_M } else { [a, b] };
        let own = Proj::from_proj_string(&format!("+proj=longlat +a={a} +b={b}")).ok()?;
        let world = match is_earth(a) {
            true => Proj::from_proj_string("+proj=longlat +datum=WGS84").ok()?,
            false => own.clone(),
        };
        let turn = match proj.is_latlong() {
            true => Some(std::f64::consts::TAU / size),
            false => turn_on_map(&proj, &own).map(|metres| metres / size),
        };
        let this = Self { proj, own, world, size, signs, turn, axes_m, lost: None };
        // A datum by a grid that is not here shows at the first point.
        let (lon, lat) = (this.proj.longitude_of_origin(), this.proj.latitude_of_origin().clamp(-1.4, 1.4));
        let mut probe = (lon + 0.01, lat + 0.01);
        transform(&this.world, &this.proj, &mut probe).ok()?;
        transform(&this.proj, &this.world, &mut probe).ok()?;
        (probe.0.is_finite() && probe.1.is_finite()).then_some(this)
    }

    /// Longitude and latitude on the system's own ellipsoid.
    pub(crate) fn own(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        self.out_of(point, &self.own)
    }

    /// Longitude and latitude of WGS 84; on other bodies their own.
    pub(crate) fn world(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        self.out_of(point, &self.world)
    }

    fn out_of(&self, [x, y]: [f64; 2], to: &Proj) -> Option<[f64; 2]> {
        let mut point = (x * self.signs[0] * self.size, y * self.signs[1] * self.size);
        transform(&self.proj, to, &mut point).ok()?;
        (point.0.is_finite() && point.1.is_finite()).then_some([point.0, point.1])
    }

    /// The point of a longitude and latitude of WGS 84.
    #[cfg(test)]
    fn of_world(&self, [lon, lat]: [f64; 2]) -> Option<[f64; 2]> {
        let mut point = (lon, lat);
        transform(&self.world, &self.proj, &mut point).ok()?;
        let point = [point.0 * self.signs[0] / self.size, point.1 * self.signs[1] / self.size];
        point.iter().all(|value| value.is_finite()).then_some(point)
    }

    /// A point of this system in another one.
    pub(crate) fn across_to(&self, other: &Self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let mut point = (x * self.signs[0] * self.size, y * self.signs[1] * self.size);
        transform(&self.proj, &other.proj, &mut point).ok()?;
        let point = [point.0 * other.signs[0] / other.size, point.1 * other.signs[1] / other.size];
        point.iter().all(|value| value.is_finite()).then_some(point)
    }

    /// Whether the datum is told by a grid that is not here, so that places are off by its shift where they are brought to another datum.
    pub(crate) fn is_shift_lost(&self) -> bool {
        self.lost.is_some()
    }

    /// Whether places brought to the other system are off by a shift that is not here: one of both has lost it, or each another one.
    pub(crate) fn is_rough_to(&self, other: &Self) -> bool {
        self.lost != other.lost
    }

    /// Whether the ellipsoids differ by metres.
    pub(crate) fn shape_differs(&self, other: &Self) -> bool {
        self.axes_m.iter().zip(other.axes_m).any(|(a, b)| (a - b).abs() > 5.0)
    }

    /// Radius of the equator in metres.
    pub(crate) fn radius_m(&self) -> f64 {
        self.axes_m[0]
    }

    /// Once around the globe in the system's unit, where that leads to the same place: of angles, and of maps like Mercator's.
    pub(crate) fn turn(&self) -> Option<f64> {
        self.turn
    }

    /// Whether the length of a step depends on the latitude alone and strongly, as on Mercator's maps.
    pub(crate) fn is_cylindrical(&self) -> bool {
        matches!(self.proj.projname(), "merc" | "webmerc" | "eqc" | "cea" | "mill" | "gall" | "tcea")
    }

    /// Latitude and metres on the ellipsoid of the two steps `across` and `down` at a point.
    pub(crate) fn steps_m(&self, at: [f64; 2], steps: [[f64; 2]; 2]) -> Option<([f64; 2], f64)> {
        let middle = self.own(at)?;
        let [a, b] = self.axes_m;
        let e2 = 1.0 - (b / a) * (b / a);
        let (sin, cos) = sin_cos(middle[1]);
        let w = 1.0 - e2 * sin * sin;
        let [metres_lon, metres_lat] = [a * cos / w.sqrt(), a * (1.0 - e2) / (w * w.sqrt())];
        let length = |[dx, dy]: [f64; 2]| {
            let from = self.own([at[0] - dx / 2.0, at[1] - dy / 2.0])?;
            let to = self.own([at[0] + dx / 2.0, at[1] + dy / 2.0])?;
            let turn = std::f64::consts::TAU;
            let mut lon = (to[0] - from[0]) % turn;
            if lon.abs() > turn / 2.0 {
                lon -= turn.copysign(lon);
            }
            Some(hypot(lon * metres_lon, (to[1] - from[1]) * metres_lat))
        };
        Some(([length(steps[0])?, length(steps[1])?], middle[1]))
    }
}

/// Metres of a map once around the globe, where its x is a longitude in another unit.
fn turn_on_map(proj: &Proj, own: &Proj) -> Option<f64> {
    if !matches!(proj.projname(), "merc" | "webmerc" | "eqc" | "cea" | "mill" | "gall") {
        return None;
    }
    let middle = proj.longitude_of_origin();
    let x = |lon: f64| {
        let mut point = (lon, 0.0);
        transform(own, proj, &mut point).ok().map(|()| point.0)
    };
    let turn = std::f64::consts::TAU * (x(middle + 1.0)? - x(middle)?);
    (turn.is_finite() && turn > 0.0).then_some(turn)
}

/// The string with the sphere of the ellipsoid's area for `+R_A`: its formulas are those of the sphere, and latitudes stay those of the ellipsoid, so that no shift of datum may be made between both.
fn on_sphere(text: String) -> String {
    if from_proj::word(&text, "R_A").is_none() {
        return text;
    }
    let bare = without(&text, &["R_A"]);
    let Some([a, b]) = axes_of(&bare) else { return text };
    let e2 = 1.0 - (b / a) * (b / a);
    let radius = a * (1.0 - e2 * (1.0 / 6.0 + e2 * (17.0 / 360.0 + e2 * 67.0 / 3024.0)));
    let rest = without(&bare, &["a", "b", "R", "rf", "f", "ellps", "datum", "towgs84", "nadgrids"]);
    format!("{rest} +R={radius}")
}

/// Semi-axes of the ellipsoid that a string names.
fn axes_of(text: &str) -> Option<[f64; 2]> {
    let words: Vec<&str> = text
        .split_whitespace()
        .filter(|word| {
            ["a", "b", "R", "rf", "f", "ellps", "datum"]
                .contains(&word.trim_start_matches('+').split('=').next().unwrap_or(""))
        })
        .collect();
    let body = Proj::from_proj_string(&format!("+proj=longlat {}", words.join(" "))).ok()?;
    let (a, b) = body.ellipse_parameters();
    Some([a, b])
}

/// The string with its ellipsoid and without its datum's shift.
fn plain(text: &str) -> String {
    let ellipsoid = match from_proj::word(text, "datum") {
        Some("NAD27") => " +ellps=clrk66",
        Some("NAD83") => " +ellps=GRS80",
        Some("OSGB36") => " +ellps=airy",
        Some("potsdam" | "hermannskogel") => " +ellps=bessel",
        Some("nzgd49") => " +ellps=intl",
        Some("carthage") => " +ellps=clrk80ign",
        Some("ire65") => " +ellps=mod_airy",
        Some("GGRS87") => " +ellps=GRS80",
        Some(_) => " +ellps=WGS84",
        None => "",
    };
    format!("{}{ellipsoid}", without(text, &["datum", "nadgrids", "towgs84"]))
}

#[cfg(test)]
mod tests {
    use super::super::resolve::by_text;
    use super::*;

    fn ground(text: &str) -> Ground {
        Ground::new(&by_text(text).unwrap()).unwrap_or_else(|| panic!("{text}"))
    }

    /// Positions by gdaltransform (PROJ 9.1): x, y, longitude, latitude in degrees. Datums are shifted by few parameters here and by grids there, hence some metres.
    #[test]
    fn places_are_those_of_proj() {
        for (system, [x, y], [lon, lat], tolerance_deg) in [
            ("EPSG:32632", [500_000.0, 5_000_000.0], [9.0, 45.153_477_183_356], 1e-9),
            (
                "EPSG:3857",
                [1_200_000.0, 8_400_047.889_818],
                [10.779_783_409_434_3, 60.001_392_359_384_9],
                1e-9,
            ),
            ("EPSG:2263", [980_000.0, 200_000.0], [-74.015_331_015_319_3, 40.715_629_477_243_7], 1e-8),
            ("EPSG:3035", [4_321_000.0, 3_210_000.0], [10.0, 52.0], 1e-9),
            ("EPSG:3031", [1_000_000.0, 500_000.0], [63.434_948_822_922, -79.736_420_851_25], 1e-9),
            ("EPSG:2193", [1_600_000.0, 5_400_000.0], [173.0, -41.551_664_523_452_8], 1e-9),
            ("EPSG:2154", [700_000.0, 6_600_000.0], [3.0, 46.5], 1e-9),
            ("EPSG:5070", [100_000.0, 1_500_000.0], [-94.872_589_251_067_4, 36.541_672_730_115_9], 1e-8),
            ("EPSG:2046", [50_000.0, 3_000_000.0], [14.495_755_477_362_1, -27.110_730_617_771_7], 1e-8),
            ("EPSG:4807", [2.0, 50.0], [4.136_623_906_269_87, 44.999_984_761_451_1], 1e-5),
            ("EPSG:21781", [600_000.0, 200_000.0], [7.438_632_420_871_81, 46.951_082_771_871_1], 1e-5),
            ("EPSG:27700", [400_000.0, 300_000.0], [-2.001_433_115_510_89, 52.597_792_430_833_8], 1e-4),
            ("EPSG:28992", [155_000.0, 463_000.0], [5.387_203_508_413_77, 52.155_172_301_192_2], 1e-4),
            ("EPSG:26710", [565_000.0, 4_756_000.0], [-122.204_252_342_292, 42.955_620_123_025_6], 2e-3),
            ("+proj=utm +zone=32 +datum=WGS84 +units=km", [500.0, 5000.0], [9.0, 45.153_477_183_356], 1e-9),
        ] {
            let ground = ground(system);
            let found = ground.world([x, y]).unwrap().map(f64::to_degrees);
            let away = (found[0] - lon).abs().max((found[1] - lat).abs());
            assert!(away <= tolerance_deg, "{system}: {found:?} is {away} from {lon}, {lat}");
            let back = ground.of_world(found.map(f64::to_radians)).unwrap();
            let [dx, dy] = [back[0] - x, back[1] - y];
            assert!(dx.hypot(dy) < 1e-4 * x.abs().max(1.0), "{system}: {back:?}");
        }
    }

    /// Shifts that a system carries in WKT 2 or 1 are made; those of grids, which are not here, are told. Positions by gdaltransform (GDAL 3.10).
    #[test]
    fn shifts_of_bound_systems_are_made_or_told() {
        let base = "PROJCRS[\"a\",BASEGEOGCRS[\"b\",DATUM[\"c\",ELLIPSOID[\"Bessel 1841\",6377397.155,299.1528128]],PRIMEM[\"Greenwich\",0]],\
            CONVERSION[\"d\",METHOD[\"Transverse Mercator\",ID[\"EPSG\",9807]],PARAMETER[\"Latitude of natural origin\",0,ANGLEUNIT[\"degree\",0.0174532925199433],ID[\"EPSG\",8801]],\
            PARAMETER[\"Longitude of natural origin\",9,ANGLEUNIT[\"degree\",0.0174532925199433],ID[\"EPSG\",8802]],PARAMETER[\"Scale factor at natural origin\",1,SCALEUNIT[\"unity\",1],ID[\"EPSG\",8805]],\
            PARAMETER[\"False easting\",3500000,LENGTHUNIT[\"metre\",1],ID[\"EPSG\",8806]],PARAMETER[\"False northing\",0,LENGTHUNIT[\"metre\",1],ID[\"EPSG\",8807]]],\
            CS[Cartesian,2],AXIS[\"E\",east,ORDER[1],LENGTHUNIT[\"metre\",1]],AXIS[\"N\",north,ORDER[2],LENGTHUNIT[\"metre\",1]]]";
        let bound = |transformation: &str| {
            let target = "TARGETCRS[GEOGCRS[\"WGS 84\",DATUM[\"World Geodetic System 1984\",ELLIPSOID[\"WGS 84\",6378137,298.257223563]],\
                CS[ellipsoidal,2],AXIS[\"lat\",north],AXIS[\"lon\",east],ANGLEUNIT[\"degree\",0.0174532925199433]]]";
            ground(&format!(
                "BOUNDCRS[SOURCECRS[{base}],{target},ABRIDGEDTRANSFORMATION[\"t\",{transformation}]]"
            ))
        };
        let parameters = |method: &str, turn: f64| {
            let values = [598.1, 73.7, 418.2, 0.202 * turn, 0.045 * turn, -2.455 * turn, 1.000_006_7];
            let all = values
                .iter()
                .zip(8605..)
                .map(|(value, code)| format!("PARAMETER[\"p\",{value},ID[\"EPSG\",{code}]]"));
            format!("METHOD[\"{method}\"],{}", all.collect::<Vec<_>>().join(","))
        };
        let at = [3_515_000.0, 5_540_000.0];
        let is = |ground: &Ground, [lon, lat]: [f64; 2]| {
            let found = ground.world(at).unwrap().map(f64::to_degrees);
            assert!((found[0] - lon).abs() < 1e-8 && (found[1] - lat).abs() < 1e-8, "{found:?}");
        };
        let shifted = [9.208_161_151_436_43, 49.996_152_069_197_9];
        for (method, turn) in [
            ("Position Vector transformation (geog2D domain)", 1.0),
            ("Coordinate Frame rotation (geog2D domain)", -1.0),
        ] {
            let ground = bound(&parameters(method, turn));
            is(&ground, shifted);
            assert!(!ground.is_shift_lost());
        }
        let grid = bound(
            "METHOD[\"NTv2\"],PARAMETERFILE[\"Latitude and longitude difference file\",\"BETA2007.gsb\"]",
        );
        assert!(grid.is_shift_lost() && grid.is_rough_to(&ground("EPSG:4326")) && !grid.is_rough_to(&grid));
        let in_one = ground(
            "GEOGCS[\"a\",DATUM[\"b\",SPHEROID[\"Bessel 1841\",6377397.155,299.1528128],EXTENSION[\"PROJ4_GRIDS\",\"BETA2007.gsb\"]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]]",
        );
        assert!(in_one.is_shift_lost() && !in_one.is_rough_to(&grid));
        assert!(ground("EPSG:4267").is_rough_to(&ground("EPSG:4326")));
        assert!(!ground("EPSG:26714").is_rough_to(&ground("EPSG:4267")));
    }

    /// Miller's map is drawn on the sphere of the ellipsoid's area, and latitudes stay the ellipsoid's. Positions by gdaltransform.
    #[test]
    fn spheres_of_equal_area_shift_no_datum() {
        for text in [
            "+proj=mill +R_A +lon_0=3 +datum=WGS84",
            "PROJCS[\"a\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],\
             PROJECTION[\"Miller_Cylindrical\"],PARAMETER[\"latitude_of_center\",0],PARAMETER[\"longitude_of_center\",3],PARAMETER[\"false_easting\",0],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]",
        ] {
            let [lon, lat] = ground(text).world([15_000.0, 15_000.0]).unwrap().map(f64::to_degrees);
            let away = (lon - 3.134_898_088_837_22).abs().max((lat - 0.134_898_009_074_42).abs());
            assert!(away < 1e-8, "{text}: {lon} {lat}");
        }
    }

    /// Once around leads to the same place, and what lies beyond the seam of a map is where it is.
    #[test]
    fn maps_go_round_where_longitudes_do() {
        for (system, turn) in [
            ("EPSG:4326", Some(360.0)),
            ("EPSG:3857", Some(40_075_016.685_578_49)),
            ("+proj=merc +lat_ts=41 +lon_0=150 +x_0=1000000 +datum=WGS84 +units=km", Some(30_288.666_64)),
            ("EPSG:32632", None),
            ("EPSG:3035", None),
        ] {
            let ground = ground(system);
            let found = ground.turn();
            assert!(found.zip(turn).is_none_or(|(a, b)| (a / b - 1.0).abs() < 1e-8), "{system}: {found:?}");
            assert_eq!(found.is_some(), turn.is_some(), "{system}");
            let Some(turn) = found else { continue };
            let [x, y] = ground.of_world([3.0, 0.3]).unwrap();
            for turns in [-1.0, 0.0, 1.0] {
                let [lon, lat] = ground.world([x + turns * turn, y]).unwrap();
                let away = (lon - 3.0).rem_euclid(std::f64::consts::TAU);
                let away = away.min(std::f64::consts::TAU - away);
                assert!(away < 1e-9 && (lat - 0.3).abs() < 1e-9, "{system}: {lon} {lat} after {turns} turns");
            }
        }
    }

    #[test]
    fn steps_are_as_long_as_on_the_ground() {
        let mercator = ground("EPSG:3857");
        let ([east, north], latitude) =
            mercator.steps_m([1_200_000.0, 8_399_737.889_818], [[20.0, 0.0], [0.0, -20.0]]).unwrap();
        // 20 cos 60 on the sphere by whose formulas the map is drawn, times the ellipsoid's radii over the sphere's: N and M of
        // latitude 60 are 6,394,209.17 and 6,383,453.86 m.
        assert!((latitude.to_degrees() - 60.0).abs() < 1e-6, "{latitude}");
        let [wanted_east, wanted_north] =
            [6_394_209.17, 6_383_453.86].map(|radius| 10.0 * radius / 6_378_137.0);
        assert!((east - wanted_east).abs() < 1e-6, "{east} {wanted_east}");
        assert!((north - wanted_north).abs() < 1e-6, "{north} {wanted_north}");
        for same in ["EPSG:900913", "+proj=webmerc +datum=WGS84", "EPSG:3785"] {
            let steps =
                ground(same).steps_m([1_200_000.0, 8_399_737.889_818], [[20.0, 0.0], [0.0, -20.0]]).unwrap();
            assert_eq!(
                steps.0.map(|m| (m * 1e6).round()),
                [east, north].map(|m| (m * 1e6).round()),
                "{same}"
            );
        }
        let utm = ground("EPSG:32632");
        let ([east, north], _) = utm.steps_m([500_000.0, 5_000_000.0], [[10.0, 0.0], [0.0, -10.0]]).unwrap();
        assert!((east - 10.004).abs() < 1e-4 && (north - 10.004).abs() < 1e-4, "{east} {north}");
    }
}
