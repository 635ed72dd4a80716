//! Places as people read and type them: the DEM's own coordinates, latitude and longitude, metres from the south-west sample.
//!
//! **What is shown can be typed.** Numbers with a letter of the compass are latitude and longitude; numbers with `m` are metres. Two plain numbers are the first of these that lies in the
//! terrain: the DEM's coordinates, latitude before longitude as maps on the web have it, metres. Cost: a projection or two a place.

use terrasoar_import::places::{Crs, Frame};
use terrasoar_layout::file::header::Header;

/// Metres by which rounding moves a place that is shown: five decimals of a degree.
const ROUNDED_BY_M: f64 = 1.2;

/// What a place may look like.
const FORMS: &str = "give the DEM's coordinates, east before north, or latitude and longitude such as 45.9763 N 7.6586 E, or metres from the south-west corner such as 1500 m, 820 m";

/// A terrain's coordinates.
#[derive(Debug, Clone)]
pub(crate) struct Coordinates {
    extent_m: [f64; 2],
    own: Option<Frame>,
    world: Option<Frame>,
    /// Decimals of own coordinates.
    digits: usize,
}

impl Coordinates {
    /// Those of the terrain that `header` describes.
    pub(crate) fn of(header: &Header) -> Self {
        let own = Frame::own(header);
        let is_degrees = own.as_ref().and_then(Frame::crs).is_some_and(Crs::is_geographic);
        // A place on the screen is known to a tenth of a sample or so.
        let step = header.sample_to_crs.map_or(1.0, |map| map[1].hypot(map[4]));
        let digits = if is_degrees { 6 } else { (-(0.1 * step).log10()).ceil().clamp(0.0, 6.0) as usize };
        Self { extent_m: header.grid.extent_m(), own, world: Frame::wgs84(header), digits }
    }

    /// A place in words: own coordinates, and latitude and longitude, as far as they are known; else metres.
    pub(crate) fn shown(&self, place_m: [f64; 2]) -> String {
        let world = self.world.as_ref().and_then(|frame| frame.coordinates(place_m)).map(|[lon, lat]| {
            let side = |value: f64, [plus, minus]: [char; 2]| {
                format!("{:.5}° {}", value.abs(), if value < 0.0 { minus } else { plus })
            };
            format!("{} {}", side(lat, ['N', 'S']), side(lon, ['E', 'W']))
        });
        let is_own_degrees = self.own.as_ref().and_then(Frame::crs).is_some_and(Crs::is_geographic);
        let own = self.own.as_ref().filter(|_| world.is_none() || !is_own_degrees);
        let own = own.and_then(|frame| frame.coordinates(place_m)).map(|[x, y]| {
            let digits = self.digits;
            format!("{x:.digits$}, {y:.digits$}")
        });
        match (own, world) {
            (Some(own), Some(world)) => format!("{own}   {world}"),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => format!("{:.0} m, {:.0} m", place_m[0], place_m[1]),
        }
    }

    /// The middle of the terrain as it may be typed.
    pub(crate) fn hint(&self) -> String {
        self.shown(self.extent_m.map(|m| 0.5 * m))
    }

    /// The place that `text` means, in metres.
    ///
    /// # Errors
    /// Why the text is no place, or that it lies outside, as a message.
    pub(crate) fn meant(&self, text: &str) -> Result<[f64; 2], String> {
        let no_place = || format!("{text:?} is no place: {FORMS}");
        let upper = text.to_uppercase();
        if upper.contains(['N', 'S', 'E', 'W', '°']) {
            let lat_lon = lat_lon(&upper).ok_or_else(no_place)?;
            let Some(world) = &self.world else {
                return Err("this terrain does not know its latitude and longitude; give its own coordinates, or metres from the south-west corner such as 1500 m, 820 m".into());
            };
            return self.inside(world.place_m(lat_lon)).ok_or_else(|| self.outside(text));
        }
        let is_metres = upper.contains('M');
        let numbers: Vec<f64> = upper
            .split([',', ' ', ';', '\t', 'M'])
            .filter(|word| !word.is_empty())
            .map(|word| word.parse().ok().filter(|n: &f64| n.is_finite()))
            .collect::<Option<_>>()
            .ok_or_else(no_place)?;
        let [first, second] = numbers[..] else { return Err(no_place()) };
        let own = || self.own.as_ref().and_then(|frame| self.inside(frame.place_m([first, second])));
        let world = || {
            let is_lat_lon = first.abs() <= 90.0 && second.abs() <= 360.0;
            let world = self.world.as_ref().filter(|_| is_lat_lon)?;
            self.inside(world.place_m([second, first]))
        };
        let metres = || self.inside(Some([first, second]));
        let found = if is_metres { metres() } else { own().or_else(world).or_else(metres) };
        found.ok_or_else(|| self.outside(text))
    }

