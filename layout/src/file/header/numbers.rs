//! Which numbers a header may hold, in one place for opening files and for making them.
//!
//! A build may work for hours before it writes its header, and the file that it makes must open. So it checks each number here as soon as it
//! knows it, by the same rules as opening. Cost: a few comparisons.

use super::{Header, SpacingOrigin};
use crate::error::LayoutError;
use crate::remedy::Remedy;
use crate::words::number;

/// Largest height, step, error and radius in metres, and least height.
const LARGEST_M: f64 = 1e12;

/// A field whose number may be wrong by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    HeightBase,
    HeightStep,
    ErrorTop,
    HeightRange,
    SpacingOrigin,
    SampleToCrs,
    BodyRadius,
}

impl Field {
    /// Its name in FORMAT.md.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::HeightBase => "height_base_m",
            Self::HeightStep => "height_step_m",
            Self::ErrorTop => "error_top_m",
            Self::HeightRange => "height_range_m",
            Self::SpacingOrigin => "spacing_origin",
            Self::SampleToCrs => "sample_to_crs",
            Self::BodyRadius => "body_radius_m",
        }
    }
}

impl Header {
    /// The first field with a number that no header may hold.
    pub(super) fn first_wrong_number(&self) -> Option<Field> {
        let is_sane = |v: f64| v.is_finite() && v.abs() <= LARGEST_M;
        let is_size = |v: f64| is_sane(v) && v > 0.0;
        let [low, high] = self.height_range_m;
        let latitude_deg = match self.spacing_origin {
            SpacingOrigin::Degrees { centre_latitude_deg } => centre_latitude_deg,
            SpacingOrigin::Dem | SpacingOrigin::User | SpacingOrigin::Assumed => 0.0,
        };
        [
            (Field::HeightBase, is_sane(self.scale.height_base_m)),
            (Field::HeightStep, is_size(self.scale.height_step_m)),
            (Field::ErrorTop, is_size(self.scale.error_top_m)),
            (Field::HeightRange, is_sane(low) && is_sane(high) && low <= high),
            (Field::SpacingOrigin, latitude_deg.abs() <= 90.0),
            (Field::SampleToCrs, self.sample_to_crs.is_none_or(|map| map.iter().all(|m| m.is_finite()))),
            (Field::BodyRadius, self.body_radius_m.is_none_or(is_size)),
        ]
        .into_iter()
        .find_map(|(field, holds)| (!holds).then_some(field))
    }

    /// Refuses a future header that would not open, with a message for the person who gave the numbers.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] and the like, saying which number.
    pub(crate) fn check_numbers(&self) -> Result<(), LayoutError> {
        let Some(field) = self.first_wrong_number() else { return Ok(()) };
        Err(match field {
            Field::HeightBase | Field::HeightStep | Field::ErrorTop | Field::HeightRange => {
                LayoutError::Usage(format!(
                    "heights from {} m in steps of {} m are none that a terrain holds: up to {} m, and steps above 0; check the factor on heights, and the \
                     scale and offset that the elevation model declares",
                    number(self.scale.height_base_m),
                    number(self.scale.height_step_m),
                    number(LARGEST_M)
                ))
                .mended_by(Remedy::HeightFactor)
            }
            Field::SpacingOrigin => LayoutError::Usage(
                "the centre of the elevation model lies beyond the poles; state the spacing in metres".into(),
            )
            .mended_by(Remedy::Spacing),
            Field::SampleToCrs => LayoutError::Usage(
                "the georeference of the elevation model leads to coordinates beyond all numbers; take it away: gdal_edit.py -unsetgt FILE".into(),
            ),
            Field::BodyRadius => LayoutError::Usage(format!(
                "the elevation model names a body of a radius of {} m, and up to {} m make sense; give it another reference system: \
                 gdal_edit.py -a_srs SYSTEM FILE",
                number(self.body_radius_m.unwrap_or_default()),
                number(LARGEST_M)
            )),
        })
    }
}
