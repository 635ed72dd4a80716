//! Numbers into bytes between black and white.
//!
//! A number at or below black is 0, one at or above white 255, one between lies on the straight line, rounded: what gdal_translate -scale makes. Where black is white, what lies
//! above is white. A texel of which a colour is no number is transparent. Cost: some nanoseconds a texel, and 16 bytes for each of a row.

use crate::reader::{NumberRows, Numbers};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::RowReader;
use terrasoar_layout::words::number;

/// Black and white of red, green and blue.
pub(super) type Limits = [[f64; 2]; 3];

/// Black and white of each colour.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shades {
    limits: Limits,
    is_inverse: bool,
}

impl Shades {
    pub(super) fn new(limits: Limits, is_inverse: bool) -> Self {
        Self { limits, is_inverse }
    }

    fn texel(&self, numbers: Numbers) -> [u8; 4] {
        if numbers[..3].iter().any(|number| number.is_nan()) {
            return [0; 4];
        }
        let byte = |channel: usize| {
            let [black, white] = self.limits[channel];
            let number = f64::from(numbers[channel]);
            let share = if white > black { (number - black) / (white - black) } else { number - black };
            // Infinite where both ends are far apart.
            let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
            let share = if white > black { share } else { share.ceil() };
            let byte = (share * 255.0 + 0.5) as u8;
            if self.is_inverse { 255 - byte } else { byte }
        };
        [byte(0), byte(1), byte(2), (numbers[3] + 0.5) as u8]
    }

    /// "210 to 3010", or that of each colour.
    pub(super) fn words(&self, is_grey: bool) -> String {
        // Those that were found are in single precision, and as short as that allows.
        let short = |value: f64| {
            let single = value as f32;
            let is_single = f64::from(single) == value;
            number(if is_single { single.to_string().parse().unwrap_or(value) } else { value })
        };
        let range = |[black, white]: [f64; 2]| format!("{} to {}", short(black), short(white));
        let [red, green, blue] = self.limits;
        if is_grey || (red == green && green == blue) {
            return range(red);
        }
        format!("red {}, green {}, blue {}", range(red), range(green), range(blue))
    }
}

/// Rows of numbers as bytes.
pub(super) struct Stretched<'p> {
    pub(super) rows: Box<dyn NumberRows + 'p>,
    pub(super) shades: Shades,
    pub(super) wide: usize,
    pub(super) row: Vec<Numbers>,
}

impl RowReader for Stretched<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        self.row.resize(self.wide, [0.0; 4]);
        for row in rgba.chunks_exact_mut(4 * self.wide) {
            self.rows.read(&mut self.row)?;
            for (to, numbers) in row.as_chunks_mut::<4>().0.iter_mut().zip(&self.row) {
                *to = self.shades.texel(*numbers);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lie_on_a_line_between_black_and_white() {
        let shades = Shades::new([[200.0, 3000.0]; 3], false);
        let of = |number: f32| shades.texel([number, number, number, 255.0])[0];
        assert_eq!([0.0, 200.0, 1600.0, 3000.0, 9e9].map(of), [0, 0, 128, 255, 255]);
        assert_eq!(of(f32::INFINITY), 255);
        assert_eq!(shades.texel([1.0, f32::NAN, 1.0, 255.0]), [0; 4]);
        let one = Shades::new([[7.0, 7.0]; 3], false);
        assert_eq!([6.0, 7.0, 8.0].map(|number| one.texel([number; 4])[1]), [0, 0, 255]);
        let inverse = Shades::new([[0.0, 100.0]; 3], true);
        assert_eq!(inverse.texel([25.0, 0.0, 100.0, 7.0]), [191, 255, 0, 7]);
        assert_eq!(shades.words(false), "200 to 3000");
    }
}
