//! Where the samples of a field lie (section 3): longitude and latitude, or a map projection.
//!
//! A grid on a map says where its first sample is by longitude and latitude; that is projected here. It is the first in the order of the file, as the standard has it; GDAL 3.6 and ecCodes 2.50 take it for the
//! south-western one. Its body is a sphere more often than not, and stays one. Rows are read in the order of the file: which way they run
//! is in the signs of the steps. Cost: a projected point.

use super::Fault;
use super::section::Section;
use crate::crs::{Ground, by_text};
use terrasoar_layout::words::number;

/// Numbers that are not stated.
const MISSING: u32 = u32::MAX;
/// Parts of a degree in which places are told.
const MICRODEGREES: f64 = 1e-6;

/// A grid.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    /// Samples of a line, and lines, in the order of the file.
    pub(super) samples: [u32; 2],
    /// Whether every other line runs backwards.
    pub(super) is_ploughed: bool,
    /// From a place in a line, and the line, to coordinates.
    pub(super) map: [f64; 6],
    /// The reference system as a PROJ string.
    pub(super) system: String,
    /// What does not go together, in words.
    pub(super) warning: Option<String>,
}

/// First sample, steps to the east and north without signs, and what they are in.
struct Laid {
    first: [f64; 2],
    steps: [f64; 2],
    system: String,
    warning: Option<String>,
}

impl Grid {
    /// Of section 3.
    ///
    /// # Errors
    /// [`Fault::Unsupported`] for grids without regular steps and systems that are not known here.
    pub(super) fn of(section: &Section) -> Result<Self, Fault> {
        if section.u8(6) != 0 {
            return Err(Fault::Unsupported("its grid is one of a centre's own list".into()));
        }
        let template = section.u16(13);
        let (last, scanning) = match template {
            0 => (72, 72),
            10 => (72, 60),
            12 => (84, 60),
            20 => (65, 65),
            30 | 31 => (81, 65),
            140 => (64, 64),
            _ => return Err(refused(template)),
        };
        if !section.reaches(last) {
            return Err(Fault::Damaged("its grid is cut short"));
        }
        if section.u8(11) != 0 {
            return Err(Fault::Uneven("its rows are of unlike lengths (a reduced grid)".into()));
        }
        let [across, down] = [31, 35].map(|octet| section.u32(octet));
        if u64::from(across) * u64::from(down) != u64::from(section.u32(7)) {
            return Err(Fault::Damaged("its columns and rows do not make its number of points"));
        }
        if across < 2 || down < 2 || across.max(down) > i32::MAX as u32 {
            return Err(Fault::Unsupported(format!(
                "{across} x {down} samples are no terrain; at least 2 x 2 are needed"
            )));
        }
        let mode = section.u8(scanning);
        if mode & 0x0f != 0 {
            return Err(Fault::Uneven("its lines are shifted against each other".into()));
        }
        let laid = match template {
            0 => degrees(section, [across, down])?,
            10 => mercator(section, across)?,
            12 => transverse(section)?,
            20 => polar(section)?,
            30 | 31 => conic(section, template)?,
            _ => equal_area(section)?,
        };
        let [x, y] = laid.first;
        let [dx, dy] = laid.steps;
        if ![x, y, dx, dy].iter().all(|value| value.is_finite()) || dx <= 0.0 || dy <= 0.0 {
            return Err(Fault::Damaged("its steps are none"));
        }
        let (dx, dy) = (if mode & 0x80 == 0 { dx } else { -dx }, if mode & 0x40 == 0 { -dy } else { dy });
        let runs_down = mode & 0x20 != 0;
        Ok(Self {
            samples: if runs_down { [down, across] } else { [across, down] },
            is_ploughed: mode & 0x10 != 0,
            map: if runs_down { [x, 0.0, dx, y, dy, 0.0] } else { [x, dx, 0.0, y, 0.0, dy] },
            system: laid.system,
            warning: laid.warning,
        })
    }
}

fn refused(template: u16) -> Fault {
    match template {
        1 => Fault::Warped("it is on rotated longitudes and latitudes".into()),
        90 => Fault::Warped("it is seen from a satellite".into()),
        4 | 5 => Fault::Uneven("its steps in longitude and latitude vary".into()),
        40..=43 => Fault::Uneven("its rows are those of a Gaussian grid".into()),
        50..=53 => Fault::Spectral,
        100 | 101 => Fault::Unsupported("its samples lie on triangles".into()),
        _ => Fault::Unsupported(format!("its grid is template 3.{template}")),
    }
}

