//! From the bytes of pixels to samples.

use super::packing::Packing;
use crate::value::Decode;
use std::path::Path;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// What a pixel is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pixels {
    Grey8,
    Grey16,
    GreyAlpha8,
    GreyAlpha16,
    /// Red, green and blue, 8 bits each, and perhaps alpha.
    Packed {
        packing: Decode,
        /// The packing that was found, where none was named; every pixel is checked against it.
        found: Option<Packing>,
        has_alpha: bool,
    },
}

impl Pixels {
    /// Bytes of a pixel.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Grey8 => 1,
            Self::Grey16 | Self::GreyAlpha8 => 2,
            Self::GreyAlpha16 => 4,
            Self::Packed { has_alpha, .. } => 3 + usize::from(has_alpha),
        }
    }

    /// What its samples are.
    pub(super) fn sample_type(self) -> SampleType {
        match self {
            Self::Grey8 | Self::GreyAlpha8 => SampleType::U8,
            Self::Grey16 | Self::GreyAlpha16 => SampleType::U16,
            Self::Packed { .. } => Decode::SAMPLE_TYPE,
        }
    }

    /// Appends the samples of a row, transparent ones as NaN.
    ///
    /// # Errors
    /// Unsupported for a colour that is none of the packing that was found.
    pub(super) fn append(
        self,
        path: &Path,
        row: u32,
        bytes: &[u8],
        samples: &mut Vec<f64>,
    ) -> Result<(), LayoutError> {
        let seen = |value: f64, is_seen: bool| if is_seen { value } else { f64::NAN };
        let wide = |bytes: &[u8]| f64::from(u16::from_be_bytes([bytes[0], bytes[1]]));
        let pixels = bytes.chunks_exact(self.bytes());
        match self {
            Self::Grey8 => samples.extend(pixels.map(|pixel| f64::from(pixel[0]))),
            Self::Grey16 => samples.extend(pixels.map(wide)),
            Self::GreyAlpha8 => samples.extend(pixels.map(|pixel| seen(f64::from(pixel[0]), pixel[1] != 0))),
            Self::GreyAlpha16 => samples.extend(pixels.map(|pixel| seen(wide(pixel), pixel[2..] != [0, 0]))),
            Self::Packed { packing, found, has_alpha } => {
                for pixel in pixels {
                    let is_seen = !has_alpha || pixel[3] != 0;
                    if let Some(found) = found.filter(|found| is_seen && !found.holds(pixel[0])) {
                        let problem = format!(
                            "row {row} has colours that are no heights as {} packs them, though the rows before look so; if heights are packed into the colours, state how",
                            found.name()
                        );
                        return Err(LayoutError::unsupported(path, problem).mended_by(Remedy::Decode));
                    }
                    samples
                        .push(seen(packing.height([pixel[0], pixel[1], pixel[2]].map(f64::from)), is_seen));
                }
            }
        }
        Ok(())
    }
}
