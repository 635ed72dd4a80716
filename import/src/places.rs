//! Places on the ground: coordinates of a terrain's own reference system, or of another, to metres from its south-west sample and back.
//!
//! Coordinates are east before north in every system: longitude before latitude. A [`Frame`] is a terrain seen in one system. Longitudes may have any number of full turns added. Datums are
//! shifted by parameters. Where the shift needs a grid, which is not here, or is not known, it is left out and [`Frame::doubt`] says so. Cost: in the terrain's own system a few operations a place, in
//! others a microsecond.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use terrasoar_import::places::{Crs, Frame};
//! use terrasoar_import::synth::{SynthOptions, write};
//! use terrasoar_layout::build::{BuildOptions, build};
//! use terrasoar_layout::progress::Silent;
//! # let folder = tempfile::tempdir()?;
//! # let (dem, out) = (folder.path().join("made-up.tif"), folder.path().join("made-up.iqt"));
//! write(&SynthOptions::default().size(65), &dem, &|_| {})?;
//! let header = build(&*terrasoar_import::open_file(&dem)?, &out, &BuildOptions::default(), &Silent)?;
//! if let Some(own) = Frame::own(&header) {
//!     let [east, north] = own.coordinates([0.0, 0.0]).ok_or("no coordinates")?;
//!     assert_eq!(own.place_m([east, north]), Some([0.0, 0.0]));
//! }
//! assert!(Crs::named("EPSG:4326")?.is_geographic());
//! # Ok(())
//! # }
//! ```

pub use crate::crs::Doubt;
use crate::crs::{Ground, HorizontalSize, Kind, System, Unit, all_over, by_text, is_earth};
use terrasoar_layout::dem::HorizontalUnit;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::words::harmless;

/// Steps on each side of the mesh whose points tell how far a terrain reaches.
const MESH: u32 = 64;
/// A place at most so many samples off a sample means that sample. This is the rounding of projections, far less than can be measured.
const SNAP: f64 = 1e-6;

/// A reference system that coordinates are given in.
#[derive(Debug, Clone)]
pub struct Crs {
    system: System,
    ground: Option<Ground>,
}

impl Crs {
    /// The system that a person names: "EPSG:n", WKT or a PROJ string.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for what is not known, and for systems that no place on the ground follows from.
    pub fn named(text: &str) -> Result<Self, LayoutError> {
        let shown = harmless(text, 60);
        let system = by_text(text).ok_or_else(|| {
            LayoutError::Usage(format!(
                "\"{shown}\" is no reference system that is known here; name one as EPSG:n, WKT or a PROJ string"
            ))
        })?;
        let ground = Ground::new(&system).ok_or_else(|| {
            LayoutError::Usage(format!(
                "from \"{shown}\" no place on the ground follows here; name a system that is tied to it, such as EPSG:4326 for longitude and latitude"
            ))
        })?;
        Ok(Self { system, ground: Some(ground) })
    }

    /// Longitude and latitude of WGS 84, in degrees; `None` only if the registry lacks it.
    pub fn wgs84() -> Option<Self> {
        Self::named("EPSG:4326").ok()
    }

    /// The system that a terrain file is in; `None` where it knows none.
    pub fn of(header: &Header) -> Option<Self> {
        let about = &header.about;
        let by_code = || header.epsg.and_then(|code| by_text(&format!("EPSG:{code}")));
        let by_own_text = by_text(&about.crs_text).filter(|_| !about.crs_text.is_empty());
        let found = match by_own_text {
            // A PROJ string that the registry gave has neither name nor code.
            Some(said) if said.code.is_none() => {
                Some(by_code().filter(|code| code.text == said.text).unwrap_or(said))
            }
            Some(said) => Some(said),
            None => by_code(),
        };
        let mut system = found.unwrap_or_else(System::unknown);
        if let Some(unit) = unit_of(header) {
            // What the data states by itself wins over the registry.
            if system.unit.as_ref().is_none_or(|known| known.size != unit.size) {
                system.unit = Some(unit);
            }
        }
        system.radius_m = system.radius_m.or(header.body_radius_m);
        let is_angle =
            system.unit.as_ref().is_some_and(|unit| matches!(unit.size, HorizontalSize::Radians(_)));
        if system.kind == Kind::Unknown {
            if is_angle {
                system.kind = Kind::Geographic;
            } else if header.crs_name.is_empty() {
                return None;
            }
        }
        if system.name.is_empty() {
            system.name.clone_from(&header.crs_name);
        }
        let ground = Ground::new(&system);
        Some(Self { system, ground })
    }