/// The body as words of a PROJ string.
fn body(section: &Section) -> Result<String, Fault> {
    let length = |octet: usize| section.scaled(octet).filter(|metres| metres.is_finite() && *metres > 0.0);
    let none = Fault::Damaged("it does not say how large its body is");
    let axes = |unit: f64| {
        let [a, b] = [21, 26].map(|octet| length(octet).map(|metres| metres * unit));
        a.zip(b).map(|(a, b)| format!("+a={a} +b={b}"))
    };
    match section.u8(15) {
        0 => Ok("+R=6367470".into()),
        1 => length(16).map(|radius| format!("+R={radius}")).ok_or(none),
        2 => Ok("+a=6378160 +rf=297".into()),
        3 => axes(1000.0).ok_or(none),
        4 => Ok("+ellps=GRS80".into()),
        5 => Ok("+datum=WGS84".into()),
        7 => axes(1.0).ok_or(none),
        8 => Ok("+R=6371200".into()),
        9 => Ok("+ellps=airy".into()),
        6 | 255 => Ok("+R=6371229".into()),
        code => Err(Fault::Unsupported(format!("its body is code {code} of GRIB table 3.2"))),
    }
}

fn degree(section: &Section, octet: usize) -> f64 {
    section.i32(octet) as f64 * MICRODEGREES
}

/// Longitude and latitude of the first sample, in degrees, from the octet of the latitude on.
fn first(section: &Section, octet: usize) -> [f64; 2] {
    [degree(section, octet + 4), degree(section, octet)]
}

/// Longitudes and latitudes.
fn degrees(section: &Section, samples: [u32; 2]) -> Result<Laid, Fault> {
    let (angle, parts) = (section.u32(39), section.u32(43));
    let unit = match (angle, parts) {
        (0 | MISSING, _) | (_, 0 | MISSING) => MICRODEGREES,
        (angle, parts) => f64::from(angle) / f64::from(parts),
    };
    let at = |octet: usize| section.i32(octet) as f64 * unit;
    let [lat, lon, last_lat, last_lon] = [47, 51, 56, 60].map(at);
    if lat.abs() > 90.0 + unit || last_lat.abs() > 90.0 + unit || lon.abs() > 720.0 || last_lon.abs() > 720.0
    {
        return Err(Fault::Damaged("its corners lie on no globe"));
    }
    let mode = section.u8(72);
    let span = if mode & 0x80 == 0 { last_lon - lon } else { lon - last_lon }.rem_euclid(360.0);
    let spans = [if span < unit { 360.0 } else { span }, (last_lat - lat).abs()];
    let gaps = samples.map(|count| f64::from(count - 1));
    let flags = section.u8(55);
    let stated = [(64, 0x20), (68, 0x10)].map(|(octet, flag)| {
        let step = section.u32(octet);
        (flags & flag != 0 && step != MISSING && step != 0).then(|| f64::from(step) * unit)
    });
    let mut warning = None;
    let steps = [0, 1].map(|i| {
        let by_corners = spans[i] / gaps[i];
        match stated[i] {
            // Corners tell a step the better the farther apart they are; each number is rounded.
            Some(step) if (step - by_corners).abs() > unit => {
                let [said, found] = [step, by_corners].map(|degrees| number((degrees * 1e7).round() / 1e7));
                warning = Some(format!(
                    "its steps are {said} degrees, and {found} by its corners; the steps were taken"
                ));
                step
            }
            _ => by_corners,
        }
    });
    let last = if mode & 0x40 == 0 { lat - steps[1] * gaps[1] } else { lat + steps[1] * gaps[1] };
    if last.abs() > 90.0 + 0.5 * steps[1] {
        return Err(Fault::Damaged("its rows lead beyond a pole"));
    }
    let runs_east = mode & 0x80 == 0;
    let west = if runs_east { lon } else { lon - steps[0] * gaps[0] };
    // What lies wholly in the western hemisphere is counted from Greenwich to the west.
    let shift = if west >= 180.0 { -360.0 } else { 0.0 };
    Ok(Laid {
        first: [lon + shift, lat],
        steps,
        system: format!("+proj=longlat {}", body(section)?),
        warning,
    })
}

/// Where a place in degrees is on a map.
fn on_map(system: &str, body: &str, [lon, lat]: [f64; 2]) -> Result<[f64; 2], Fault> {
    let ground = |text: &str| by_text(text).and_then(|system| Ground::new(&system));
    let (Some(globe), Some(map)) = (ground(&format!("+proj=longlat {body}")), ground(system)) else {
        return Err(Fault::Damaged("its map projection cannot be"));
    };
    let lon = if lon > 180.0 { lon - 360.0 } else { lon };
    globe.across_to(&map, [lon, lat]).ok_or(Fault::Damaged("its first sample lies outside of its map"))
}

/// Steps in millimetres, from an octet on.
fn steps(section: &Section, octet: usize) -> [f64; 2] {
    [octet, octet + 4].map(|octet| f64::from(section.u32(octet)) / 1000.0)
}

