//! Batches applied to a file, one durable commit each, or in memory only. Where heights need more room, the file is rewritten.

use super::effect::Touched;
use super::paint::paints_of;
use super::told::Told;
use crate::verbs::output::{complain, decimal};
use crate::verbs::overlays;
use crate::verbs::progress::Meter;
use crate::verbs::within;
use anyhow::{Context, Result, anyhow, bail};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use terrasoar::edits::LoadedBatch;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Edit, EditSession, Editor, Foresight, holds_heights, room_for, widen};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::grid::Grid;
use terrasoar_layout::read::terrain::Terrain;

/// Memory for rewriting a file in MiB.
const WIDEN_MIB: u64 = 512;
/// Times that one batch may make the file be rewritten: once for heights, once for slopes, and one to spare.
const MOST_WIDENINGS: u32 = 3;

/// What is edited: a file, or an overlay over it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Target<'a> {
    pub(super) file: &'a Path,
    pub(super) overlay: Option<&'a Path>,
}

impl Target<'_> {
    pub(super) fn session(self) -> Result<EditSession, LayoutError> {
        match self.overlay {
            Some(overlay) => EditSession::open_overlay(self.file, overlay),
            None => EditSession::open(self.file),
        }
    }

    /// The file that edits go to.
    pub(super) fn path(&self) -> &Path {
        self.overlay.unwrap_or(self.file)
    }

    /// The terrain as it is, for looking only; an overlay that does not exist yet is an empty one.
    pub(super) fn terrain(self) -> Result<Terrain, LayoutError> {
        match self.overlay {
            Some(overlay) if overlay.exists() => Terrain::open_with_overlay_unmapped(self.file, overlay),
            _ => Terrain::open_unmapped(self.file),
        }
    }
}

/// A script being carried out.
pub(super) struct Work<'a> {
    pub(super) target: Target<'a>,
    pub(super) batches: &'a [LoadedBatch],
    /// Where they were read; `None` where they were made here.
    pub(super) script: Option<&'a Path>,
    /// Whether the picture follows, where there is one.
    pub(super) paints: bool,
    /// Whether the file may be rewritten under overlays.
    pub(super) is_forced: bool,
    pub(super) progress: &'a Meter,
}

