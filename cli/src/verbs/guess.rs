//! What places may have been meant as, where the system they were read in does not fit them.
//!
//! **A place that lies outside is tried in the other systems that people use; one that was read as metres from the corner and looks like something else is told.** Nothing is ever read in
//! another system than was asked for: a guess is words, and the flag to type. Cost: a projection a place and system, of at most a thousand places.

use super::siting::reach;
use terrasoar_import::places::{Crs, Frame};
use terrasoar_layout::file::header::Header;

/// Places that are looked at, at most.
pub(super) const PLACES: usize = 1000;
/// Metres that a terrain extends, from which on places of a few metres are more likely degrees.
const LARGE_M: f64 = 5000.0;

/// A way to read places.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum System {
    /// As they were read.
    Same,
    /// Metres from the south-west sample.
    Local,
    /// The elevation model's own coordinates.
    Dem,
    /// Longitude and latitude.
    Degrees,
}

/// What places may be meant as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Guess {
    pub(super) system: System,
    /// Whether the two numbers stand in the other order.
    pub(super) is_swapped: bool,
}

impl Guess {
    /// What the system is called after --crs; `None` for metres from the corner, and for the one that was asked for.
    pub(super) fn crs(self) -> Option<&'static str> {
        match self.system {
            System::Same | System::Local => None,
            System::Dem => Some("dem"),
            System::Degrees => Some("EPSG:4326"),
        }
    }

    /// How they would be read: "in the elevation model's coordinates (--crs dem)".
    pub(super) fn words(self) -> String {
        let system = match self.system {
            System::Same => "",
            System::Local => "in metres from the terrain's south-west sample (without --crs)",
            System::Dem => "in the elevation model's coordinates (--crs dem)",
            System::Degrees => "as degrees of longitude and latitude (--crs EPSG:4326)",
        };
        let swapped = "with the two numbers swapped (east comes before north, longitude before latitude)";
        match (self.is_swapped, system) {
            (true, "") => swapped.into(),
            (true, system) => format!("{system}, {swapped}"),
            (false, system) => system.into(),
        }
    }
}

/// In which other way most of these places, all of them outside, would lie inside.
pub(super) fn of_outside(header: &Header, frame: Option<&Frame>, places: &[[f64; 2]]) -> Option<Guess> {
    let [own, degrees] = [Frame::own(header), Frame::wgs84(header)];
    let ways = [
        (own.as_ref(), System::Dem, false),
        (degrees.as_ref(), System::Degrees, false),
        (frame, System::Same, true),
        (own.as_ref(), System::Dem, true),
        (degrees.as_ref(), System::Degrees, true),
        (None, System::Local, false),
    ];
    ways.into_iter()
        .filter(|(frame, system, _)| frame.is_some() || matches!(system, System::Same | System::Local))
        .find(|(frame, _, is_swapped)| are_inside(header, *frame, places, *is_swapped))
        .map(|(_, system, is_swapped)| Guess { system, is_swapped })
}

/// Of places that were read as metres from the corner, and lie inside: what they look more like. Whether they lie inside then too.
pub(super) fn of_local(header: &Header, places: &[[f64; 2]]) -> Option<(Guess, bool)> {
    let [own, degrees] = [Frame::own(header), Frame::wgs84(header)];
    let look_like_degrees =
        places.iter().all(|[x, y]| x.abs() <= 180.0 && (y.abs() <= 90.0 || x.abs() <= 90.0));
    for is_swapped in [false, true] {
        if look_like_degrees && degrees.is_some() && are_inside(header, degrees.as_ref(), places, is_swapped)
        {
            return Some((Guess { system: System::Degrees, is_swapped }, true));
        }
    }
    if let Some(own) = own.filter(|own| is_elsewhere(header, own, places))
        && are_inside(header, Some(&own), places, false)
    {
        return Some((Guess { system: System::Dem, is_swapped: false }, true));
    }
    // Nobody says metres from a corner to the millimetre.
    let is_fine = |value: f64| (value * 100.0 - (value * 100.0).round()).abs() > 1e-6;
    let is_large = header.grid.extent_m().iter().all(|side| *side >= LARGE_M);
    (look_like_degrees
        && degrees.is_some()
        && is_large
        && places.iter().flatten().any(|value| is_fine(*value)))
    .then_some((Guess { system: System::Degrees, is_swapped: false }, false))
}

/// A note on places that were read as metres from the corner, if they look like something else.
pub(super) fn note_of_local(header: &Header, places: &[[f64; 2]]) -> Option<(String, Guess)> {
    let (guess, is_inside) = of_local(header, places)?;
    let (what, lie, look) = if places.len() == 1 {
        ("the place was", "it lies", "it looks")
    } else {
        ("the places were", "they lie", "they look")
    };
    let words = guess.words();
    let otherwise = if is_inside {
        format!("{words} {lie} inside too")
    } else {
        format!("{look} like degrees; type --crs EPSG:4326 if that is what they are")
    };
    let sides = reach(header, None).unwrap_or_default();
    Some((
        format!(
            "note: {what} read as metres from the terrain's south-west sample, which go {sides}; {otherwise}"
        ),
        guess,
    ))
}

/// A clause on places outside: ", and would lie inside in the elevation model's coordinates (--crs dem)". Empty without a guess.
pub(super) fn clause_of_outside(header: &Header, frame: Option<&Frame>, places: &[[f64; 2]]) -> String {
    of_outside(header, frame, places)
        .map(|guess| format!("; {} it would lie inside", guess.words()))
        .unwrap_or_default()
}

/// Whether a system's coordinates are other places than metres from the corner.
fn is_elsewhere(header: &Header, frame: &Frame, places: &[[f64; 2]]) -> bool {
    let half = header.grid.spacing_m().map(|m| 0.5 * m);
    places.iter().any(|place| {
        frame
            .place_m(*place)
            .is_none_or(|at_m| (0..2).any(|axis| (at_m[axis] - place[axis]).abs() > half[axis]))
    })
}

/// Whether most of them lie inside, seen so.
fn are_inside(header: &Header, frame: Option<&Frame>, places: &[[f64; 2]], is_swapped: bool) -> bool {
    let extent_m = header.grid.extent_m();
    let looked = &places[..places.len().min(PLACES)];
    let is_inside = |[x, y]: &[f64; 2]| {
        let place = if is_swapped { [*y, *x] } else { [*x, *y] };
        let at_m = frame.map_or(Some(place), |frame| frame.place_m(place));
        at_m.is_some_and(|at_m| (0..2).all(|axis| (0.0..=extent_m[axis]).contains(&at_m[axis])))
    };
    let inside = looked.iter().filter(|place| is_inside(place)).count();
    2 * inside > looked.len()
}

/// Whether a frame is of longitude and latitude.
pub(super) fn is_degrees(frame: Option<&Frame>) -> bool {
    frame.and_then(Frame::crs).is_some_and(Crs::is_geographic)
}
