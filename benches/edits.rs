//! What a frame costs in which the ground in view changes in a thousand places at once.
//!
//! Questions: how long do the editor, the exchange of pages, the engine's walk ([`Engine::ground_changed`]) and its update take in a frame in which 1,000 craters of 16 x 16 samples
//! fall in view, and what does an update take without? Data: a terrain file named on the command line. Command:
//!
//!     cargo bench --bench edits -- TERRAIN.iqt [--craters N] [--frames N]
//!
//! A flight straight on, 800 x 600 pixels, 1 px, one thread. Every other frame craters fall, on the ground of the frames before: all over what is in view, or on the nearest 300
//! samples of it. Figures are medians over the frames with craters. The terrain is copied first, with room for heights beyond its own; nothing is written to. Prints
//! Markdown. Keep runs under benches/runs/.

#[path = "support/craters.rs"]
mod craters;

use craters::{Dice, Failure, crater, with_room};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround, generate};
use terrasoar::refine::change::GroundChange;
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::{View, Viewport};
use terrasoar_layout::edit::{Edit, Editor};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Frames flown before the first craters fall.
const WARM: usize = 20;

fn main() -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    let (mut path, mut count, mut frames) = (None, 1000, 21);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--craters" => count = words.next().ok_or("--craters wants a number")?.parse()?,
            "--frames" => frames = words.next().ok_or("--frames wants a number")?.parse::<usize>()?.max(1),
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
    println!("{wide} x {high} samples, {count} craters of 16 x 16 samples in each of {frames} frames\n");
    println!(
        "| where | culling | triangles | editor, ms | pages, ms | ground_changed, ms | update, ms | both, ms | update without, ms | records | pages | sent | tests | splits | merges |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    with_records!(terrain.records()?, records => {
        for (name, samples) in [("all over", f64::INFINITY), ("near", 300.0)] {
            for culling in Culling::ALL {
                let bombed = bomb(&terrain, &records, culling, samples, count, frames)?;
                println!("| {name} | {} | {bombed}", culling.name());
            }
        }
    });
    Ok(())
}

/// Craters in view, at most so many samples away.
fn in_view(terrain: &Terrain, view: &View, samples: f64, count: usize, dice: &mut Dice) -> Vec<Edit> {
    let extent_m = terrain.grid().extent_m();
    let [right, up, forward] = view.axes();
    let tan_y = (view.vertical_fov_rad / 2.0).tan();
    let tan_x = tan_y * f64::from(view.viewport.width_px) / f64::from(view.viewport.height_px);
    let farthest_m = samples * terrain.grid().spacing_m()[0];
    let mut craters = Vec::with_capacity(count);
    for _ in 0..10_000_000 {
        if craters.len() == count {
            break;
        }
        let span = |eye: f64, extent: f64| [(eye - farthest_m).max(0.0), (eye + farthest_m).min(extent)];
        let [[west, east], [south, north]] =
            [span(view.eye_m.x, extent_m[0]), span(view.eye_m.y, extent_m[1])];
        let centre_m = [west + dice.below(east - west), south + dice.below(north - south)];
        let Ok(Some(height_m)) = terrain.height_m(centre_m[0], centre_m[1]) else { continue };
        let to = glam::DVec3::new(centre_m[0], centre_m[1], height_m) - view.eye_m;
        let depth = to.dot(forward);
        if depth > 0.0 && to.dot(right).abs() <= depth * tan_x && to.dot(up).abs() <= depth * tan_y {
            craters.push(crater(terrain, centre_m, dice.below(360.0)));
        }
    }
    craters
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Flies and bombs; tells the medians as the rest of a row.
fn bomb<C: RecordCodec>(
    terrain: &Arc<Terrain>,
    records: &Records<'_, C>,
    culling: Culling,
    samples: f64,
    count: usize,
    frames: usize,
) -> Result<String, Failure> {
    let plan =
        FlightPlan::new(FlightKind::Straight, (WARM + 2 * frames) as u64, terrain.grid().spacing_m()[0]);
    let flown = generate(&TerrainGround::new(terrain), &plan)?.frames;
    let mut editor = Editor::new(Arc::clone(terrain));
    let mut engine = Kinetic::new(EditedRecords::new(records.clone()), culling);
    let mut dice = Dice(11);
    // A row of figures for each frame.
    let mut rows: Vec<[f64; 13]> = Vec::new();
    let mut without_ms = 0.0;
    for (i, frame) in flown.iter().enumerate() {
        let view = frame.view(Viewport::default(), 1.0);
        let is_bombed = i >= WARM && i % 2 == 1;
        if !is_bombed {
            let start = Instant::now();
            engine.update(&view, &mut Unobserved);
            without_ms = ms_since(start);
            continue;
        }
        let craters = in_view(terrain, &view, samples, count, &mut dice);
        let start = Instant::now();
        let changes = match editor.apply(&craters) {
            Ok(changes) => changes,
            Err(LayoutError::OutOfRange { .. }) => continue,
            Err(error) => return Err(error.into()),
        };
        let editor_ms = ms_since(start);
        let start = Instant::now();
        let height_range_m = editor.header().height_range_m;
        engine.store_mut().set_height_range_m(height_range_m);
        for page in &changes.pages {
            if let Some(bytes) = editor.edited_page(*page) {
                engine.store_mut().install(*page, bytes)?;
            }
        }
        let pages_ms = ms_since(start);
        let page = |logical| editor.edited_page(logical);
        let change = GroundChange { areas: &changes.samples, height_range_m, page: &page };
        let start = Instant::now();
        engine.ground_changed(&change);
        let told_ms = ms_since(start);
        let start = Instant::now();
        engine.update(&view, &mut Unobserved);
        let update_ms = ms_since(start);
        let work = engine.work();
        rows.push([
            engine.triangle_count() as f64,
            editor_ms,
            pages_ms,
            told_ms,
            update_ms,
            told_ms + update_ms,
            without_ms,
            changes.vertices.len() as f64,
            changes.pages.len() as f64,
            engine.patch().vertices.len() as f64,
            work.tests as f64,
            work.splits as f64,
            work.merges as f64,
        ]);
    }
    let column = |i: usize| median(rows.iter().map(|row| row[i]).collect());
    let times = (1..=6).map(|i| format!("{:.2}", column(i))).collect::<Vec<_>>().join(" | ");
    let counts = (7..=12).map(|i| format!("{:.0}", column(i))).collect::<Vec<_>>().join(" | ");
    Ok(format!("{:.0} | {times} | {counts} |", column(0)))
}
