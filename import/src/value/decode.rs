//! Heights packed into the colours of a picture: a sum of factors on red, green and blue, in metres.
//!
//! Two packings have names. Mapbox Terrain-RGB: `-10000 + 0.1 (65536 R + 256 G + B)`. Terrarium: `256 R + G + B / 256 - 32768`. Any other is told by its four
//! numbers. Cost: three multiplications a sample.

use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// The packing that a person names.
///
/// # Errors
/// [`LayoutError::Usage`] for no packing, saying how they are named.
pub(crate) fn decode(text: &str) -> Result<Decode, LayoutError> {
    Decode::parse(text).ok_or_else(|| {
        LayoutError::Usage(format!(
            "\"{}\" is no way to pack heights into colours; it is mapbox, terrarium, or four numbers R,G,B,BASE, such as 256,1,0.00390625,-32768",
            harmless(text, 60)
        ))
        .mended_by(Remedy::Decode)
    })
}

/// A packing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Decode {
    factors: [f64; 3],
    base: f64,
}

impl Decode {
    /// Mapbox's packing.
    pub(crate) const MAPBOX: Self = Self { factors: [6553.6, 25.6, 0.1], base: -10_000.0 };
    /// Tilezen's and Mapzen's packing.
    pub(crate) const TERRARIUM: Self = Self { factors: [256.0, 1.0, 1.0 / 256.0], base: -32768.0 };
    /// What heights are once they are unpacked.
    pub(crate) const SAMPLE_TYPE: SampleType = SampleType::F64;

    /// The packing of that name, or of four numbers "R,G,B,BASE".
    pub(crate) fn parse(text: &str) -> Option<Self> {
        match text.trim().to_ascii_lowercase().as_str() {
            "mapbox" => return Some(Self::MAPBOX),
            "terrarium" => return Some(Self::TERRARIUM),
            _ => {}
        }
        let numbers: Vec<f64> =
            text.split(',').map(|word| word.trim().parse()).collect::<Result<_, _>>().ok()?;
        let [red, green, blue, base] = <[f64; 4]>::try_from(numbers).ok()?;
        let sound = [red, green, blue, base].iter().all(|number| number.is_finite());
        (sound && [red, green, blue] != [0.0; 3]).then_some(Self { factors: [red, green, blue], base })
    }

    /// Metres of a pixel. The sum is taken of whole numbers where the factors are tenths of such, so that 0.1 m stay 0.1 m.
    pub(crate) fn height(&self, [red, green, blue]: [f64; 3]) -> f64 {
        if *self == Self::MAPBOX {
            return ((65_536.0 * red + 256.0 * green + blue) - 100_000.0) / 10.0;
        }
        self.factors[0] * red + self.factors[1] * green + self.factors[2] * blue + self.base
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packings_have_names_or_four_numbers() {
        let mapbox = Decode::parse("Mapbox").unwrap();
        assert_eq!(mapbox.height([1.0, 134.0, 160.0]), 0.0);
        assert_eq!(mapbox.height([1.0, 134.0, 161.0]), 0.1);
        let terrarium = Decode::parse("terrarium").unwrap();
        assert_eq!(terrarium.height([128.0, 0.0, 0.0]), 0.0);
        assert_eq!(terrarium.height([128.0, 1.0, 128.0]), 1.5);
        assert_eq!(Decode::parse("1, 0,0,-5").unwrap().height([7.0, 1.0, 1.0]), 2.0);
        for wrong in ["", "mapbo", "1,2,3", "1,2,3,nan", "0,0,0,5", "1,2,3,4,5"] {
            assert_eq!(Decode::parse(wrong), None, "{wrong}");
        }
    }
}
