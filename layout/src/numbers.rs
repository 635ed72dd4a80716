//! Which numbers edits and paint may have, and the message for those they may not have.

use crate::error::LayoutError;

/// Largest height, depth and strength in metres.
pub(crate) const MAX_HEIGHT_M: f64 = 1e7;

/// Farthest place from the south-west sample in metres, along either axis.
const MAX_PLACE_M: f64 = 1e9;

/// Largest radius in metres.
const MAX_RADIUS_M: f64 = 1e7;

/// Refuses what is not a number of metres within `allowed`.
pub(crate) fn checked(
    what: &str,
    field: &str,
    value: f64,
    is_allowed: bool,
    allowed: &str,
) -> Result<(), LayoutError> {
    if is_allowed {
        return Ok(());
    }
    Err(LayoutError::Usage(format!("{what}: the {field} is {value}; give {allowed}")))
}

/// Refuses amounts of metres that are negative or absurd; zero is one that changes nothing.
pub(crate) fn checked_amount(what: &str, field: &str, amount_m: f64) -> Result<(), LayoutError> {
    let is_allowed = (0.0..=MAX_HEIGHT_M).contains(&amount_m);
    checked(what, field, amount_m, is_allowed, "metres from 0 to 1e7")
}

/// Refuses places that are no places.
pub(crate) fn checked_centre(what: &str, centre_m: [f64; 2]) -> Result<(), LayoutError> {
    for (field, value) in ["centre's metres east", "centre's metres north"].into_iter().zip(centre_m) {
        checked(what, field, value, value.abs() <= MAX_PLACE_M, "a number from -1e9 to 1e9")?;
    }
    Ok(())
}

/// Refuses fractions outside 0..=1.
pub(crate) fn checked_fraction(what: &str, field: &str, fraction: f64) -> Result<(), LayoutError> {
    checked(what, field, fraction, (0.0..=1.0).contains(&fraction), "a number from 0 to 1")
}

/// Refuses heights that are none.
pub(crate) fn checked_height(what: &str, height_m: f64) -> Result<(), LayoutError> {
    checked(what, "height", height_m, height_m.abs() <= MAX_HEIGHT_M, "metres from -1e7 to 1e7")
}

/// Refuses radii that are none.
pub(crate) fn checked_radius(what: &str, radius_m: f64) -> Result<(), LayoutError> {
    let is_allowed = radius_m > 0.0 && radius_m <= MAX_RADIUS_M;
    checked(what, "radius", radius_m, is_allowed, "metres above 0, at most 1e7")
}
