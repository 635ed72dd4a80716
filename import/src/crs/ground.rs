//! From coordinates of a system to longitude and latitude and back, and how long a step is on the ground. Projections are crate `proj4rs`'s.
//!
//! Units and the directions of axes are taken out of PROJ strings, because this program applies them itself. Where the grid of a datum's shift is missing, the shift is left out, which is some hundred metres at
//! most; the place remains known. Angles are radians. Cost: a microsecond a point.

mod doubt;
mod methods;

pub use doubt::Doubt;
pub(crate) use doubt::all_over;

use super::from_proj;
use super::south_first::crossed;
use super::system::{Kind, System};
use crate::guard::quiet;
use crate::reader::HorizontalSize;
use methods::Method;
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

/// Words for spheres that the library passes over.
const SPHERES_AT_A_LATITUDE: [&str; 2] = ["R_lat_a", "R_lat_g"];

/// A system that coordinates can be brought out of and into.
#[derive(Clone)]
pub(crate) struct Ground {
    proj: Proj,
    /// A method that the library does not have: then `proj` is that of longitudes and latitudes, which it leads to.
    method: Option<Method>,
    /// Longitude and latitude on the same ellipsoid, without a shift of datum.
    own: Proj,
    /// Longitude and latitude of WGS 84, or of the same body.
    world: Proj,
    /// Metres or radians a unit.
    size: f64,
    signs: [f64; 2],
    is_south_first: bool,
    /// Once around the globe in the system's unit, where that leads to the same place.
    turn: Option<f64>,
    /// Semi-axes of the ellipsoid in metres.
    axes_m: [f64; 2],
    /// The datum, or the grid of its shift, that is not here.
    lost: Option<String>,
    /// The system without any shift, and the name of its datum: for systems of the same one.
    unshifted: Option<(Proj, String)>,
    /// The datum, where nothing says how it lies to that of WGS 84, and its ellipsoid is another.
    untied: Option<String>,
    /// The metres by which a shift that differs from region to region may be off.
    off_m: Option<f64>,
    /// Rectangles of longitude and latitude outside of which the shift is one that nobody states; empty where nothing is known of that.
    reach_deg: Vec<[f64; 4]>,
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
        if SPHERES_AT_A_LATITUDE.iter().any(|word| from_proj::word(&text, word).is_some()) {
            return None;
        }
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
            let found = whole.or_else(|| {
                let rough = Self::of(&plain(&no_grid), size, system.signs)?;
                let datum = from_proj::word(&no_grid, "datum").map(str::to_owned);
                Some(Self { lost: grid.or(datum).or_else(|| Some(String::new())), ..rough })
            })?;
            let bare = plain(&no_grid);
            let bare = if found.method.is_some() { methods::angles(&bare) } else { bare };
            let unshifted = Proj::from_proj_string(&bare).ok().filter(|_| !system.datum.is_empty());
            let unshifted = unshifted.map(|proj| (proj, system.datum.clone()));
            Some(Self {
                unshifted,
                untied: untied(&text, &system.datum),
                off_m: system.off_m,
                reach_deg: system.reach_deg.clone(),
                is_south_first: system.is_south_first,
                ..found
            })
        })
        .flatten()
    }

    fn of(text: &str, size: f64, signs: [f64; 2]) -> Option<Self> {
        let method = Method::of(text, axes_of(text)?);
        let angles = method.is_some().then(|| methods::angles(text));
        let text = angles.as_deref().unwrap_or(text);
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
            _ if method.is_some() => None,
            true => Some(std::f64::consts::TAU / size),
            false => turn_on_map(&proj, &own).map(|metres| metres / size),
        };
        let this = Self {
            proj,
            method,
            own,
            world,
            size,
            signs,
            is_south_first: false,
            turn,
            axes_m,
            lost: None,
            unshifted: None,
            untied: None,
            off_m: None,
            reach_deg: Vec::new(),
        };
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

    /// A point as the projection has it.
    fn inward(&self, point: [f64; 2]) -> (f64, f64) {
        if self.is_south_first {
            let [x, y] = crossed(point);
            return (x * self.size, y * self.size);
        }
        let metres = [0, 1].map(|axis| point[axis] * self.signs[axis] * self.size);
        let [x, y] = self.method.map_or(metres, |method| method.angles_of(metres));
        (x, y)
    }

    /// A point of the projection as the system has it.
    fn outward(&self, (x, y): (f64, f64)) -> Option<[f64; 2]> {
        let [x, y] = self.method.map_or([x, y], |method| method.map_of([x, y]));
        let point = match self.is_south_first {
            true => crossed([x / self.size, y / self.size]),
            false => [x * self.signs[0] / self.size, y * self.signs[1] / self.size],
        };
        point.iter().all(|value| value.is_finite()).then_some(point)
    }

    fn out_of(&self, [x, y]: [f64; 2], to: &Proj) -> Option<[f64; 2]> {
        let mut point = self.inward([x, y]);
        transform(&self.proj, to, &mut point).ok()?;
        (point.0.is_finite() && point.1.is_finite()).then_some([point.0, point.1])
    }

    /// The point of a longitude and latitude of WGS 84.
    #[cfg(test)]
    fn of_world(&self, [lon, lat]: [f64; 2]) -> Option<[f64; 2]> {
        let mut point = (lon, lat);
        transform(&self.world, &self.proj, &mut point).ok()?;
        self.outward(point)
    }

    /// A point of this system in another one.
    pub(crate) fn across_to(&self, other: &Self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let mut point = self.inward([x, y]);
        match (&self.unshifted, &other.unshifted) {
            // The registry has other parameters for one datum in different countries; between two systems of it there is nothing to shift.
            (Some((from, _)), Some((to, _))) if self.is_same_datum(other) => transform(from, to, &mut point),
            _ => transform(&self.proj, &other.proj, &mut point),
        }
        .ok()?;
        other.outward(point)
    }

    /// Whether the datum is told by a grid that is not here, so that places are off by its shift where they are brought to another datum.
    pub(crate) fn is_shift_lost(&self) -> bool {
        self.lost.is_some()
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

/// The string with the sphere of the ellipsoid's area for `+R_A`, and that of its equator for `+f=0` beside an ellipsoid: its formulas are those of the sphere, and latitudes stay those of the
/// ellipsoid, so that no shift of datum may be made between both.
fn on_sphere(text: String) -> String {
    // Miller's is drawn so by PROJ, whether a string says it or not.
    let is_of_area =
        from_proj::word(&text, "R_A").is_some() || from_proj::word(&text, "proj") == Some("mill");
    let has_no_flattening = from_proj::word(&text, "f").is_some_and(|f| f.parse() == Ok(0.0));
    if !is_of_area && !has_no_flattening {
        return text;
    }
    let bare = without(&text, if is_of_area { &["R_A"] } else { &["f"] });
    let Some([a, b]) = axes_of(&bare).filter(|[a, b]| is_of_area || a - b > 1.0) else { return text };
    let e2 = 1.0 - (b / a) * (b / a);
    let of_area = a * (1.0 - e2 * (1.0 / 6.0 + e2 * (17.0 / 360.0 + e2 * 67.0 / 3024.0)));
    let radius = if is_of_area { of_area } else { a };
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

/// The datum of a string that says nothing of its shift, where the ellipsoid is none of those that lie as WGS 84's does, nor a sphere.
fn untied(text: &str, datum: &str) -> Option<String> {
    if ["towgs84", "datum", "nadgrids"].iter().any(|word| from_proj::word(text, word).is_some()) {
        return None;
    }
    let [a, b] = axes_of(text)?;
    let is_like_wgs84 = (a - WGS84_M[0]).abs() < 5.0 && (b - WGS84_M[1]).abs() < 5.0;
    (is_earth(a) && a - b > 1.0 && !is_like_wgs84).then(|| format!("{datum} {a} {b}"))
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
mod places_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod texts_tests;
