//! The ground of a replay: as it is, or edited between frames.

use super::ReplayError;
use crate::refine::Engine;
use crate::refine::change::GroundChange;
use std::sync::Arc;
use std::time::Instant;
use terrasoar_layout::edit::{Changes, Edit, Editor};
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::store::CompleteStore;
use terrasoar_layout::read::terrain::Terrain;

/// Edits that happen before one frame of a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedBatch {
    /// The frame, from 0.
    pub frame: usize,
    /// What happens, all of it or nothing.
    pub edits: Vec<Edit>,
}

/// What edits before a frame did.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Edited {
    /// Records that are others now.
    pub(super) records: u64,
    /// Time the editor took, in milliseconds.
    pub(super) edit_ms: f64,
}

/// Ground that an engine `E` flies over.
pub(super) trait Ground<E> {
    /// Does what is to happen before a frame.
    fn edit(&mut self, frame: usize) -> Result<Edited, ReplayError>;

    /// Tells the engine, if anything has happened.
    fn tell(&mut self, engine: &mut E) -> Result<(), ReplayError>;
}

/// Nothing happens.
pub(super) struct Still;

impl<E> Ground<E> for Still {
    fn edit(&mut self, _: usize) -> Result<Edited, ReplayError> {
        Ok(Edited::default())
    }

    fn tell(&mut self, _: &mut E) -> Result<(), ReplayError> {
        Ok(())
    }
}

/// Edits in memory, of which the file hears nothing.
pub(super) struct Changing<'b> {
    editor: Editor,
    batches: &'b [TimedBatch],
    changes: Vec<Changes>,
}

impl<'b> Changing<'b> {
    /// Over a terrain as it is; what edits restore is what it was before all that its journal knows.
    pub(super) fn new(terrain: &Arc<Terrain>, batches: &'b [TimedBatch]) -> Result<Self, ReplayError> {
        let mut editor = Editor::new(Arc::clone(terrain));
        let is_restoring = batches.iter().flat_map(|batch| &batch.edits).any(Edit::needs_original);
        if is_restoring && terrain.header().history.is_some() {
            editor.set_original(Arc::new(terrain.open_again_unmapped()?.into_original()?));
        }
        Ok(Self { editor, batches, changes: Vec::new() })
    }
}

impl<S: CompleteStore, E: Engine<Store = EditedRecords<S>>> Ground<E> for Changing<'_> {
    fn edit(&mut self, frame: usize) -> Result<Edited, ReplayError> {
        self.changes.clear();
        let start = Instant::now();
        for batch in self.batches.iter().filter(|batch| batch.frame == frame) {
            self.changes.push(self.editor.apply(&batch.edits)?);
        }
        if self.changes.is_empty() {
            return Ok(Edited::default());
        }
        let records = self.changes.iter().map(|changes| changes.vertices.len() as u64).sum();
        Ok(Edited { records, edit_ms: start.elapsed().as_secs_f64() * 1e3 })
    }

    fn tell(&mut self, engine: &mut E) -> Result<(), ReplayError> {
        for changes in &self.changes {
            tell_engine(&self.editor, changes, engine)?;
        }
        Ok(())
    }
}

impl Changing<'_> {
    /// Both at once, for those who do not time.
    pub(super) fn edit_and_tell<S: CompleteStore, E: Engine<Store = EditedRecords<S>>>(
        &mut self,
        frame: usize,
        engine: &mut E,
    ) -> Result<(), ReplayError> {
        Ground::<E>::edit(self, frame)?;
        Ground::<E>::tell(self, engine)
    }
}

/// Replaces the pages that changed in an engine's store, and tells the engine.
fn tell_engine<S: CompleteStore, E: Engine<Store = EditedRecords<S>>>(
    editor: &Editor,
    changes: &Changes,
    engine: &mut E,
) -> Result<(), ReplayError> {
    let height_range_m = editor.header().height_range_m;
    let store = engine.store_mut();
    store.set_height_range_m(height_range_m);
    for page in &changes.pages {
        if let Some(bytes) = editor.edited_page(*page) {
            store.install(*page, bytes)?;
        }
    }
    let page = |logical: u64| editor.edited_page(logical);
    engine.ground_changed(&GroundChange { areas: &changes.samples, height_range_m, page: &page });
    Ok(())
}