fn mercator(section: &Section, across: u32) -> Result<Laid, Fault> {
    let body = body(section)?;
    let steps = steps(section, 65);
    let at = first(section, 39);
    let system =
        |middle: f64| format!("+proj=merc +lat_ts={} +lon_0={middle} {body} +units=m", degree(section, 48));
    let orientation = if section.u32(61) == MISSING { 0.0 } else { degree(section, 61) };
    let mut found = (system(orientation), on_map(&system(orientation), &body, at)?);
    let edge = on_map(&system(orientation), &body, [orientation + 179.999_999, 0.0])?[0];
    let runs_east = section.u8(60) & 0x80 == 0;
    let east = found.1[0] + if runs_east { steps[0] * f64::from(across - 1) } else { 0.0 };
    if east > edge.abs() {
        // The map is cut elsewhere, so that the grid is whole.
        let middle = if at[0] > 180.0 { at[0] - 360.0 } else { at[0] };
        found = (system(middle), on_map(&system(middle), &body, at)?);
    }
    Ok(Laid { first: found.1, steps, system: found.0, warning: None })
}

fn transverse(section: &Section) -> Result<Laid, Fault> {
    let [lat, lon] = [39, 43].map(|octet| degree(section, octet));
    let centimetres = |octet: usize| section.i32(octet) as f64 / 100.0;
    let [x0, y0, x, y] = [52, 56, 69, 73].map(centimetres);
    let k = section.f32(48);
    let system = format!(
        "+proj=tmerc +lat_0={lat} +lon_0={lon} +k={k} +x_0={x0} +y_0={y0} {} +units=m",
        body(section)?
    );
    let steps = [61, 65].map(|octet| f64::from(section.u32(octet)) / 100.0);
    Ok(Laid { first: [x, y], steps, system, warning: None })
}

fn polar(section: &Section) -> Result<Laid, Fault> {
    let body = body(section)?;
    let pole = if section.u8(64) & 0x80 == 0 { 90 } else { -90 };
    let [true_at, down] = [48, 52].map(|octet| degree(section, octet));
    let system = format!("+proj=stere +lat_0={pole} +lat_ts={true_at} +lon_0={down} {body} +units=m");
    let first = on_map(&system, &body, first(section, 39))?;
    Ok(Laid { first, steps: steps(section, 56), system, warning: None })
}

fn conic(section: &Section, template: u16) -> Result<Laid, Fault> {
    let body = body(section)?;
    let name = if template == 30 { "lcc" } else { "aea" };
    let [middle, lon, one, two] = [48, 52, 66, 70].map(|octet| degree(section, octet));
    let system =
        format!("+proj={name} +lat_1={one} +lat_2={two} +lat_0={middle} +lon_0={lon} {body} +units=m");
    let first = on_map(&system, &body, first(section, 39))?;
    Ok(Laid { first, steps: steps(section, 56), system, warning: None })
}

fn equal_area(section: &Section) -> Result<Laid, Fault> {
    let body = body(section)?;
    let [lat, lon] = [47, 51].map(|octet| degree(section, octet));
    let system = format!("+proj=laea +lat_0={lat} +lon_0={lon} {body} +units=m");
    let first = on_map(&system, &body, first(section, 39))?;
    Ok(Laid { first, steps: steps(section, 56), system, warning: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A section 3 with these octets at these places, counted from 1.
    fn section(octets: &[(usize, &[u8])]) -> Section {
        let mut bytes = vec![0; 72];
        for (at, values) in octets {
            bytes[at - 1..at - 1 + values.len()].copy_from_slice(values);
        }
        Section(bytes)
    }

    #[test]
    fn bodies_are_those_of_the_table() {
        let of = |octets: &[(usize, &[u8])]| body(&section(octets)).map_err(|fault| format!("{fault:?}"));
        for (code, wanted) in [(0, "+R=6367470"), (4, "+ellps=GRS80"), (5, "+datum=WGS84"), (6, "+R=6371229")]
        {
            assert_eq!(of(&[(15, &[code])]).unwrap(), wanted);
        }
        // 637,137,000 hundredths of a metre, and thousandths of kilometres.
        let radius = 637_137_000u32.to_be_bytes();
        assert_eq!(of(&[(15, &[1, 2]), (17, &radius)]).unwrap(), "+R=6371370");
        let [a, b] = [6_378_160u32, 6_356_775].map(u32::to_be_bytes);
        let axes = [(15, &[3][..]), (21, &[3]), (22, &a), (26, &[3]), (27, &b)];
        assert_eq!(of(&axes).unwrap(), "+a=6378160 +b=6356775");
        let axes = [(15, &[7][..]), (22, &a), (27, &b)];
        assert_eq!(of(&axes).unwrap(), "+a=6378160 +b=6356775");
        assert!(of(&[(15, &[1])]).is_err() && of(&[(15, &[99])]).is_err());
        // Each is a system that places can be brought out of.
        for code in [0, 2, 4, 5, 6, 8, 9] {
            let text = of(&[(15, &[code])]).unwrap();
            let found = on_map(
                &format!("+proj=stere +lat_0=90 +lat_ts=60 +lon_0=0 {text} +units=m"),
                &text,
                [0.0, 60.0],
            );
            let [x, y] = found.unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
            assert!(x.abs() < 1e-6 && (-3.4e6..-3.1e6).contains(&y), "{text}: {x} {y}");
        }
    }
}
