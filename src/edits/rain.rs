//! A rain of craters: places, sizes and directions by chance, the same for the same seed everywhere.
//!
//! Only whole numbers and their sums and products decide. No function of the system's library is used, so every machine makes the same script.

use super::{Batch, Script};
use terrasoar_layout::edit::{Crater, Edit};
use terrasoar_layout::mix::Random;

/// What rains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rain {
    /// Craters.
    pub count: u64,
    /// Which rain.
    pub seed: u64,
    /// Where: west, south, east and north in metres from the south-west sample.
    pub extent_m: [f64; 4],
    /// Smallest and largest radius in metres. Small ones are many: half of all lie in the lowest quarter.
    pub radius_m: [f64; 2],
    /// Smallest and largest depth as a part of the radius.
    pub depth_ratio: [f64; 2],
    /// Craters a batch; the last may have fewer.
    pub batch: u64,
}

impl Rain {
    /// The craters, in the order they fall.
    pub fn craters(&self) -> impl Iterator<Item = Crater> + use<> {
        let rain = *self;
        let mut chance = Random::new(rain.seed);
        let between = |chance: &mut Random, low: f64, high: f64| low + (high - low) * chance.unit();
        (0..rain.count).map(move |_| {
            let [west, south, east, north] = rain.extent_m;
            let centre_m = [between(&mut chance, west, east), between(&mut chance, south, north)];
            let size = chance.unit();
            let radius_m = rain.radius_m[0] + (rain.radius_m[1] - rain.radius_m[0]) * (size * size);
            let depth_m = radius_m * between(&mut chance, rain.depth_ratio[0], rain.depth_ratio[1]);
            Crater {
                // To the centimetre, so that a script stays readable.
                centre_m: centre_m.map(rounded),
                radius_m: rounded(radius_m).clamp(rain.radius_m[0], rain.radius_m[1].max(rain.radius_m[0])),
                depth_m: rounded(depth_m),
                direction_deg: rounded(between(&mut chance, 0.0, 360.0)),
            }
        })
    }

    /// The craters as a script.
    pub fn script(&self) -> Script {
        let mut script = Script::default();
        for crater in self.craters() {
            match script.batches.last_mut() {
                Some(batch) if (batch.steps.len() as u64) < self.batch => {
                    batch.steps.push(super::Step::Edit(Edit::Crater(crater)));
                }
                _ => script.batches.push(Batch::of([Edit::Crater(crater)])),
            }
        }
        script
    }
}

fn rounded(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rain(seed: u64) -> Rain {
        Rain {
            count: 1000,
            seed,
            extent_m: [100.0, 200.0, 1100.0, 700.0],
            radius_m: [5.0, 45.0],
            depth_ratio: [0.2, 0.4],
            batch: 300,
        }
    }

    #[test]
    fn it_falls_where_it_should_and_repeats() {
        let craters: Vec<Crater> = rain(7).craters().collect();
        assert_eq!(craters, rain(7).craters().collect::<Vec<_>>());
        assert_ne!(craters, rain(8).craters().collect::<Vec<_>>());
        for c in &craters {
            assert!((100.0..=1100.0).contains(&c.centre_m[0]) && (200.0..=700.0).contains(&c.centre_m[1]));
            assert!((5.0..=45.0).contains(&c.radius_m) && (0.0..=360.0).contains(&c.direction_deg));
            assert!((0.19..=0.41).contains(&(c.depth_m / c.radius_m)));
        }
        let small = craters.iter().filter(|c| c.radius_m < 15.0).count();
        assert!((450..550).contains(&small), "{small}");
        let mean = craters.iter().map(|c| c.centre_m[0]).sum::<f64>() / 1000.0;
        assert!((mean - 600.0).abs() < 30.0, "{mean}");
    }

    /// The same on every machine: a script is data that others may have.
    #[test]
    fn the_first_crater_of_a_seed_is_known() {
        let text = rain(1).script().to_text(std::path::Path::new("x")).unwrap();
        let first = text.lines().nth(3).unwrap();
        assert_eq!(first, "crater at 666.56,572.89 radius 42.71 depth 12.34 direction 159.94", "{first}");
    }

    #[test]
    fn batches_are_as_long_as_asked() {
        let lengths: Vec<usize> = rain(1).script().batches.iter().map(|b| b.steps.len()).collect();
        assert_eq!(lengths, [300, 300, 300, 100]);
    }
}
