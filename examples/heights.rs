//! Heights of a million places: what collision, placing of objects and analysis ask for.
//!
//!     cargo run --release --example heights -- TERRAIN.iqt

use std::error::Error;
use std::time::Instant;
use terrasoar::MappedTerrain;

const PLACES: u32 = 1_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: heights TERRAIN.iqt")?;
    // All records at hand, so every height is exact. Streamed ground answers as fast, from what has come so far.
    let terrain = MappedTerrain::open(&path)?;
    let ground = terrain.ground(Default::default(), Default::default())?;
    let [east_m, north_m] = ground.extent_m();
    let begun = Instant::now();
    let (mut sum_m, mut known, mut highest) = (0.0, 0_u32, (f64::NEG_INFINITY, [0.0; 2]));
    for i in 0..PLACES {
        // Spread evenly over the terrain (R. Kronecker's sequence of the plastic number).
        let [x, y] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (f64::from(i) * step).fract());
        let at_m = [x * east_m, y * north_m];
        if let Some(height_m) = ground.height_at(at_m[0], at_m[1]).height_m {
            sum_m += height_m;
            known += 1;
            if height_m > highest.0 {
                highest = (height_m, at_m);
            }
        }
    }
    let passed = begun.elapsed().as_secs_f64();
    println!(
        "{known} of {PLACES} places have ground, {:.2} m high in the mean",
        sum_m / f64::from(known.max(1))
    );
    println!("the highest is {:.2} m, {:.0} m east and {:.0} m north", highest.0, highest.1[0], highest.1[1]);
    println!("{:.2} s, {:.2} microseconds a place", passed, 1e6 * passed / f64::from(PLACES));
    Ok(())
}