    /// A system that a file names.
    pub(crate) fn of_system(system: System) -> Self {
        let ground = Ground::new(&system);
        Self { system, ground }
    }

    /// Whether anything is known of it.
    pub(crate) fn is_said(&self) -> bool {
        self.system.kind != Kind::Unknown || self.system.unit.is_some()
    }

    /// Whether it is a site's own system of lengths, tied to nothing.
    pub(crate) fn is_site(&self) -> bool {
        matches!(self.system.kind, Kind::Local | Kind::Unknown) && self.ground.is_none()
    }

    /// The way to the ground, if there is one.
    pub(crate) fn ground(&self) -> Option<&Ground> {
        self.ground.as_ref()
    }

    /// All that is known of it.
    pub(crate) fn system(&self) -> &System {
        &self.system
    }

    /// Its name, with its code: "WGS 84 / UTM zone 32N (EPSG:32632)".
    pub fn name(&self) -> String {
        let name = harmless(&self.system.name, 200);
        match (name.as_str(), self.system.code) {
            ("", None) if self.is_geographic() => "longitude and latitude".into(),
            ("", None) => "a system without a name".into(),
            ("", Some(code)) => format!("EPSG:{code}"),
            (_, Some(code)) => format!("{name} (EPSG:{code})"),
            (_, None) => name,
        }
    }

    /// The system in full: WKT or a PROJ string; empty where only its name is known.
    pub fn text(&self) -> &str {
        &self.system.text
    }

    /// Whether coordinates are longitude and latitude.
    pub fn is_geographic(&self) -> bool {
        self.system.kind == Kind::Geographic
    }

    /// Whether its places are on the Earth, as far as is known.
    pub fn is_on_earth(&self) -> bool {
        match &self.ground {
            Some(ground) => is_earth(ground.radius_m()),
            None => self.system.radius_m.is_none_or(is_earth),
        }
    }

    /// Once around the globe, where that leads to the same place.
    pub(crate) fn turn(&self) -> Option<f64> {
        let HorizontalSize::Radians(size) = self.system.unit.as_ref()?.size else {
            return self.ground.as_ref().and_then(Ground::turn);
        };
        Some(std::f64::consts::TAU / size)
    }

    /// Whether no more is known than a unit, and perhaps a name.
    pub(crate) fn is_unnamed(&self) -> bool {
        self.system.code.is_none() && self.system.proj.is_none()
    }

    /// Whether coordinates of both are the same numbers.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let [a, b] = [&self.system, &other.system];
        let size = |system: &System| system.unit.as_ref().map(|unit| unit.size);
        let is_proj_same = match (&a.proj, &b.proj) {
            (Some(a), Some(b)) => a == b,
            // A site's own system has no more than its name.
            (None, None) if self.is_site() && other.is_site() && a.code.or(b.code).is_none() => {
                !a.name.is_empty() && a.name == b.name && a.text == b.text
            }
            _ => a.code.is_some() && a.code == b.code,
        };
        is_proj_same && size(a) == size(b) && a.signs == b.signs
    }
}

/// Metres a unit of the terrain's own coordinates; `None` where they are angles, or their unit is not known.
pub fn coordinate_unit_m(header: &Header) -> Option<f64> {
    match unit_of(header)?.size {
        HorizontalSize::Metres(metres) => Some(metres),
        HorizontalSize::Radians(_) => None,
    }
}

/// The unit that a header states.
fn unit_of(header: &Header) -> Option<Unit> {
    if let Some(unit) = &header.about.horizontal_unit {
        let size = if unit.is_angle {
            HorizontalSize::Radians(unit.size)
        } else {
            HorizontalSize::Metres(unit.size)
        };
        return Some(Unit { name: unit.name.clone(), size });
    }
    let (name, size) = match header.crs_unit {
        HorizontalUnit::Unknown => return None,
        HorizontalUnit::Metre => ("metre", HorizontalSize::Metres(1.0)),
        HorizontalUnit::Degree => ("degree", HorizontalSize::Radians(1f64.to_radians())),
        HorizontalUnit::Foot => ("foot", HorizontalSize::Metres(0.3048)),
        HorizontalUnit::UsSurveyFoot => ("US survey foot", HorizontalSize::Metres(1200.0 / 3937.0)),
    };
    Some(Unit { name: name.into(), size })
}

