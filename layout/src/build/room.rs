//! Room in compact records for heights that a terrain does not have yet, so that edits may dig and raise without a file being rewritten.
//!
//! Two numbers bound such a file's heights: the height codes, 65,536 steps from the base on, and `error_top_m`, which no range of heights may exceed.

/// Largest height code of compact records.
pub(super) const LARGEST_CODE: f64 = 65535.0;

/// Steps of height that the error codes reach up to at the least. This costs no precision: errors of heights in whole steps are half a step or more, and
/// the codes from there up to here, 15 octaves, are no more than there are.
const REACH_STEPS: f64 = 16384.0;

/// How much taller than itself a terrain of more steps than that may become. A third of an octave of the error codes: its smallest errors grow by a quarter.
const REACH_FACTOR: f64 = 1.25;

/// The largest range of heights in steps that records are made for, where the terrain's own is `range_steps`, at most [`LARGEST_CODE`].
pub(super) fn reach_steps(range_steps: f64) -> f64 {
    (range_steps * REACH_FACTOR).clamp(REACH_STEPS, LARGEST_CODE)
}

/// Codes that are left free below a terrain whose heights take `range_steps` codes: as many as above, and no more than [`reach_steps`] makes use of.
pub(super) fn codes_below(range_steps: f64) -> f64 {
    let free = (LARGEST_CODE - range_steps) / 2.0;
    free.min(reach_steps(range_steps) - range_steps).floor().max(0.0)
}

/// Steps of heights that are all the same, in raw units. Any would do for these; edits have room for 256 units up and down.
const FLAT_STEP: f64 = 1.0 / 64.0;

/// Steps that heights of `range` are rounded to where they do not fit whole steps: as fine as room above and below allows.
pub(super) fn rounding_step(range: f64, has_room: bool) -> f64 {
    if range == 0.0 {
        return FLAT_STEP;
    }
    range * if has_room { REACH_FACTOR } else { 1.0 } / LARGEST_CODE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_is_symmetric_and_inside_the_codes() {
        for range in
            [0.0, 1.0, 5.0, 16_000.0, 16_384.0, 30_000.0, 52_427.0, 52_428.0, 60_000.0, 65_534.0, 65_535.0]
        {
            let (reach, below) = (reach_steps(range), codes_below(range));
            assert!(reach >= range && reach <= LARGEST_CODE, "{range}: {reach}");
            assert!(below >= 0.0 && below + range <= reach, "{range}: {below}");
            let above = LARGEST_CODE - range - below;
            assert!(above >= below, "{range}: {below} below, {above} above");
        }
        assert_eq!(codes_below(65_535.0), 0.0);
        assert_eq!(codes_below(2000.0), 14_384.0);
    }
}
