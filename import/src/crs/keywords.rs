//! Arc/Info's older way to write a reference system: a keyword and a value a line, `Projection UTM`, `Zone 10`, `Datum NAD27`, `Units METERS`.

/// The lines that matter.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Keywords {
    projection: String,
    zone: Option<i32>,
    datum: String,
    units: String,
}

impl Keywords {
    /// The keywords of a text; `None` if it names no projection.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut keywords = Self::default();
        for line in text.lines() {
            let mut words = line.split_whitespace();
            let (Some(key), Some(value)) = (words.next(), words.next()) else { continue };
            let value = value.to_ascii_uppercase();
            match key.to_ascii_uppercase().as_str() {
                "PROJECTION" => keywords.projection = value,
                "ZONE" => keywords.zone = value.parse().ok(),
                "DATUM" => keywords.datum = value,
                "UNITS" => keywords.units = value,
                _ => {}
            }
        }
        (!keywords.projection.is_empty()).then_some(keywords)
    }

    /// The PROJ string; `None` for a projection other than geographic and UTM.
    pub(crate) fn proj(&self) -> Option<String> {
        let datum = match self.datum.as_str() {
            "NAD27" => "+datum=NAD27",
            "NAD83" => "+datum=NAD83",
            "" | "WGS84" | "WGS_1984" => "+datum=WGS84",
            _ => return None,
        };
        let units = match self.units.as_str() {
            "" | "METERS" | "METRES" | "DD" => "",
            "FEET" => " +units=us-ft",
            _ => return None,
        };
        match (self.projection.as_str(), self.zone) {
            ("GEOGRAPHIC", _) => Some(format!("+proj=longlat {datum}")),
            ("UTM", Some(zone)) if (1..=60).contains(&zone.abs()) => {
                let south = if zone < 0 { " +south" } else { "" };
                Some(format!("+proj=utm +zone={}{south} {datum}{units}", zone.abs()))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utm_and_geographic_are_understood() {
        let of = |text: &str| Keywords::parse(text).and_then(|keywords| keywords.proj());
        let utm = of(
            "Projection    UTM\nZone          10\nDatum         NAD27\nZunits NO\nUnits METERS\nParameters\n",
        );
        assert_eq!(utm.as_deref(), Some("+proj=utm +zone=10 +datum=NAD27"));
        assert_eq!(
            of("Projection GEOGRAPHIC\nDatum WGS84\nUnits DD\n").as_deref(),
            Some("+proj=longlat +datum=WGS84")
        );
        assert_eq!(of("Projection ALBERS\nDatum NAD83\nUnits METERS\n"), None);
        assert_eq!(of("nothing of the kind"), None);
    }
}