    /// A place within the terrain. What is shown is rounded, so a place a hair outside means one on the edge.
    fn inside(&self, place_m: Option<[f64; 2]>) -> Option<[f64; 2]> {
        let place_m = place_m?;
        let nearest = [0, 1].map(|axis| place_m[axis].clamp(0.0, self.extent_m[axis]));
        let is_near = (0..2).all(|axis| (place_m[axis] - nearest[axis]).abs() <= ROUNDED_BY_M);
        is_near.then_some(nearest)
    }

    fn outside(&self, text: &str) -> String {
        let [wide, high] = self.extent_m;
        let mut words = format!(
            "{text} lies outside the terrain, which extends from 0 m, 0 m to {wide:.0} m, {high:.0} m"
        );
        if self.own.is_some() {
            words.push_str(&format!(
                ", that is from {} to {}",
                self.shown([0.0; 2]),
                self.shown(self.extent_m)
            ));
        }
        words
    }
}

/// Longitude and latitude in degrees, of a text in capitals with letters of the compass, before or after numbers of degrees, minutes and seconds; or with none and latitude first.
fn lat_lon(text: &str) -> Option<[f64; 2]> {
    let mut angles: Vec<(Option<char>, Vec<f64>)> = Vec::new();
    let (mut numbers, mut letter, mut is_first) = (Vec::new(), None, None);
    let spaced: String =
        text.chars().map(|c| if "NSEW".contains(c) { format!(" {c} ") } else { c.to_string() }).collect();
    for word in spaced.split([' ', ',', ';', '\t', '°', '\'', '"', '′', '″', '’', '”']) {
        match word {
            "" => {}
            "N" | "S" | "E" | "W" => {
                let this = word.chars().next();
                let leads = *is_first.get_or_insert(numbers.is_empty());
                if leads {
                    if !numbers.is_empty() {
                        angles.push((letter, std::mem::take(&mut numbers)));
                    }
                    letter = this;
                } else {
                    angles.push((this, std::mem::take(&mut numbers)));
                }
            }
            _ => numbers.push(word.parse::<f64>().ok().filter(|n| n.is_finite())?),
        }
    }
    match (is_first, &numbers[..]) {
        // Two angles with signs for degrees alone.
        (None, [lat, lon]) => angles.extend([(Some('N'), vec![*lat]), (Some('E'), vec![*lon])]),
        (Some(true), [_, ..]) => angles.push((letter, numbers)),
        (_, []) => {}
        _ => return None,
    }
    let mut found = [None; 2];
    for (letter, parts) in angles {
        if parts.is_empty() || parts.len() > 3 || parts[1..].iter().any(|part| !(0.0..60.0).contains(part)) {
            return None;
        }
        let size = parts.iter().rev().fold(0.0, |sum, part| sum / 60.0 + part.abs());
        let angle = if parts[0].is_sign_negative() { -size } else { size };
        let (axis, sign) = match letter? {
            'N' => (1, 1.0),
            'S' => (1, -1.0),
            'E' => (0, 1.0),
            _ => (0, -1.0),
        };
        if found[axis].replace(sign * angle).is_some() {
            return None;
        }
    }
    let [lon, lat] = [found[0]?, found[1]?];
    (lat.abs() <= 90.0 && lon.abs() <= 360.0).then_some([lon, lat])
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::build::{BuildOptions, build};
    use terrasoar_layout::dem::{Georeference, HorizontalUnit, MemoryDem, SampleType};
    use terrasoar_layout::progress::Silent;

    fn coordinates(georeference: Georeference) -> Coordinates {
        let folder = tempfile::tempdir().unwrap();
        let mut dem = MemoryDem::from_fn([1001, 501], SampleType::I16, |x, y| f64::from(x + y));
        dem.info_mut().georeference = georeference;
        let options = BuildOptions::default().spacing_m([10.0, 20.0]);
        Coordinates::of(&build(&dem, &folder.path().join("t.iqt"), &options, &Silent).unwrap())
    }

    fn utm() -> Coordinates {
        coordinates(Georeference {
            epsg: Some(32632),
            unit: HorizontalUnit::Metre,
            pixel_to_crs: Some([500_000.0, 10.0, 0.0, 5_010_000.0, 0.0, -20.0]),
            ..Georeference::default()
        })
    }

    fn is_near(found: Result<[f64; 2], String>, wanted: [f64; 2], tolerance: f64) -> bool {
        found.is_ok_and(|found| (0..2).all(|axis| (found[axis] - wanted[axis]).abs() <= tolerance))
    }

    /// 500070, 5000400 is 45.157077852 N 9.000890589 E by gdaltransform.
    #[test]
    fn every_way_to_write_a_place_is_understood() {
        let utm = utm();
        for text in [
            "500070, 5000400",
            "500070 5000400",
            "70 m, 400 m",
            "70m 400m",
            "45.157077852 N 9.000890589 E",
            "9.000890589e, 45.157077852n",
            "N45.157077852 E9.000890589",
            "45.157077852, 9.000890589",
            "45.157077852° 9.000890589°",
            "45°9'25.4803\"N 9°0'3.2061\"E",
            "45 9 25.4803 N, 9 0 3.2061 E",
            "45.157077852 S 9.000890589 W",
        ] {
            let found = utm.meant(text);
            let is_south = text.contains('S');
            assert_eq!(found.is_err(), is_south, "{text}: {found:?}");
            assert!(is_south || is_near(found.clone(), [70.0, 400.0], 0.02), "{text}: {found:?}");
        }
        assert!(is_near(utm.meant("70, 400"), [70.0, 400.0], 0.0), "metres, for nothing else lies there");
        assert_eq!(utm.shown([70.0, 400.0]), "500070, 5000400   45.15708° N 9.00089° E");
        for wrong in ["", "1", "1,2,3", "here", "1,x", "N E", "45 N 46 N", "45 61 0 N 9 E", "nan, 4", "45 N"]
        {
            assert!(utm.meant(wrong).unwrap_err().contains("is no place"), "{wrong}");
        }
        let far = utm.meant("10000000, 3").unwrap_err();
        assert!(far.contains("10000 m, 10000 m") && far.contains("500000, 5000000   45.15348° N"), "{far}");
    }

    #[test]
    fn what_is_shown_can_be_typed() {
        let degrees = coordinates(Georeference {
            epsg: Some(4326),
            unit: HorizontalUnit::Degree,
            pixel_to_crs: Some([-70.0, 0.001, 0.0, -33.0, 0.0, -0.002]),
            ..Georeference::default()
        });
        let nowhere = coordinates(Georeference::default());
        let unnamed = coordinates(Georeference {
            pixel_to_crs: Some([0.5, 0.1, 0.0, 77.0, 0.0, -0.1]),
            ..Georeference::default()
        });
        assert_eq!(degrees.shown([0.0, 0.0]), "34.00000° S 70.00000° W");
        assert_eq!(nowhere.shown([12.0, 34.0]), "12 m, 34 m");
        assert_eq!(unnamed.shown([100.0, 200.0]), "1.50, 28.00");
        for place in [[120.0, 340.0], [5000.0, 5000.0], [10_000.0, 10_000.0]] {
            for terrain in [&degrees, &nowhere, &unnamed, &utm()] {
                let shown = terrain.shown(place);
                for part in shown.split("   ") {
                    assert!(is_near(terrain.meant(part), place, 1.2), "{part}: {:?}", terrain.meant(part));
                }
            }
        }
        // East before north in the DEM's own degrees, though the other order is understood where that is meant.
        assert!(is_near(degrees.meant("-69.5, -33.5"), [5000.0, 5000.0], 1e-6));
        assert!(is_near(degrees.meant("-33.5, -69.5"), [5000.0, 5000.0], 1e-6));
        assert!(nowhere.meant("46 N 7 E").unwrap_err().contains("does not know its latitude"));
    }
}
