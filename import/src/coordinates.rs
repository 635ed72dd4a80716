//! Coordinates of a terrain's reference system as longitude and latitude, and back, for programs that show or take places.
//!
//! A system is named by the text that a terrain file keeps, or as a person names it. Degrees throughout. Cost: a microsecond a point.

use crate::crs::{Ground, HorizontalSize, Unit, by_text};
use terrasoar_layout::dem::UnitOf;

/// A reference system that places can be brought out of and into.
#[derive(Debug, Clone)]
pub struct Coordinates {
    ground: Ground,
    name: String,
}

impl Coordinates {
    /// The system of a text: WKT, a PROJ string, "EPSG:n"; with coordinates in `unit` where a file has one of its own. `None` for one that is not known or not tied to the ground.
    pub fn of(text: &str, unit: Option<&UnitOf>) -> Option<Self> {
        let mut system = by_text(text)?;
        if let Some(unit) = unit {
            let size = match unit.is_angle {
                true => HorizontalSize::Radians(unit.size),
                false => HorizontalSize::Metres(unit.size),
            };
            system.unit = Some(Unit { name: unit.name.clone(), size });
        }
        Some(Self { ground: Ground::new(&system)?, name: system.name })
    }

    /// Its short name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether coordinates are longitude and latitude.
    pub fn is_geographic(&self) -> bool {
        self.ground.is_geographic()
    }

    /// Longitude and latitude in degrees, of WGS 84 or of the body's own, at `x` (east or longitude) and `y` (north or latitude).
    pub fn longitude_latitude(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        self.ground.world(point).map(|angles| angles.map(f64::to_degrees))
    }

    /// The coordinates of a longitude and latitude in degrees.
    pub fn of_longitude_latitude(&self, degrees: [f64; 2]) -> Option<[f64; 2]> {
        self.ground.of_world(degrees.map(f64::to_radians))
    }

    /// A point of this system in another one.
    pub fn across_to(&self, other: &Self, point: [f64; 2]) -> Option<[f64; 2]> {
        self.ground.across_to(&other.ground, point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_go_there_and_back() {
        let utm = Coordinates::of("EPSG:32632", None).unwrap();
        assert!(!utm.is_geographic() && utm.name() == "WGS 84 / UTM zone 32N");
        let [lon, lat] = utm.longitude_latitude([500_000.0, 5_000_000.0]).unwrap();
        assert!((lon - 9.0).abs() < 1e-9 && (lat - 45.153_477_183).abs() < 1e-8, "{lon} {lat}");
        let [x, y] = utm.of_longitude_latitude([lon, lat]).unwrap();
        assert!((x - 500_000.0).abs() < 1e-4 && (y - 5_000_000.0).abs() < 1e-4, "{x} {y}");
        let degrees = Coordinates::of("EPSG:4326", None).unwrap();
        assert_eq!(degrees.across_to(&utm, [9.0, 0.0]).unwrap()[0].round(), 500_000.0);
        let kilometres = UnitOf { name: "km".into(), size: 1000.0, is_angle: false };
        let utm = Coordinates::of("EPSG:32632", Some(&kilometres)).unwrap();
        assert!((utm.longitude_latitude([500.0, 5000.0]).unwrap()[1] - lat).abs() < 1e-9);
        assert!(Coordinates::of("local", None).is_none() && Coordinates::of("EPSG:1", None).is_none());
    }
}
