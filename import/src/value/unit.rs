//! Units of length by the names that files give them.
//!
//! Names are compared without capitals, spaces, dots, hyphens and a plural's s. A name that is not in the list is no unit: the caller says so. Sizes are those of the
//! EPSG registry.

/// Metres a second and second, by which a geopotential is divided.
pub(crate) const STANDARD_GRAVITY: f64 = 9.80665;
/// Metres of a US survey foot.
pub(crate) const US_SURVEY_FOOT_M: f64 = 1200.0 / 3937.0;

/// Metres in a unit by its name.
pub(crate) fn unit_m(name: &str) -> Option<f64> {
    let plain: String = name
        .chars()
        .filter(|c| !matches!(c, ' ' | '.' | '-' | '_' | '(' | ')' | '[' | ']' | '\'' | '"'))
        .flat_map(char::to_lowercase)
        .collect();
    let of = |plain: &str| {
        Some(match plain {
            "m" | "metre" | "meter" | "mt" | "mtr" | "metrum" => 1.0,
            "mm" | "millimetre" | "millimeter" => 0.001,
            "cm" | "centimetre" | "centimeter" => 0.01,
            "dm" | "decimetre" | "decimeter" => 0.1,
            "dam" | "decametre" | "decameter" => 10.0,
            "hm" | "hectometre" | "hectometer" => 100.0,
            "km" | "kilometre" | "kilometer" => 1000.0,
            "ft" | "foot" | "feet" | "internationalfoot" | "internationalfeet" | "footinternational"
            | "footintl" | "intlfoot" | "intfoot" | "ift" | "feetinternational" => 0.3048,
            "ftus" | "usft" | "sft" | "ussft" | "ussurveyfoot" | "ussurveyfeet" | "surveyfoot"
            | "surveyfeet" | "footus" | "usfoot" | "usfeet" | "feetus" | "ussurveyft" | "usfootsurvey"
            | "foot_us" | "ftussurvey" => US_SURVEY_FOOT_M,
            "in" | "inch" | "inche" => 0.0254,
            "yd" | "yard" => 0.9144,
            "fathom" | "fath" | "fm" => 1.8288,
            "mi" | "mile" | "statutemile" => 1609.344,
            "nmi" | "nm" | "nauticalmile" => 1852.0,
            "kmi" => 1852.0,
            "ch" | "chain" => 20.1168,
            "li" | "link" => 0.201_168,
            "usin" => 100.0 / 3937.0,
            "usyd" | "ussurveyyard" => 3.0 * US_SURVEY_FOOT_M,
            "usch" | "ussurveychain" => 66.0 * US_SURVEY_FOOT_M,
            "usmi" | "ussurveymile" => 5280.0 * US_SURVEY_FOOT_M,
            // PROJ's three, which are those of 1937.
            "indyd" => 0.914_395_23,
            "indft" => 0.304_798_41,
            "indch" => 20.116_695_06,
            "ftcla" | "clarkesfoot" | "clarkefoot" | "footclarke" => 0.304_797_265_4,
            "ftgc" | "goldcoastfoot" | "footgoldcoast" => 6_378_300.0 / 20_926_201.0,
            "ftind" | "indianfoot" => 12.0 / 39.370_142,
            "ftsear" | "britishfootsears1922" => 12.0 / 39.370_147,
            _ => return None,
        })
    };
    of(&plain).or_else(|| plain.strip_suffix('s').and_then(of))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_people_write_them() {
        for (name, metres) in [
            ("m", 1.0),
            ("Metres", 1.0),
            ("METERS", 1.0),
            ("International feet", 0.3048),
            ("ft", 0.3048),
            ("US survey foot", US_SURVEY_FOOT_M),
            ("us-ft", US_SURVEY_FOOT_M),
            ("Foot_US", US_SURVEY_FOOT_M),
            ("mm", 0.001),
            ("cm", 0.01),
            ("kilometers", 1000.0),
            ("fathoms", 1.8288),
            ("Clarke's foot", 0.304_797_265_4),
        ] {
            assert_eq!(unit_m(name), Some(metres), "{name}");
        }
        for name in ["", "K", "degrees", "s", "furlong-ish"] {
            assert_eq!(unit_m(name), None, "{name}");
        }
    }

    #[test]
    fn units_of_proj_strings_are_those_that_proj_takes_them_for() {
        // As `gdalsrsinfo -o wkt1 "+proj=tmerc +units=..."` prints them.
        for (name, metres) in [
            ("km", 1000.0),
            ("m", 1.0),
            ("dm", 0.1),
            ("cm", 0.01),
            ("mm", 0.001),
            ("kmi", 1852.0),
            ("in", 0.0254),
            ("ft", 0.3048),
            ("yd", 0.9144),
            ("mi", 1609.344),
            ("fath", 1.8288),
            ("ch", 20.1168),
            ("link", 0.201168),
            ("us-in", 0.025_400_050_800_101),
            ("us-ft", 0.304_800_609_601_219),
            ("us-yd", 0.914_401_828_803_658),
            ("us-ch", 20.116_840_233_680_5),
            ("us-mi", 1_609.347_218_694_44),
            ("ind-yd", 0.914_395_23),
            ("ind-ft", 0.304_798_41),
            ("ind-ch", 20.116_695_06),
        ] {
            let found = unit_m(name).unwrap_or_else(|| panic!("{name}"));
            assert!((found / metres - 1.0).abs() < 1e-13, "{name}: {found}");
        }
    }
}