/// A terrain, seen in one reference system.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Samples east and north of the south-west one to the terrain's own coordinates.
    map: [f64; 6],
    spacing_m: [f64; 2],
    /// The last sample, east and north.
    last: [f64; 2],
    own: Option<Crs>,
    /// The system, where that is not the terrain's own.
    other: Option<Crs>,
    /// Whether the other one's coordinates are the own ones.
    is_same: bool,
}

impl Frame {
    /// The terrain in its own coordinates; `None` where the file does not say where it lies.
    pub fn own(header: &Header) -> Option<Self> {
        let map = header.sample_to_crs?;
        let area = map[1] * map[5] - map[2] * map[4];
        if !map.iter().all(|m| m.is_finite()) || !area.is_normal() {
            return None;
        }
        Some(Self {
            map,
            spacing_m: header.grid.spacing_m(),
            last: header.grid.samples().map(|count| f64::from(count - 1)),
            own: Crs::of(header),
            other: None,
            is_same: true,
        })
    }

    /// The terrain in the coordinates of `crs`.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] in words where the file does not say where it lies, or in which system, or where that is on another body.
    pub fn of(header: &Header, crs: &Crs) -> Result<Self, LayoutError> {
        let usage = |words: String| Err(LayoutError::Usage(words));
        let Some(own) = Self::own(header) else {
            return usage("the terrain does not know where on the ground it lies, for its elevation model did not say; give metres from its corner".into());
        };
        let Some(system) = &own.own else {
            return usage("the terrain does not know its reference system, for its elevation model did not say; give its own coordinates, or build it again and name the system".into());
        };
        let is_same = system.is_same(crs);
        if !is_same && system.ground.is_none() {
            return usage(format!(
                "from the terrain's reference system, {}, no other one can be reached here; give its own coordinates",
                system.name()
            ));
        }
        if system.is_on_earth() != crs.is_on_earth() {
            return usage(format!(
                "the terrain is in {}, and {} is a system of another body",
                system.name(),
                crs.name()
            ));
        }
        Ok(Self { other: Some(crs.clone()), is_same, ..own })
    }

    /// The terrain in degrees of longitude and latitude of WGS 84; `None` where that cannot be known.
    pub fn wgs84(header: &Header) -> Option<Self> {
        Self::of(header, &Crs::wgs84()?).ok()
    }

    /// The system; `None` where it is the terrain's own, which is not known.
    pub fn crs(&self) -> Option<&Crs> {
        self.other.as_ref().or(self.own.as_ref())
    }

    /// How far places may be off, where the shift between the two datums is not known well.
    pub fn doubt(&self) -> Option<Doubt> {
        let ground = |crs: &'_ Option<Crs>| crs.as_ref().and_then(|crs| crs.ground.clone());
        let places = all_over(&self.map, self.last.map(|last| last as u32 + 1));
        ground(&self.own)?.doubt(&ground(&self.other)?, &places).filter(|_| !self.is_same)
    }

    /// Metres east and north of the south-west sample to coordinates; `None` where the projection has none. Longitudes of other systems than the own one lie within half a turn of 0.
    pub fn coordinates(&self, place_m: [f64; 2]) -> Option<[f64; 2]> {
        let [x, y] = [place_m[0] / self.spacing_m[0], place_m[1] / self.spacing_m[1]];
        let m = &self.map;
        let mut point = [m[0] + m[1] * x + m[2] * y, m[3] + m[4] * x + m[5] * y];
        let (Some(other), Some(own)) = (&self.other, &self.own) else { return Some(point) };
        if !self.is_same {
            if let Some(turn) = own.turn().filter(|_| own.is_geographic()) {
                point[0] = near_zero(point[0], turn);
            }
            point = own.ground.as_ref()?.across_to(other.ground.as_ref()?, point)?;
        }
        if let Some(turn) = other.turn().filter(|_| other.is_geographic()) {
            point[0] = near_zero(point[0], turn);
        }
        Some(point)
    }

