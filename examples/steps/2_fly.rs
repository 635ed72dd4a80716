//! Flies over a terrain file without a picture, and asks the ground what a game asks: heights, and where a shot lands.
//!
//!     cargo run --release --example step_2_fly -- land.iqt

use std::error::Error;
use terrasoar::{StreamOptions, Terrain, View};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or("land.iqt".into());
    // begin: open
    let terrain = Terrain::open(&path)?;
    let mut ground = terrain.stream(StreamOptions::default().cache_mib(64))?;
    let [east_m, north_m] = ground.extent_m();
    // end: open
    let mut triangles = 0;
    for frame in 0..120 {
        // begin: update
        // Metres east, north and up of the south-west sample; heading and climb in degrees.
        let eye_m = [0.5 * east_m, (0.2 + 0.004 * f64::from(frame)) * north_m, 2000.0];
        let view = View::new(eye_m, 0.0, -15.0).tolerance_px(1.0).viewport([1280, 720]);
        let told = ground.update(&view);
        // end: update
        triangles = told.triangles;
        // begin: errors
        while let Some(error) = ground.take_error() {
            eprintln!("{error}; the ground stays coarse there");
        }
        // end: errors
    }
    println!("{triangles} triangles in the last frame");

    // begin: height
    let foot = ground.height_at(0.5 * east_m, 0.7 * north_m);
    match foot.height_m {
        Some(height_m) if foot.is_exact => println!("the ground is {height_m:.2} m high"),
        // Finer samples are not in memory: this will do for what is far away.
        Some(height_m) => println!("the ground is about {height_m:.0} m high"),
        None => println!("there is no ground: outside, or a void in the data"),
    }
    // end: height

    // begin: want
    // Ask for the exact height where somebody will stand, and go on flying: it is there some updates later.
    let place_m = [0.1 * east_m, 0.1 * north_m];
    ground.want_height(place_m[0], place_m[1]);
    let view = *ground.view().ok_or("nothing was flown yet")?;
    let mut updates = 0;
    while !ground.height_at(place_m[0], place_m[1]).is_exact && updates < 1000 {
        ground.update(&view);
        std::thread::sleep(std::time::Duration::from_millis(1)); // a game draws its frame here
        updates += 1;
    }
    // end: want
    println!("a far place is exact: {}", ground.height_at(place_m[0], place_m[1]).is_exact);

    // begin: ray
    let muzzle_m = [0.5 * east_m, 0.5 * north_m, 2500.0];
    match ground.ray_hit(muzzle_m, [0.3, 1.0, -0.4], 20_000.0) {
        Some(hit) => println!("the shot lands {:.0} m away, {:.1} m high", hit.distance_m, hit.place_m[2]),
        None => println!("the shot lands nowhere"),
    }
    // end: ray
    Ok(())
}
