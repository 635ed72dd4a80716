//! Craters that are saved while flying goes on: in the terrain file, and in an overlay beside it.
//!
//!     cargo run --release --example step_6_save -- land.iqt save.iqo
//!
//! The ground in the terrain file ends as it began.

use std::error::Error;
use std::path::Path;
use terrasoar::{Crater, Edit, StreamOptions, Terrain, View};
use terrasoar_layout::edit::EditSession;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let path = words.next().unwrap_or("land.iqt".into());
    let overlay = words.next().unwrap_or("save.iqo".into());
    let mut ground = Terrain::open(&path)?.stream(StreamOptions::default())?;
    let [east_m, north_m] = ground.extent_m();
    let high_m = ground.height_range_m()[1] + 200.0;
    let view = View::new([0.5 * east_m, 0.3 * north_m, high_m], 0.0, -20.0);
    ground.update(&view);
    let crater =
        Crater { centre_m: [0.5 * east_m, 0.5 * north_m], direction_deg: 0.0, radius_m: 60.0, depth_m: 10.0 };
    let height_m = |ground: &terrasoar::Ground<'_>| ground.height_at(0.5 * east_m, 0.5 * north_m).height_m;
    let before_m = height_m(&ground);

    // begin: save
    ground.edit(&[Edit::Crater(crater)])?; // in memory; the next update shows it
    let ticket = ground.commit("a crater")?; // on its way to the disk
    while !ticket.is_done() {
        ground.update(&view); // flying goes on
    }
    let saved = ticket.wait()?; // what became of it
    println!("{} pages written", saved.pages);
    ground.undo()?; // and taken back
    // end: save
    ground.update(&view);
    assert_eq!(height_m(&ground), before_m, "the ground is as it was");
    drop(ground);

    // begin: overlay
    // Made if it is not there yet. Together with the terrain file it is the edited ground.
    EditSession::open_overlay(Path::new(&path), Path::new(&overlay))?;
    let terrain = Terrain::open_with_overlay(&path, &overlay)?;
    let mut ground = terrain.stream(StreamOptions::default())?;
    ground.update(&view);
    ground.edit(&[Edit::Crater(crater)])?;
    ground.commit("a crater")?.wait()?;
    // end: overlay
    let after_m = height_m(&ground);
    drop(ground);
    let mut again = Terrain::open_with_overlay(&path, &overlay)?.stream(StreamOptions::default())?;
    again.update(&view);
    assert_eq!(height_m(&again), after_m, "the overlay keeps the crater");
    println!("{before_m:.2?} m, with the overlay {after_m:.2?} m");
    Ok(())
}
