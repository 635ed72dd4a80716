//! Craters of 16 x 16 samples, and a copy of a terrain with room for them.

use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::build::{HeightRoom, rebuild};
use terrasoar_layout::edit::{Crater, Edit};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

pub type Failure = Box<dyn std::error::Error>;

/// Random numbers (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators"), the same in every run.
pub struct Dice(pub u64);

impl Dice {
    pub fn below(&mut self, limit: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64 * limit
    }
}

/// The terrain with room for craters on top of each other.
pub fn with_room(path: &Path, copy: &Path) -> Result<Arc<Terrain>, Failure> {
    let terrain = Terrain::open(path)?;
    let [lowest_m, highest_m] = terrain.header().height_range_m;
    let room = HeightRoom { lowest_m: lowest_m - 1000.0, highest_m: highest_m + 1000.0 };
    rebuild(&SystemDisk, &terrain, copy, Some(room), 512, &Silent)?;
    Ok(Arc::new(Terrain::open(copy)?))
}

/// A crater whose rim fits 16 x 16 samples.
pub fn crater(terrain: &Terrain, centre_m: [f64; 2], direction_deg: f64) -> Edit {
    let [dx, dy] = terrain.grid().spacing_m();
    let radius_m = 4.0 * dx.min(dy);
    Edit::Crater(Crater { centre_m, direction_deg, radius_m, depth_m: radius_m / 4.0 })
}
