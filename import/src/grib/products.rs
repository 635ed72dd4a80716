//! What a field is (section 4): heights, a geopotential, or something else; and of which level.
//!
//! Names are those of NCEP's tables and of ECMWF's. Cost: none.

use super::section::Section;

/// What the numbers of a field are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    /// Metres.
    Height,
    /// Square metres a square second.
    Geopotential,
    Other,
}

/// A product that may be ground.
struct Known {
    /// Discipline, category and number.
    codes: [u8; 3],
    names: &'static [&'static str],
    words: &'static str,
    meaning: Meaning,
    /// Whether it is the ground on whatever level it is told.
    is_ground: bool,
}

const KNOWN: [Known; 4] = [
    Known {
        codes: [0, 3, 4],
        names: &["GP", "z"],
        words: "geopotential",
        meaning: Meaning::Geopotential,
        is_ground: false,
    },
    Known {
        codes: [0, 3, 5],
        names: &["HGT", "gh", "orog"],
        words: "geopotential height",
        meaning: Meaning::Height,
        is_ground: false,
    },
    Known {
        codes: [0, 3, 6],
        names: &["DIST", "h"],
        words: "geometric height",
        meaning: Meaning::Height,
        is_ground: false,
    },
    Known {
        codes: [2, 0, 7],
        names: &["MTERH", "TERHGT", "mterh"],
        words: "height of the model's terrain",
        meaning: Meaning::Height,
        is_ground: true,
    },
];

/// What a field is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Product {
    names: &'static [&'static str],
    pub(super) meaning: Meaning,
    /// Whether it is the ground's.
    pub(super) is_ground: bool,
    /// In words: "HGT, geopotential height, at the ground".
    pub(super) words: String,
}

impl Product {
    /// Of a discipline and section 4.
    pub(super) fn of(discipline: u8, product: &Section) -> Self {
        let codes = [discipline, product.u8(10), product.u8(11)];
        // Templates of a level or layer begin alike.
        let has_level = product.u16(8) <= 15 && product.reaches(28);
        let level = has_level.then(|| (product.u8(23), product.scaled(24)));
        let at = match level {
            None | Some((255, _)) => String::new(),
            Some((1, _)) => ", at the ground".into(),
            Some((2, _)) => ", at the base of clouds".into(),
            Some((101, _)) => ", at sea level".into(),
            Some((100, Some(pascal))) => {
                format!(", at {} hPa", terrasoar_layout::words::number(pascal / 100.0))
            }
            Some((kind, Some(value))) => {
                format!(", at {} of level {kind}", terrasoar_layout::words::number(value))
            }
            Some((kind, None)) => format!(", at level {kind}"),
        };
        match KNOWN.iter().find(|known| known.codes == codes) {
            Some(known) => Self {
                names: known.names,
                meaning: known.meaning,
                is_ground: known.is_ground || matches!(level, Some((1, _))),
                words: format!("{}, {}{at}", known.names[0], known.words),
            },
            None => Self {
                names: &[],
                meaning: Meaning::Other,
                is_ground: false,
                words: format!("product {}.{}.{}{at}", codes[0], codes[1], codes[2]),
            },
        }
    }

    /// Whether a word names it: a name, or its codes as "0.3.5".
    pub(super) fn is_called(&self, word: &str) -> bool {
        self.names.iter().any(|name| name.eq_ignore_ascii_case(word))
            || self
                .words
                .strip_prefix("product ")
                .is_some_and(|words| words.split(',').next().is_some_and(|codes| codes == word))
    }
}