impl Work<'_> {
    fn begin(&self, dry_run: bool) -> Told {
        let edits = self.batches.iter().map(|batch| batch.edits.len() as u64).sum();
        self.progress.begin(if dry_run { "trying" } else { "editing" }, edits);
        Told::begin(self.target.file, self.target.overlay, dry_run)
    }

    /// Refuses a script of which not everything can be applied, before anything is; rewrites the file if it has no room for the heights that the script leads to.
    fn prepare(&self, held: Option<EditSession>) -> Result<u32> {
        let terrain = self.target.terrain()?;
        self.check(terrain.grid())?;
        let header = terrain.header().clone();
        let edits = self.batches.iter().map(|batch| batch.edits.len() as u64).sum();
        self.progress.begin("looking ahead", edits);
        let mut foresight = Foresight::new(Arc::new(terrain))?;
        for edit in self.batches.iter().flat_map(|batch| &batch.edits) {
            foresight.follow(edit)?;
            self.progress.add(1);
        }
        let Some(heights_m) = foresight.heights_m().filter(|range| !holds_heights(&header, *range)) else {
            return Ok(0);
        };
        // The rewriting takes the lock for itself.
        drop((foresight, held));
        let [low, high] = header.height_range_m.map(|m| decimal(m, 1));
        let [lowest, highest] = heights_m.map(|m| decimal(m, 1));
        self.widen(
            &header,
            heights_m,
            self.batches,
            &format!("the edits lead to heights from {lowest} to {highest} m, and records of a file from {low} to {high} m cannot hold them"),
        )?;
        Ok(1)
    }

    fn check(&self, grid: &Grid) -> Result<()> {
        for (number, batch) in (1_u64..).zip(self.batches) {
            for edit in &batch.edits {
                edit.check(grid).with_context(|| self.named(number, batch))?;
            }
        }
        let warning = within::edits(self.batches, grid, self.script)?;
        warning.iter().for_each(|words| self.progress.note(words));
        Ok(())
    }

    fn named(&self, number: u64, batch: &LoadedBatch) -> String {
        format!("{}: batch {number} ({})", self.target.path().display(), batch.label)
    }

    /// Applies everything in memory.
    pub(super) fn rehearse(&self) -> Result<Told> {
        let start = Instant::now();
        let terrain = Arc::new(self.target.terrain()?);
        let grid = *terrain.grid();
        self.check(&grid)?;
        let mut told = self.begin(true);
        let (mut editor, mut touched) = (Editor::new(Arc::clone(&terrain)), Touched::default());
        if terrain.header().history.is_some() {
            editor.set_original(Arc::new(terrain.open_again_unmapped()?.into_original()?));
        }
        for (number, batch) in (1_u64..).zip(self.batches) {
            match editor.apply(&batch.edits) {
                Ok(changes) => {
                    touched.note(&changes);
                    told.note(batch, &grid, &changes);
                }
                Err(LayoutError::OutOfRange { problem, .. }) => {
                    told.needs_widening = true;
                    self.progress.note(&format!(
                        "note: {}: {problem}; without --dry-run it is",
                        self.named(number, batch)
                    ));
                    break;
                }
                Err(error) => return Err(anyhow!(error).context(self.named(number, batch))),
            }
            self.progress.add(batch.edits.len() as u64);
        }
        told.measured(touched.effect(&mut Editor::new(terrain), &mut editor)?, &grid);
        told.seconds = start.elapsed().as_secs_f64();
        Ok(told)
    }

    /// Applies everything, batch by batch, each durable before the next.
    pub(super) fn perform(&self) -> Result<Told> {
        let start = Instant::now();
        // The lock first, so that a second writer hears of it before anything else; an overlay is not made for a script that is refused.
        let held = if self.target.overlay.is_none() { Some(self.target.session()?) } else { None };
        let widenings = self.prepare(held)?;
        let mut session = self.target.session()?;
        overlays::tell_of_older(session.editor().terrain());
        let (mut ground_before, mut touched) =
            (Some(Editor::new(Arc::new(self.target.terrain()?))), Touched::default());
        let grid = *session.editor().terrain().grid();
        let mut told = self.begin(false);
        told.widenings = widenings;
        told.batches_before = session.commits_in_force()?.into();
        for (number, batch) in (1_u64..).zip(self.batches) {
            let before = told.batches;
            let failed = || match before {
                0 => self.named(number, batch),
                1 => format!(
                    "{}; the batch before it is in the file, and terrasoar undo takes it back",
                    self.named(number, batch)
                ),
                done => format!(
                    "{}; {done} batches before it are in the file, and terrasoar undo takes them back",
                    self.named(number, batch)
                ),
            };
            let mut widenings = 0;
            let changes = loop {
                let paints = match session.header().imagery {
                    Some(_) if self.paints => paints_of(&batch.edits, &grid),
                    _ => Vec::new(),
                };
                match session.apply_and_paint(&batch.edits, &paints) {
                    Ok((changes, painted)) => {
                        told.tiles_painted += painted.tiles.len() as u64;
                        break changes;
                    }
                    Err(LayoutError::OutOfRange { heights_m, problem, .. }) if widenings < MOST_WIDENINGS => {
                        widenings += 1;
                        let header = session.header().clone();
                        // The rewriting takes the lock for itself, and some systems do not replace what is open.
                        ground_before = None;
                        drop(session);
                        let rest = self.batches.get(number as usize - 1..).unwrap_or_default();
                        self.widen(&header, heights_m, rest, &problem).with_context(failed)?;
                        session = self.target.session()?;
                        self.progress
                            .begin("editing", self.batches.iter().map(|b| b.edits.len() as u64).sum());
                        self.progress.set(told.edits);
                    }
                    Err(error) => return Err(anyhow!(error).context(failed())),
                }
            };
            told.widenings += widenings;
            let committed = session.commit(&batch.label).with_context(failed)?;
            touched.note(&changes);
            told.note(batch, &grid, &changes);
            told.pages_written += committed.pages;
            told.bytes_appended += committed.bytes;
            self.progress.set(told.edits);
        }
        if let Some(before) = &mut ground_before {
            // The edits are on the disk: what cannot be measured is no reason to do them again.
            let effect = touched.effect(before, session.editor_mut()).unwrap_or_else(|error| {
                self.progress.note(&format!("note: how much of the ground changed cannot be told: {error}"));
                None
            });
            told.measured(effect, &grid);
        }
        told.seconds = start.elapsed().as_secs_f64();
        Ok(told)
    }

    /// Rewrites the file, which has this header, with room for other heights, before it goes on with `rest`.
    fn widen(&self, header: &Header, heights_m: [f64; 2], rest: &[LoadedBatch], problem: &str) -> Result<()> {
        let file = self.target.file.display();
        if let Some(overlay) = self.target.overlay {
            let with =
                if overlay.exists() { format!(" --overlay {}", overlay.display()) } else { String::new() };
            bail!(
                "{}: {problem}; an overlay cannot change that: make a file of its own with `terrasoar compact {file}{with} -o NEW.iqt` and edit that",
                overlay.display()
            );
        }
        let restores = rest.iter().flat_map(|batch| &batch.edits).any(Edit::needs_original);
        if restores && header.history.is_some() && !self.is_forced {
            bail!(
                "{file}: {problem}; the file would be rewritten for that, and the ground as it is now would be what the script's restore leads back to: restore first, in a script of its own, or rewrite it all the same (--force)"
            );
        }
        overlays::refuse_rewriting(self.target.file, self.is_forced)
            .with_context(|| format!("{file}: {problem}"))?;
        let room = room_for(header, heights_m);
        let [lowest, highest] = [room.lowest_m, room.highest_m].map(|m| decimal(m, 1));
        let ends = match header.history {
            Some(_) => "; what was edited before can no longer be undone",
            None => "",
        };
        self.progress.note(&format!(
            "note: {file}: {problem}: rewriting it with room for {lowest} to {highest} m{ends}"
        ));
        let new = widen(&SystemDisk, self.target.file, room, WIDEN_MIB, self.progress)?;
        if new.record_kind != header.record_kind {
            let bytes = new.record_kind.bytes();
            complain(&format!(
                "note: {file}: records take {bytes} bytes now instead of {}",
                header.record_kind.bytes()
            ));
        }
        Ok(())
    }
}
