//! Metres or degrees, where a file gives coordinates and no unit.
//!
//! Nothing in such a file decides this with certainty. Steps of whole arc-seconds that are no round decimals, such as 1/1200, are degrees, and so is a grid around the globe; coordinates
//! beyond the globe are lengths. Steps of a metre and more are lengths. Round decimal steps below that may be either. Where the whole grid is less than one unit wide, a
//! site in centimetres is more likely than so few samples in degrees: metres are taken, with a warning. Otherwise the person must say it.

use crate::crs::Unit;
use crate::crs::unit_in_words;
use crate::reader::HorizontalSize;
use std::path::Path;
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::hypot;
use terrasoar_layout::remedy::Remedy;

/// What coordinates of an unknown unit are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Guess {
    /// Lengths, and nothing speaks for angles.
    Metres,
    /// Lengths, though they could be angles.
    LikelyMetres,
    /// Angles; nothing else makes sense.
    Degrees,
    /// As likely the one as the other.
    Either,
}

impl Guess {
    /// What the coordinates of a north-up grid are.
    pub(crate) fn of(map: &[f64; 6], samples: [u32; 2]) -> Self {
        let [columns, rows] = samples.map(|count| f64::from(count.max(2) - 1));
        let (west, north) = (map[0].min(map[0] + map[1] * columns), map[3].max(map[3] + map[5] * rows));
        let [across, down] = [hypot(map[1], map[4]), hypot(map[2], map[5])];
        let [wide, high] = [across * columns, down * rows];
        let (east, south) = (west + wide, north - high);
        let on_globe = west >= -181.0 && east <= 361.0 && south >= -91.0 && north <= 91.0;
        if !on_globe {
            return Self::Metres;
        }
        if (350.0..=361.0).contains(&(wide + across)) && high + down >= 100.0 {
            return Self::Degrees;
        }
        let step = across.max(down);
        // Steps of a metre and more from the corner of a site.
        if step >= 1.0 {
            return Self::Metres;
        }
        if [across, down].iter().all(|step| is_sexagesimal(*step)) {
            return Self::Degrees;
        }
        if step <= 0.0005 {
            // A tenth of a millimetre and less, or some metres.
            return Self::Degrees;
        }
        if wide < 1.0 && high < 1.0 { Self::LikelyMetres } else { Self::Either }
    }

    pub(crate) fn is_degrees(self) -> bool {
        matches!(self, Self::Degrees | Self::Either)
    }

    /// The unit that is assumed.
    pub(crate) fn unit(self) -> Unit {
        let size = match self.is_degrees() {
            true => HorizontalSize::Radians(1f64.to_radians()),
            false => HorizontalSize::Metres(1.0),
        };
        Unit { name: unit_in_words(size), size }
    }

    /// Says what is assumed, or asks.
    ///
    /// # Errors
    /// [`LayoutError::Usage`], the question.
    pub(crate) fn tell(
        self,
        path: &Path,
        step: [f64; 2],
        warnings: &mut Vec<Warning>,
    ) -> Result<(), LayoutError> {
        let step = step[0].max(step[1]);
        match self {
            Self::Metres => Ok(()),
            Self::Degrees => {
                warnings.push(
                    Warning::new("the elevation model names no reference system; its coordinates look like degrees and were taken as such")
                        .mended_by(Remedy::ReferenceSystem, "local"),
                );
                Ok(())
            }
            Self::LikelyMetres => {
                warnings.push(
                    Warning::new(format!(
                        "the elevation model names no reference system; its step of {step} was taken to be metres and could be degrees"
                    ))
                    .mended_by(Remedy::ReferenceSystem, "EPSG:4326"),
                );
                Ok(())
            }
            Self::Either => Err(LayoutError::Usage(format!(
                "{}: the elevation model names no reference system, and its step of {step} could be degrees as well as metres; say which: EPSG:4326 for \
                 degrees, local for metres, or the system it is in",
                path.display()
            ))
            .mended_by(Remedy::ReferenceSystem)),
        }
    }
}

/// Whether a step is a whole number of arc-seconds, of thirds or of ninths of them, and no round decimal.
fn is_sexagesimal(step: f64) -> bool {
    let whole =
        |value: f64| (value - value.round()).abs() <= 1e-4 * value.abs().max(1.0) && value.round() >= 1.0;
    let seconds = [3600.0, 10_800.0, 32_400.0].iter().any(|parts| {
        let count = step * parts;
        (count - count.round()).abs() <= 1e-3 && count.round() >= 1.0
    });
    let decimal = whole(step * 1e4) && (step * 1e4 - (step * 1e4).round()).abs() < 1e-6;
    seconds && !decimal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_plain_is_taken_and_what_is_not_is_asked() {
        let of =
            |x: f64, y: f64, step: f64, samples: [u32; 2]| Guess::of(&[x, step, 0.0, y, 0.0, -step], samples);
        assert_eq!(of(86.0, 29.0, 1.0 / 1200.0, [1201, 1201]), Guess::Degrees);
        assert_eq!(of(86.0, 29.0, 0.000_277_777_777_8, [3601, 3601]), Guess::Degrees);
        assert_eq!(of(86.0, 29.0, 0.008_333_333_3, [500, 500]), Guess::Degrees);
        assert_eq!(of(86.0, 29.0, 0.004_166_666_667, [5, 5]), Guess::Degrees);
        assert_eq!(of(-179.875, 89.875, 0.25, [1440, 720]), Guess::Degrees);
        assert_eq!(of(0.0, 90.0, 1.0, [360, 181]), Guess::Degrees);
        assert_eq!(of(86.0, 29.0, 0.000_1, [500, 500]), Guess::Degrees);
        assert_eq!(of(5.0, 50.0, 0.25, [41, 31]), Guess::Either);
        assert_eq!(of(4.875, 50.125, 0.1, [41, 31]), Guess::Either);
        assert_eq!(of(12.0, 7.0, 0.01, [41, 31]), Guess::LikelyMetres);
        assert_eq!(of(12.0, 7.0, 0.01, [410, 31]), Guess::Either);
        assert_eq!(of(0.0, 40.0, 1.0, [41, 31]), Guess::Metres);
        assert_eq!(of(500_000.0, 60.0, 0.01, [41, 31]), Guess::Metres);
        assert_eq!(of(0.5, 30.5, 10.0, [4, 4]), Guess::Metres);
    }
}
