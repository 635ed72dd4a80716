//! What it costs to change the ground: craters of 16 x 16 samples, one by one and in batches, records and their ancestors brought up to date.
//!
//! Questions: how long does a crater take on one thread, where its pages are in memory and where they are not; how many records does it change; how many a second are
//! made in batches? Data: a terrain file named on the command line, 4,097 x 4,097 samples for docs/figures.md. Command:
//!
//!     cargo bench --bench craters -- TERRAIN.iqt [--craters N] [--packed]
//!
//! The terrain is copied first, with room for heights beyond its own. Edits stay in memory; the file is not written to. With `--packed` the copy is packed and its pages are unpacked as they are needed, beside the same craters over the copy as it was. Prints Markdown. Keep runs under benches/runs/.

#[path = "support/craters.rs"]
mod craters;

use craters::{Dice, Failure, crater, with_room};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use terrasoar_layout::edit::{Edit, Editor};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

const HEAD: &str =
    "| craters | refused | median, us | 99 %, us | worst, us | a second | samples | records | pages |
|---|---|---|---|---|---|---|---|---|";

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut count, mut path, mut is_packed) = (10_000, None, false);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--craters" => count = words.next().ok_or("--craters wants a number")?.parse()?,
            "--packed" => is_packed = true,
            _ => path = Some(PathBuf::from(word)),
        }
    }
    let Some(path) = path else {
        println!(
            "skipped: name a terrain file, such as `terrasoar synth --size 4097` and `terrasoar build` make"
        );
        return Ok(());
    };
    let folder = tempfile::tempdir()?;
    let terrain = with_room(&path, &folder.path().join("roomy.iqt"))?;
    let [wide, high] = terrain.grid().samples();
    println!("{} x {} samples, {} craters of 16 x 16 samples, one thread\n", wide, high, count);
    println!("{HEAD}");
    let craters = anywhere(&terrain, count);
    let batches_took = all(&terrain, "", &craters)?;
    println!("\n{batches_took}");
    if is_packed {
        let packed = folder.path().join("packed.iqt");
        pack(&SystemDisk, terrain.path(), &packed, &Silent)?;
        println!("\nPacked:\n\n{HEAD}");
        let batches_took = all(&Arc::new(Terrain::open_unmapped(&packed)?), "packed, ", &craters)?;
        println!("\n{batches_took}");
    }
    Ok(())
}

/// A line a way of making craters, and how batches went.
fn all(terrain: &Arc<Terrain>, name: &str, craters: &[Edit]) -> Result<String, Failure> {
    let mut editor = Editor::new(Arc::clone(terrain));
    one_by_one(&format!("{name}pages read as needed"), &mut editor, craters)?;
    editor.roll_back();
    one_by_one(&format!("{name}pages in memory"), &mut editor, craters)?;
    one_by_one(&format!("{name}the same again, on top"), &mut editor, craters)?;
    editor.roll_back();
    batches(&mut editor, craters, 1000)
}

/// Craters wherever there is ground for them.
fn anywhere(terrain: &Terrain, count: usize) -> Vec<Edit> {
    let extent = terrain.grid().extent_m();
    let mut dice = Dice(7);
    (0..count)
        .map(|_| {
            let centre_m = extent.map(|e| dice.below(e));
            crater(terrain, centre_m, dice.below(360.0))
        })
        .collect()
}

fn one_by_one(name: &str, editor: &mut Editor, craters: &[Edit]) -> Result<(), Failure> {
    let mut times_us = Vec::with_capacity(craters.len());
    let (mut samples, mut records, mut pages, mut refused) = (0, 0, 0, 0);
    for crater in craters {
        let start = Instant::now();
        let made = editor.apply(std::slice::from_ref(crater));
        let took = start.elapsed();
        match made {
            Ok(changes) => {
                times_us.push(took.as_secs_f64() * 1e6);
                samples += changes.samples.iter().map(|r| r.count()).sum::<usize>();
                records += changes.vertices.len();
                pages += changes.pages.len();
            }
            Err(LayoutError::OutOfRange { .. }) => refused += 1,
            Err(error) => return Err(error.into()),
        }
    }
    times_us.sort_unstable_by(f64::total_cmp);
    let made = times_us.len().max(1);
    let at = |share: f64| times_us.get(((made - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN);
    let total_s = times_us.iter().sum::<f64>() / 1e6;
    println!(
        "| {name} | {refused} | {:.1} | {:.1} | {:.1} | {:.0} | {:.0} | {:.0} | {:.1} |",
        at(0.5),
        at(0.99),
        at(1.0),
        made as f64 / total_s,
        samples as f64 / made as f64,
        records as f64 / made as f64,
        pages as f64 / made as f64
    );
    Ok(())
}

fn batches(editor: &mut Editor, craters: &[Edit], size: usize) -> Result<String, Failure> {
    let mut made = 0;
    let start = Instant::now();
    for batch in craters.chunks(size) {
        match editor.apply(batch) {
            Ok(_) => made += batch.len(),
            Err(LayoutError::OutOfRange { .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    let took = start.elapsed().as_secs_f64();
    Ok(format!("In batches of {size}: {made} craters in {took:.3} s, {:.0} a second.", made as f64 / took))
}
