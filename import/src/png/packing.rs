//! Whether the colours of a picture are packed heights, found from the colours alone, where that is certain.
//!
//! Heights of the Earth have a narrow range of red: 0 to 2 with Mapbox's packing, 81 to 163 with Terrarium's. And packed heights have carries: where the upper byte of a number changes, the lower
//! one runs over and goes far the other way, so that the number changes little. Pictures do not do that. Up to the first four million pixels are looked at. The
//! following ones are checked for the range of red while they are read. Where it is not certain, a person must say it.

use super::{open_pixels, transformations};
use crate::guard;
use crate::png_stream::decoding_error;
use crate::value::Decode;
use ::png::{ColorType, Transformations};
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// Pixels that are looked at.
const MOST_PIXELS: u64 = 1 << 22;
/// Carries that make it certain, and the share of all changes of an upper byte that must be carries; noise has a quarter, pictures have none.
const CARRIES: u64 = 8;
const SHARE: f64 = 0.6;
/// Change of the number of both bytes that is little where the upper one changes.
const LITTLE: i32 = 192;

/// A packing with a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    Mapbox,
    Terrarium,
}

impl Packing {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Mapbox => "mapbox",
            Self::Terrarium => "terrarium",
        }
    }

    pub(crate) fn decode(self) -> Decode {
        match self {
            Self::Mapbox => Decode::MAPBOX,
            Self::Terrarium => Decode::TERRARIUM,
        }
    }

    /// Whether a height on Earth can have this red.
    pub(crate) fn holds(self, red: u8) -> bool {
        match self {
            Self::Mapbox => red <= 2,
            Self::Terrarium => (81..=163).contains(&red),
        }
    }

    /// The two bytes of which the upper one counts some metres or some tens of metres.
    fn pair(self, [red, green, blue]: [u8; 3]) -> [u8; 2] {
        match self {
            Self::Mapbox => [green, blue],
            Self::Terrarium => [red, green],
        }
    }
}

/// What the pixels so far say of a packing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence {
    packing: Packing,
    is_possible: bool,
    changes: u64,
    carries: u64,
}

impl Evidence {
    /// What its packing is.
    pub(crate) fn packing(&self) -> Packing {
        self.packing
    }

    pub(crate) fn new(packing: Packing) -> Self {
        Self { packing, is_possible: true, changes: 0, carries: 0 }
    }

    /// Takes a pixel, and the one before it in its row.
    pub(crate) fn add(&mut self, before: Option<[u8; 3]>, pixel: [u8; 3]) {
        self.is_possible &= self.packing.holds(pixel[0]);
        let Some(before) = before else { return };
        let [a, b] = [before, pixel].map(|pixel| self.packing.pair(pixel).map(i32::from));
        if a[0] != b[0] {
            self.changes += 1;
            self.carries += u64::from(((256 * a[0] + a[1]) - (256 * b[0] + b[1])).abs() <= LITTLE);
        }
    }

    /// Whether there is no doubt.
    pub(crate) fn is_certain(&self) -> bool {
        self.is_possible && self.carries >= CARRIES && self.carries as f64 >= SHARE * self.changes as f64
    }
}

/// The packing of the colour PNG at `path`, if its pixels leave no doubt.
pub(super) fn found(path: &Path) -> Result<Option<Packing>, LayoutError> {
    let mut reader = open_pixels(path)?;
    let header = reader.info();
    debug_assert!(transformations(header) == Transformations::EXPAND);
    let has_alpha = header.color_type == ColorType::Rgba || header.trns.is_some();
    let (size, width) = (3 + usize::from(has_alpha), header.width as usize);
    let mut evidence = [Packing::Mapbox, Packing::Terrarium].map(Evidence::new);
    let mut looked_at = 0;
    let mut row = 0u64;
    while looked_at < MOST_PIXELS && evidence.iter().any(|evidence| evidence.is_possible) {
        let place = || format!("row {row}");
        let is_over = guard(path, place, || {
            let Some(decoded) = reader.next_row().map_err(|error| decoding_error(path, place(), error))?
            else {
                return Ok(true);
            };
            // Pixels of the first passes of an interlaced picture are no neighbours.
            let are_neighbours = decoded.data().len() == width * size;
            let mut before = None;
            for pixel in decoded.data().chunks_exact(size) {
                if has_alpha && pixel[3] == 0 {
                    before = None;
                    continue;
                }
                let pixel = [pixel[0], pixel[1], pixel[2]];
                evidence.iter_mut().for_each(|evidence| evidence.add(before, pixel));
                before = are_neighbours.then_some(pixel);
                looked_at += u64::from(are_neighbours);
            }
            Ok(false)
        })?;
        if is_over {
            break;
        }
        row += 1;
    }
    Ok(evidence.iter().find(|evidence| evidence.is_certain()).map(|evidence| evidence.packing))
}
