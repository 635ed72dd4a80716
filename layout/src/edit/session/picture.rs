//! The picture's part of an editing session: paint in memory beside edited heights. It is committed, undone and redone together with them.
//!
//! The picture is opened when it is first painted or when going to another state changes it; a session that only edits heights reads nothing of it.

use super::EditSession;
use crate::edit::{Changes, Edit};
use crate::error::LayoutError;
use crate::file::header::{Header, ImageryPlace};
use crate::imagery::{OtherState, Paint, PaintChanges, PaintedSection, Painter, TileId};
use crate::read::terrain::Terrain;
use std::collections::BTreeSet;
use std::sync::Arc;

/// What a session knows of the picture.
#[derive(Debug, Default)]
pub(crate) struct Picture {
    painter: Option<Painter>,
    repainted: Repainted,
}

/// What has become of the picture since it was last asked for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repainted {
    /// Tiles whose bytes are others now.
    pub tiles: BTreeSet<TileId>,
    /// Whether it is another picture, or there is none any more: all tiles, and its shape perhaps.
    pub is_another: bool,
}

/// What another state of the file makes of the picture.
pub(crate) enum Turn {
    Same,
    Other(Box<OtherState>),
    Another,
}

impl Picture {
    /// Whether all paint is in the file.
    pub(crate) fn is_committed(&self) -> bool {
        self.painter.as_ref().is_none_or(Painter::is_committed)
    }

    /// What a commit is to write from page `first_page` on.
    pub(crate) fn section(&mut self, first_page: u64) -> Result<Option<PaintedSection>, LayoutError> {
        let Some(painter) = self.painter.as_mut().filter(|painter| !painter.is_committed()) else {
            return Ok(None);
        };
        let first_page = u32::try_from(first_page)
            .map_err(|_| LayoutError::Usage("a terrain file has at most 16 TiB".into()))?;
        painter.section(first_page)
    }

    /// A section was written.
    pub(crate) fn committed(&mut self, section: PaintedSection) {
        if let Some(painter) = &mut self.painter {
            painter.committed(section);
        }
    }

    /// The section that was asked for last was not written: all of it is to be painted again.
    pub(crate) fn failed(&mut self) {
        if let Some(painter) = &mut self.painter {
            painter.failed();
        }
    }

    /// Takes back what was painted since the last section.
    pub(crate) fn roll_back(&mut self) {
        if let Some(painter) = &mut self.painter {
            self.repainted.tiles.extend(painter.roll_back().tiles);
        }
    }

    /// Opens the picture, if there is one.
    fn open(
        &mut self,
        terrain: &Arc<Terrain>,
        header: &Header,
        original: Option<ImageryPlace>,
    ) -> Result<Option<&mut Painter>, LayoutError> {
        if self.painter.is_none() {
            let Some(current) = header.imagery else { return Ok(None) };
            let original = original.unwrap_or(current);
            let painter = Painter::open_at(Arc::clone(terrain), current, original, header.file_bytes)?;
            self.painter = Some(painter);
        }
        Ok(self.painter.as_mut())
    }

    /// Looks at the picture of another state of the file.
    pub(crate) fn turn(
        &mut self,
        terrain: &Arc<Terrain>,
        header: &Header,
        original: Option<ImageryPlace>,
        other: Option<ImageryPlace>,
    ) -> Result<Turn, LayoutError> {
        if other == header.imagery {
            return Ok(Turn::Same);
        }
        let (Some(painter), Some(place)) = (self.open(terrain, header, original)?, other) else {
            return Ok(Turn::Another);
        };
        let state = painter.state_at(place, header.file_bytes)?;
        Ok(state.map_or(Turn::Another, |state| Turn::Other(Box::new(state))))
    }

    /// The file is in that state now.
    pub(crate) fn turn_to(&mut self, turn: Turn) {
        match (turn, &mut self.painter) {
            (Turn::Same, _) => {}
            (Turn::Other(state), Some(painter)) => self.repainted.tiles.extend(painter.turn_to(*state).tiles),
            (Turn::Another | Turn::Other(_), _) => {
                self.painter = None;
                self.repainted = Repainted { tiles: BTreeSet::new(), is_another: true };
            }
        }
    }
}

impl EditSession {
    /// Paints on the picture, all of a batch or, on an error, none. It is in the next commit, together with edits.
    ///
    /// # Errors
    /// As [`Painter::paint`]; [`LayoutError::Usage`] for a terrain without imagery.
    pub fn paint(&mut self, paints: &[Paint]) -> Result<PaintChanges, LayoutError> {
        let changes = self.opened_painter()?.paint(paints)?;
        self.count_edits(paints.len());
        self.picture_mut().repainted.tiles.extend(&changes.tiles);
        Ok(changes)
    }

    /// Edits and paints, all of it or, on an error, nothing.
    ///
    /// # Errors
    /// As [`EditSession::apply`] and [`EditSession::paint`].
    pub fn apply_and_paint(
        &mut self,
        edits: &[Edit],
        paints: &[Paint],
    ) -> Result<(Changes, PaintChanges), LayoutError> {
        if paints.is_empty() {
            return Ok((self.apply(edits)?, PaintChanges::default()));
        }
        self.opened_painter()?.prepare(paints)?;
        let changes = self.apply(edits)?;
        // With all in memory this does not fail.
        Ok((changes, self.paint(paints)?))
    }

    /// The picture as it is now; `None` before anything was painted, and without imagery.
    pub fn painter(&self) -> Option<&Painter> {
        self.picture().painter.as_ref()
    }

    /// What paint, discarding, undoing and redoing have changed of the picture since the last call.
    pub fn take_repainted(&mut self) -> Repainted {
        std::mem::take(&mut self.picture_mut().repainted)
    }

    /// The picture as it is now, opened if need be; `None` without imagery.
    ///
    /// # Errors
    /// As [`Painter::open_at`].
    pub fn open_picture(&mut self) -> Result<Option<&Painter>, LayoutError> {
        Ok(self.painter_if_any()?.map(|painter| &*painter))
    }

    fn opened_painter(&mut self) -> Result<&mut Painter, LayoutError> {
        let missing = LayoutError::Usage(format!(
            "{}: there is no picture to paint on; drape one with `terrasoar drape`",
            self.editor().terrain().path().display()
        ));
        self.painter_if_any()?.ok_or(missing)
    }

    fn painter_if_any(&mut self) -> Result<Option<&mut Painter>, LayoutError> {
        let (terrain, header) = (Arc::clone(self.editor().terrain()), self.header().clone());
        let original = self.original_imagery();
        self.picture_mut().open(&terrain, &header, original)
    }
}
