//! Differences as colours: red below, blue above, near white where nothing differs, grey where there is nothing.
//!
//! Stops are those of ColorBrewer's RdBu (C. Brewer), which colour-blind eyes tell apart; between them colours are mixed as they are stored.

/// From the lowest difference to the highest.
const STOPS: [[u8; 3]; 9] = [
    [0x67, 0x00, 0x1f],
    [0xb2, 0x18, 0x2b],
    [0xd6, 0x60, 0x4d],
    [0xf4, 0xa5, 0x82],
    [0xf7, 0xf7, 0xf7],
    [0x92, 0xc5, 0xde],
    [0x43, 0x93, 0xc3],
    [0x21, 0x66, 0xac],
    [0x05, 0x30, 0x61],
];
/// Where nothing was compared.
const NOTHING: [u8; 3] = [0xa8, 0xa8, 0xa8];

/// The colour of a difference, of which those from `-range` to `range` (above 0) have colours of their own.
pub fn colour(difference: f32, range: f32) -> [u8; 3] {
    if difference.is_nan() {
        return NOTHING;
    }
    let middle = (STOPS.len() / 2) as f32;
    let at = ((difference / range).clamp(-1.0, 1.0) * middle + middle).clamp(0.0, 2.0 * middle);
    let low = (at as usize).min(STOPS.len() - 2);
    let share = at - low as f32;
    std::array::from_fn(|i| {
        let [a, b] = [STOPS[low][i], STOPS[low + 1][i]].map(f32::from);
        (a + (b - a) * share).round() as u8
    })
}

/// Red, green and blue of differences, three bytes each.
pub fn pixels(differences: &[f32], range: f32) -> Vec<u8> {
    differences.iter().flat_map(|difference| colour(*difference, range)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_go_from_red_over_white_to_blue() {
        assert_eq!(colour(0.0, 5.0), [0xf7; 3]);
        assert_eq!([-5.0, -99.0, f32::NEG_INFINITY].map(|d| colour(d, 5.0)), [STOPS[0]; 3]);
        assert_eq!([5.0, 99.0, f32::INFINITY].map(|d| colour(d, 5.0)), [STOPS[8]; 3]);
        assert_eq!(colour(f32::NAN, 5.0), NOTHING);
        assert_eq!(colour(1.25, 5.0), STOPS[5]);
        // The further from nothing, the further from white.
        let lightness = |d: f32| colour(d, 1.0).map(u32::from).iter().sum::<u32>();
        for i in 0..100 {
            let d = i as f32 / 100.0;
            assert!(lightness(d + 0.01) <= lightness(d) && lightness(-d - 0.01) <= lightness(-d));
        }
        assert_eq!(pixels(&[0.0, f32::NAN], 1.0).len(), 6);
    }
}
