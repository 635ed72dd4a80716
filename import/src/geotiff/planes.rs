//! Bands that lie one after the other in the file, each an image of its own: which of them are read, and what their samples are used for.
//!
//! Nearly always one band is read and the others are skipped. Several are read in step where colours hold packed heights, or a band of alpha makes voids.

use super::bands::Bands;
use super::convert::Pick;

/// Which planes are read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Planes {
    /// Their numbers, counted from 0: those that heights are made of, and that of alpha behind them.
    pub(super) numbers: Vec<u64>,
    pick: Pick,
    has_alpha: bool,
}

impl Planes {
    /// Of a file whose bands lie side by side.
    pub(super) fn one() -> Self {
        Self { numbers: vec![0], pick: Pick::Band(0), has_alpha: false }
    }

    /// Those that `bands` needs.
    pub(super) fn of(bands: &Bands) -> Self {
        let mut numbers = match &bands.pick {
            Pick::Band(band) => vec![*band as u64],
            Pick::Decode(_) => vec![0, 1, 2],
        };
        numbers.extend(bands.alpha.map(|alpha| alpha as u64));
        Self { numbers, pick: bands.pick.clone(), has_alpha: bands.alpha.is_some() }
    }

    /// Makes heights of the samples of the planes, which are equally many.
    pub(super) fn join(&self, planes: &[Vec<f64>], samples: &mut Vec<f64>) {
        samples.clear();
        match (&self.pick, planes) {
            (Pick::Decode(decode), [red, green, blue, ..]) => {
                let colours = red.iter().zip(green).zip(blue);
                samples.extend(colours.map(|((red, green), blue)| decode.height([*red, *green, *blue])));
            }
            (_, [first, ..]) => samples.extend_from_slice(first),
            (_, []) => {}
        }
        if let (true, Some(alpha)) = (self.has_alpha, planes.last()) {
            let hidden = samples.iter_mut().zip(alpha).filter(|(_, alpha)| **alpha == 0.0);
            hidden.for_each(|(sample, _)| *sample = f64::NAN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::Decode;

    #[test]
    fn planes_make_heights() {
        let decode = Pick::Decode(Decode::parse("mapbox").unwrap());
        let planes = Planes::of(&Bands { pick: decode, alpha: Some(3), described: 0 });
        assert_eq!(planes.numbers, [0, 1, 2, 3]);
        let mut samples = vec![7.0];
        planes
            .join(&[vec![1.0, 1.0], vec![134.0, 134.0], vec![160.0, 161.0], vec![0.0, 255.0]], &mut samples);
        assert!(samples.len() == 2 && samples[0].is_nan() && (samples[1] - 0.1).abs() < 1e-9, "{samples:?}");
        let planes = Planes::of(&Bands { pick: Pick::Band(2), alpha: None, described: 2 });
        assert_eq!(planes.numbers, [2]);
        planes.join(&[vec![5.0, 6.0]], &mut samples);
        assert_eq!(samples, [5.0, 6.0]);
    }
}
