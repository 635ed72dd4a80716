//! Ground edited while it is flown over: craters fall ahead of the eye, are seen in the next frame, and go to the disk in the background; then all is taken back.
//!
//!     cargo run --release --example edit -- TERRAIN.iqt
//!
//! The file is edited, and ends as it began.

use std::error::Error;
use terrasoar::{CommitTicket, Crater, Edit, StreamOptions, Terrain, View};

const FRAMES: u32 = 120;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: edit TERRAIN.iqt")?;
    let terrain = Terrain::open(&path)?;
    let mut ground = terrain.stream(StreamOptions::default())?;
    let [east_m, north_m] = ground.extent_m();
    let [low_m, high_m] = ground.height_range_m();
    let radius_m = 0.01 * east_m.min(north_m);
    let mut ticket: Option<CommitTicket> = None;
    let (mut craters, mut commits) = (0, 0);
    for frame in 0..FRAMES {
        let along = 0.2 + 0.4 * f64::from(frame) / f64::from(FRAMES);
        let eye_m = [0.5 * east_m, along * north_m, high_m + 0.05 * east_m];
        ground.update(&View::new(eye_m, 0.0, -30.0));
        if frame % 10 == 5 {
            let centre_m = [(0.4 + 0.02 * f64::from(frame % 11)) * east_m, (along + 0.1) * north_m];
            let before_m = ground.height_at(centre_m[0], centre_m[1]).height_m;
            // Not below the lowest ground: files hold heights of a range, which building with room for more widens.
            let room_m = before_m.map_or(0.0, |height_m| height_m - low_m);
            let crater = Crater {
                centre_m,
                direction_deg: 0.0,
                radius_m,
                depth_m: (0.2 * radius_m).min(0.4 * room_m),
            };
            if crater.depth_m > 0.0 {
                ground.edit(&[Edit::Crater(crater)])?;
                craters += 1;
                let after_m = ground.height_at(centre_m[0], centre_m[1]).height_m;
                println!("frame {frame}: {before_m:.2?} m, now {after_m:.2?} m");
            }
        }
        // One commit at a time, so that no frame waits for another.
        if ticket.as_ref().is_none_or(CommitTicket::is_done) && !ground.is_saved() {
            ticket = Some(ground.commit("craters")?);
            commits += 1;
        }
        while let Some(error) = ground.take_error() {
            eprintln!("{error}");
        }
    }
    let last = ground.commit("craters")?.wait()?;
    println!(
        "{craters} craters in {commits} commits and a last one of {} pages; all on the disk",
        last.pages
    );
    let mut undone = 0;
    while ground.undo()? {
        undone += 1;
    }
    println!("{undone} commits taken back");
    Ok(())
}