    /// Coordinates to metres east and north of the south-west sample, inside of the terrain or not; `None` where the projection has no such place.
    pub fn place_m(&self, mut point: [f64; 2]) -> Option<[f64; 2]> {
        if let (Some(other), Some(own), false) = (&self.other, &self.own, self.is_same) {
            if let Some(turn) = other.turn().filter(|_| other.is_geographic()) {
                point[0] = near_zero(point[0], turn);
            }
            point = other.ground.as_ref()?.across_to(own.ground.as_ref()?, point)?;
        }
        let m = &self.map;
        if let Some(turn) = self.own.as_ref().and_then(Crs::turn) {
            let centre = m[0] + 0.5 * (m[1] * self.last[0] + m[2] * self.last[1]);
            let turns = ((point[0] - centre) / turn).round();
            // Not to lose a bit where there is nothing to turn.
            if turns != 0.0 {
                point[0] -= turn * turns;
            }
        }
        let area = m[1] * m[5] - m[2] * m[4];
        let [dx, dy] = [point[0] - m[0], point[1] - m[3]];
        let samples = [(dx * m[5] - dy * m[2]) / area, (dy * m[1] - dx * m[4]) / area];
        let place_m: [f64; 2] = std::array::from_fn(|axis| {
            let near = samples[axis].round();
            let at = if (samples[axis] - near).abs() <= SNAP { near } else { samples[axis] };
            at * self.spacing_m[axis]
        });
        place_m.iter().all(|m| m.is_finite()).then_some(place_m)
    }

    /// Least x and y and greatest x and y of the terrain, from its first sample to its last. Longitudes are those around the centre's, so that a terrain across the antimeridian
    /// ends beyond half a turn. `None` where the projection does not have all of it.
    pub fn bounds(&self) -> Option<[f64; 4]> {
        let turn = self.crs().filter(|crs| crs.is_geographic()).and_then(Crs::turn);
        let extent = [0, 1].map(|axis| self.last[axis] * self.spacing_m[axis]);
        let centre = self.coordinates(extent.map(|m| 0.5 * m))?;
        let steps = if self.other.is_none() || self.is_same { 1 } else { MESH };
        let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for i in 0..=steps {
            for j in 0..=steps {
                let part = |of: u32| f64::from(of) / f64::from(steps);
                let [mut x, y] = self.coordinates([part(i) * extent[0], part(j) * extent[1]])?;
                if let (Some(turn), Some(_)) = (turn, &self.other) {
                    if self.is_same {
                        // The own numbers, whatever their turn.
                        let m = &self.map;
                        x = m[0] + m[1] * part(i) * self.last[0] + m[2] * part(j) * self.last[1];
                    } else {
                        x -= turn * ((x - centre[0]) / turn).round();
                    }
                }
                bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
            }
        }
        // Around a pole there are all longitudes.
        if let (Some(turn), Some(_), false) = (turn, &self.other, self.is_same) {
            for (pole, side) in [(-0.25 * turn, 1), (0.25 * turn, 3)] {
                let is_in = |m: [f64; 2]| (0..2).all(|axis| (0.0..=extent[axis]).contains(&m[axis]));
                if self.place_m([0.0, pole]).is_some_and(is_in) {
                    (bounds[0], bounds[2], bounds[side]) = (-0.5 * turn, 0.5 * turn, pole);
                }
            }
        }
        Some(bounds)
    }

    /// As [`Frame::bounds`], of longitude and latitude in degrees: west, south, east and north, with longitudes from -180 to 180; west is greater than east across the antimeridian.
    pub fn bounds_deg(&self) -> Option<[f64; 4]> {
        let turn = self.crs().filter(|crs| crs.is_geographic()).and_then(Crs::turn)?;
        let [west, south, east, north] = self.bounds()?.map(|angle| angle * (360.0 / turn));
        if east - west >= 360.0 {
            return Some([-180.0, south, 180.0, north]);
        }
        Some([near_zero(west, 360.0), south, near_zero(east, 360.0), north])
    }
}

/// An angle without full turns, within half a turn of 0.
fn near_zero(angle: f64, turn: f64) -> f64 {
    if angle.abs() <= 0.5 * turn { angle } else { angle - turn * (angle / turn).round() }
}

#[cfg(test)]
#[path = "places/tests.rs"]
mod tests;
