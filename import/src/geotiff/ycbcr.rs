//! Luma and chroma (TIFF 6.0, section 21) that no codec makes colours of: units of some texels of luma and one pair of chroma.
//!
//! Each texel of a unit gets the unit's chroma, as libtiff and GDAL show it. Cost: some multiplications a texel.

use super::tags::{self, Directory, TiffFile};
use terrasoar_layout::error::LayoutError;

/// How colours are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct YCbCr {
    /// Texels of luma across and down that share a pair of chroma.
    steps: [u32; 2],
    /// Shares of red, green and blue in luma.
    shares: [f64; 3],
    /// The codes of no and of full luma, blue and red difference.
    codes: [f64; 6],
}

impl YCbCr {
    /// Of the image `directory`, whose chunks are so many rows high.
    pub(super) fn read(
        file: &mut TiffFile,
        directory: &Directory,
        [chunk_high, high]: [u32; 2],
    ) -> Result<Self, LayoutError> {
        let steps = file.numbers(directory, tags::YCBCR_SUBSAMPLING, 2)?.unwrap_or_else(|| vec![2, 2]);
        let steps = match steps[..] {
            [across @ (1 | 2 | 4), down @ (1 | 2 | 4)] => [across as u32, down as u32],
            _ => {
                return Err(file.damaged(
                    "its chroma is sampled in steps that TIFF does not have; write the file again",
                ));
            }
        };
        if chunk_high < high && !chunk_high.is_multiple_of(steps[1]) {
            return Err(file.damaged("its strips end within a unit of chroma; write the file again"));
        }
        let shares =
            file.reals(directory, tags::YCBCR_COEFFICIENTS, 3)?.unwrap_or_else(|| vec![0.299, 0.587, 0.114]);
        let codes = file.reals(directory, tags::REFERENCE_BLACK_WHITE, 6)?;
        let codes = codes.unwrap_or_else(|| vec![0.0, 255.0, 128.0, 255.0, 128.0, 255.0]);
        let (Ok(shares), Ok(codes)) = (<[f64; 3]>::try_from(shares), <[f64; 6]>::try_from(codes)) else {
            return Err(file.damaged("what it says of luma and chroma is cut short; write the file again"));
        };
        let is_sound = shares[1] > 0.0 && (0..3).all(|i| codes[2 * i + 1] > codes[2 * i]);
        if !is_sound || shares.iter().chain(&codes).any(|number| !number.is_finite()) {
            return Err(
                file.damaged("what it says of luma and chroma makes no colours; write the file again")
            );
        }
        Ok(Self { steps, shares, codes })
    }

    fn unit_bytes(&self) -> usize {
        (self.steps[0] * self.steps[1]) as usize + 2
    }

    /// Bytes of so many rows of a chunk of so many columns.
    pub(super) fn stored_bytes(&self, wide: u32, rows: u32) -> usize {
        let units = wide.div_ceil(self.steps[0]) as usize * rows.div_ceil(self.steps[1]) as usize;
        units * self.unit_bytes()
    }

    /// Red, green and blue of so many rows, side by side.
    pub(super) fn colours(&self, stored: &[u8], wide: u32, rows: u32, rgb: &mut Vec<u8>) {
        let (across, down) = (self.steps[0] as usize, self.steps[1] as usize);
        let (wide, rows) = (wide as usize, rows as usize);
        let row_of_units = wide.div_ceil(across) * self.unit_bytes();
        rgb.clear();
        for (row, line) in (0..rows).map(|row| (row, &stored[row / down * row_of_units..])) {
            for col in 0..wide {
                let unit = &line[col / across * self.unit_bytes()..];
                let luma = unit[row % down * across + col % across];
                rgb.extend(self.colour([luma, unit[across * down], unit[across * down + 1]]));
            }
        }
    }

    fn colour(&self, [luma, blue, red]: [u8; 3]) -> [u8; 3] {
        let value = |code: u8, i: usize, full: f64| {
            let [none, whole] = [self.codes[2 * i], self.codes[2 * i + 1]];
            (f64::from(code) - none) * full / (whole - none)
        };
        let (y, cb, cr) = (value(luma, 0, 255.0), value(blue, 1, 127.0), value(red, 2, 127.0));
        let [of_red, of_green, of_blue] = self.shares;
        let r = y + cr * (2.0 - 2.0 * of_red);
        let b = y + cb * (2.0 - 2.0 * of_blue);
        let g = (y - of_blue * b - of_red * r) / of_green;
        [r, g, b].map(|colour| colour.round().clamp(0.0, 255.0) as u8)
    }
}
