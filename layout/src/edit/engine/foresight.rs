//! Which heights edits will lead to, found without making records. So a file can be rewritten with room for them before the first batch, instead of in the middle.
//!
//! **The answer may be a little too wide:** heights are not rounded between edits as records round them. Cost: that of [`Edit::apply`] and a copy of each window; 8 bytes for every
//! sample of the 64 x 64 tiles that edits touch.

use crate::edit::operations::area::shared;
use crate::edit::{Edit, Editor, HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::file::header::Header;
use crate::read::terrain::Terrain;
use std::collections::HashMap;
use std::sync::Arc;

/// Samples a side of a tile.
const SIDE: u32 = 64;
/// Largest height code of compact records, and half a step, which is rounded down to it.
const LARGEST_CODE: f64 = 65_535.5;

/// Heights under edits that are only looked at.
#[derive(Debug)]
pub struct Foresight {
    ground: Editor,
    /// The terrain before all edits that its journal knows, if that is another one.
    original: Option<Editor>,
    tiles: HashMap<[u32; 2], HeightWindow>,
    heights_m: Option<[f64; 2]>,
}

impl Foresight {
    /// Over a terrain as it is.
    ///
    /// # Errors
    /// I/O; a damaged journal.
    pub fn new(terrain: Arc<Terrain>) -> Result<Self, LayoutError> {
        let original = match terrain.header().history {
            Some(_) => Some(Editor::new(Arc::new(terrain.open_again_unmapped()?.into_original()?))),
            None => None,
        };
        Ok(Self { ground: Editor::new(terrain), original, tiles: HashMap::new(), heights_m: None })
    }

    /// Lowest and highest height in metres that any edit so far gave to a sample; `None` if they changed nothing.
    pub fn heights_m(&self) -> Option<[f64; 2]> {
        self.heights_m
    }

    /// Follows one more edit.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for numbers that cannot be used; damage and I/O.
    pub fn follow(&mut self, edit: &Edit) -> Result<(), LayoutError> {
        let grid = *self.ground.terrain().grid();
        edit.check(&grid)?;
        let Some(bounds) = edit.bounds(&grid) else { return Ok(()) };
        let around = bounds.grown(edit.margin(), &grid);
        let mut window = HeightWindow::new(around, vec![f64::NAN; around.count()])?;
        for tile in self.tiles_of(around) {
            copy(self.tile(tile)?, &mut window);
        }
        let original = match (edit.needs_original(), &mut self.original) {
            (false, _) => None,
            (true, Some(original)) => Some(original.heights(around)?),
            (true, None) => Some(self.ground.heights(around)?),
        };
        let before = window.clone();
        edit.apply(&grid, &mut window, original.as_ref());
        for (old, new) in before.heights_m().iter().zip(window.heights_m()) {
            // Voids are equal to nothing, and stay.
            if old != new && !new.is_nan() {
                let [low, high] = self.heights_m.unwrap_or([*new, *new]);
                self.heights_m = Some([low.min(*new), high.max(*new)]);
            }
        }
        for tile in self.tiles_of(around) {
            copy(&window, self.tile(tile)?);
        }
        Ok(())
    }

    fn tiles_of(&self, rect: SampleRect) -> impl Iterator<Item = [u32; 2]> + use<> {
        let columns = rect.west / SIDE..=rect.east / SIDE;
        (rect.south / SIDE..=rect.north / SIDE).flat_map(move |v| columns.clone().map(move |u| [u, v]))
    }

    fn tile(&mut self, tile: [u32; 2]) -> Result<&mut HeightWindow, LayoutError> {
        use std::collections::hash_map::Entry;
        match self.tiles.entry(tile) {
            Entry::Occupied(tile) => Ok(tile.into_mut()),
            Entry::Vacant(place) => {
                let [west, south] = tile.map(|side| side * SIDE);
                let corner = SampleRect { west, south, east: west, north: south };
                let rect = SampleRect { east: west + SIDE - 1, north: south + SIDE - 1, ..corner };
                let rect = rect.grown(0, self.ground.terrain().grid());
                Ok(place.insert(self.ground.heights(rect)?))
            }
        }
    }
}

/// Copies what two windows share.
fn copy(from: &HeightWindow, to: &mut HeightWindow) {
    let Some(rect) = shared(from.rect(), to.rect()) else { return };
    let wide = rect.wide() as usize;
    for y in rect.south..=rect.north {
        let (source, target) = (from.index(rect.west, y), to.index(rect.west, y));
        to.heights_m_mut()[target..target + wide].copy_from_slice(&from.heights_m()[source..source + wide]);
    }
}

/// Whether the records of a file can hold these heights (lowest and highest) beside its own. Slopes may still be too steep for it.
pub fn holds_heights(header: &Header, heights_m: [f64; 2]) -> bool {
    let scale = header.scale;
    if !header.record_kind.has_height_codes() {
        return heights_m.iter().all(|height| height.abs() <= 1e9);
    }
    let [low, high] = header.height_range_m;
    let range_m = high.max(heights_m[1]) - low.min(heights_m[0]);
    let [first, last] = heights_m.map(|height| (height - scale.height_base_m) / scale.height_step_m);
    first >= -0.5 && last < LARGEST_CODE && range_m * (1.0 + 1e-6) <= scale.error_top_m * (1.0 + 1e-12)
}
