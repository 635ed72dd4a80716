//! What is told of a script that was carried out, as text and as JSON.

use super::effect::Effect;
use crate::verbs::output::{decimal, grouped};
use crate::verbs::progress::short;
use serde::Serialize;
use std::path::Path;
use terrasoar::edits::LoadedBatch;
use terrasoar_layout::edit::Changes;
use terrasoar_layout::grid::Grid;

/// What was done.
#[derive(Debug, Default, Serialize)]
pub(super) struct Told {
    pub(super) file: String,
    pub(super) overlay: Option<String>,
    pub(super) dry_run: bool,
    pub(super) batches: u64,
    pub(super) edits: u64,
    pub(super) edits_outside: u64,
    pub(super) samples: u64,
    pub(super) records_changed: u64,
    pub(super) voids_passed: u64,
    pub(super) tiles_painted: u64,
    pub(super) pages_written: u64,
    pub(super) bytes_appended: u64,
    pub(super) widenings: u32,
    pub(super) needs_widening: bool,
    /// Samples that are at another height in the end; `None` where that was not measured.
    changed_samples: Option<u64>,
    /// As an area.
    changed_m2: Option<f64>,
    /// The largest lowering (negative or 0) and raising in metres.
    change_m: Option<[f64; 2]>,
    /// Batches that the file or overlay held in force before these.
    pub(super) batches_before: u64,
    pub(super) seconds: f64,
    #[serde(skip)]
    spacing_m: [f64; 2],
}

impl Told {
    /// Of work that begins.
    pub(super) fn begin(file: &Path, overlay: Option<&Path>, dry_run: bool) -> Self {
        let overlay = overlay.map(|overlay| overlay.display().to_string());
        Self { file: file.display().to_string(), overlay, dry_run, ..Self::default() }
    }

    /// What became of the ground in the end.
    pub(super) fn measured(&mut self, effect: Option<Effect>, grid: &Grid) {
        self.spacing_m = grid.spacing_m();
        let [dx, dy] = self.spacing_m;
        self.changed_samples = effect.map(|effect| effect.samples);
        self.changed_m2 = effect.map(|effect| effect.samples as f64 * dx * dy);
        self.change_m = effect.map(|effect| effect.by_m);
    }

    pub(super) fn note(&mut self, batch: &LoadedBatch, grid: &Grid, changes: &Changes) {
        self.batches += 1;
        self.edits += batch.edits.len() as u64;
        self.edits_outside += batch.edits.iter().filter(|edit| edit.bounds(grid).is_none()).count() as u64;
        self.samples += changes.samples.iter().map(|rect| rect.count() as u64).sum::<u64>();
        self.records_changed += changes.vertices.len() as u64;
        self.voids_passed += changes.voids_passed;
    }

    pub(super) fn text(&self) -> String {
        let plural = |count: u64, one: &str, more: &str| {
            format!("{} {}", grouped(count), if count == 1 { one } else { more })
        };
        let file = self.overlay.as_ref().unwrap_or(&self.file);
        let mut text = format!(
            "{file}: {} in {}, {:.2} s ({} edits/s)",
            plural(self.edits, "edit", "edits"),
            plural(self.batches, "batch", "batches"),
            self.seconds,
            short(self.edits as f64 / self.seconds.max(1e-9)),
        );
        if let Some(change_m) = self.change_m.filter(|change_m| *change_m != [0.0; 2]) {
            let [down, up] = change_m.map(|m| decimal(m.abs(), 3));
            let by = match change_m {
                [0.0, _] => format!("raised by up to {up} m"),
                [_, 0.0] => format!("lowered by up to {down} m"),
                _ => format!("lowered by up to {down} m and raised by up to {up} m"),
            };
            let area = decimal(self.changed_m2.unwrap_or_default(), 0);
            text += &format!("\nchanged: {area} m2 of ground, {by}");
        } else if self.changed_samples == Some(0) {
            let [dx, dy] = self.spacing_m.map(|m| decimal(m, 3));
            text += &format!(
                "\nchanged: nothing; samples are {dx} x {dy} m apart, and no edit reached one, or the ground was so already"
            );
        }
        if self.edits_outside > 0 {
            text += &format!(
                "\n{} no sample: {} between them",
                plural(self.edits_outside, "edit reaches", "edits reach"),
                if self.edits_outside == 1 { "it lies" } else { "they lie" }
            );
        }
        if self.voids_passed > 0 {
            text += &format!("\n{} without data passed over", plural(self.voids_passed, "sample", "samples"));
        }
        if self.tiles_painted > 0 {
            text += &format!("\n{} of the picture painted", plural(self.tiles_painted, "tile", "tiles"));
        }
        text += &match (self.dry_run, self.needs_widening) {
            (true, false) => "\na dry run: nothing was written".to_owned(),
            (true, true) => {
                "\na dry run, as far as the file's range of heights goes: nothing was written".to_owned()
            }
            _ => format!("\n{} bytes appended", grouped(self.bytes_appended)),
        };
        if self.batches_before > 0 && !self.dry_run {
            let with = self.overlay.as_ref().map_or_else(String::new, |o| format!(" --overlay {o}"));
            text += &format!(
                "\non top of {} in it before; `terrasoar undo {}{with}` takes back the last",
                plural(self.batches_before, "batch", "batches"),
                self.file
            );
        }
        text
    }
}
