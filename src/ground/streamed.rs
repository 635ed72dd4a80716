//! The kinetic engine over a terrain of which only some pages are in memory. Only the first frame waits for storage, and no longer than it was told to.
//!
//! Tiles of heights come from the same pool as the mesh. If pages of a tile are missing, they are asked for, and the tile is made once all have come. A
//! coarser tile is used meanwhile. Where a page cannot be read, heights are those of the finest triangles in memory.

use super::engine::{MeshEngine, Reads, Refined};
use super::options::StreamOptions;
use super::samples::{HeightTile, shown_m};
use crate::refine::Culling;
use crate::refine::kinetic::{Budget, Patch};
use crate::stream::{GroundPatch, HeightAt, StreamFrame, Streamed, ThreadFetch, height_at};
use crate::view::View;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::loader::Loader;
use terrasoar_layout::read::pool::PagePool;
use terrasoar_layout::read::store::RecordStore;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Frames by which a tile's pages are wanted.
const TILE_FRAMES: f32 = 6.0;
/// Tiles remembered as waiting.
const TILES_WAITING: usize = 256;

/// A streamed engine and its tiles.
struct StreamedMesh<C: RecordCodec> {
    streamed: Streamed<C, ThreadFetch>,
    reads: Reads,
    frame: StreamFrame,
    /// Pages that tiles lack.
    tiles: HashMap<HeightTile, Vec<u64>>,
    first_wait: Duration,
    budget: Budget,
    begun: bool,
}

/// The engine of a terrain whose pages are read by threads.
///
/// # Errors
/// The first page cannot be read, or the system gives no thread.
pub(super) fn streamed(
    terrain: &Arc<Terrain>,
    options: &StreamOptions,
) -> Result<Box<dyn MeshEngine>, LayoutError> {
    let loader = ThreadFetch::from(Loader::start(Arc::clone(terrain), options.threads)?);
    Ok(with_records!(terrain.pool(options.cache_bytes)?, pool => {
        let reads = Reads::over(&pool);
        let mut streamed = Streamed::new(pool, loader, options.culling, options.prefetch);
        streamed.engine_mut().set_budget(options.budget);
        Box::new(StreamedMesh {
            streamed,
            reads,
            frame: StreamFrame::default(),
            tiles: HashMap::new(),
            first_wait: options.first_wait,
            budget: options.budget,
            begun: false,
        }) as Box<dyn MeshEngine>
    }))
}

impl<C: RecordCodec> StreamedMesh<C> {
    /// Distinct pages of a tile that are away and can be read for all that is known.
    fn pages_away(&self, tile: HeightTile) -> Vec<u64> {
        let pool = self.streamed.engine().store();
        let k = pool.grid().k();
        let mut pages: Vec<u64> = tile
            .points(pool.grid().samples())
            .map(|point| slot_of(k, point))
            .filter(|slot| pool.get(*slot).is_none())
            .map(PagePool::<C>::page_of)
            .collect();
        pages.sort_unstable();
        pages.dedup();
        pages.retain(|page| !self.streamed.is_in_trouble(*page));
        pages
    }
}

impl<C: RecordCodec> MeshEngine for StreamedMesh<C> {
    fn update(&mut self, view: &View) -> Refined {
        // The first mesh is asked for as a whole, so the patches on the way to it are not missed.
        if !std::mem::replace(&mut self.begun, true) && self.first_wait > Duration::ZERO {
            self.streamed.fill(view, self.first_wait, &mut self.reads);
        }
        self.frame = self.streamed.update(view, &mut self.reads);
        let [reads, pages_read] = self.reads.take();
        Refined {
            work: self.frame.work,
            triangles: self.streamed.engine().triangle_count() as u64,
            record_bytes_read: reads * C::BYTES as u64,
            pages_read,
            pages_come: self.frame.pages_come,
        }
    }

    fn patch(&self) -> &Patch {
        self.streamed.engine().patch()
    }

    fn whole(&self) -> Patch {
        self.streamed.engine().whole_patch()
    }

    fn set_budget(&mut self, budget: Budget) -> bool {
        self.budget = budget;
        self.streamed.engine_mut().set_budget(budget);
        true
    }

    fn heights_m(&mut self, tile: HeightTile, heights_m: &mut Vec<f32>) -> bool {
        let pool = self.streamed.engine().store();
        let known = self.tiles.remove(&tile);
        let still_away = |page: &u64| !pool.is_resident(*page) && !self.streamed.is_in_trouble(*page);
        let away = match known {
            Some(mut pages) if pages.iter().any(still_away) => {
                pages.retain(still_away);
                pages
            }
            // Some may have been given up while the last ones came.
            _ => self.pages_away(tile),
        };
        if away.is_empty() {
            let (grid, k) = (*pool.grid(), pool.grid().k());
            let [dx, dy] = grid.spacing_m();
            heights_m.clear();
            heights_m.reserve(tile.count());
            heights_m.extend(tile.points(grid.samples()).map(|point| match pool.get(slot_of(k, point)) {
                Some(raw) => {
                    shown_m(&pool.decode(raw, if grid.is_corner(point) { 0 } else { grid.level(point) }))
                }
                None => {
                    let sounding = height_at(pool, f64::from(point.x()) * dx, f64::from(point.y()) * dy);
                    sounding.height_m.map_or(f32::NAN, |height_m| height_m as f32)
                }
            }));
            return true;
        }
        away.iter().for_each(|page| self.streamed.want(*page, TILE_FRAMES));
        // Tiles that nobody asks for any more are forgotten by and by.
        if self.tiles.len() >= TILES_WAITING {
            self.tiles.clear();
        }
        self.tiles.insert(tile, away);
        false
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.streamed.engine().store().shape().height_range_m
    }

    fn height_at(&self, east_m: f64, north_m: f64) -> HeightAt {
        height_at(self.streamed.engine().store(), east_m, north_m)
    }

    fn take_edits(&mut self, patch: GroundPatch) -> Result<bool, LayoutError> {
        self.streamed.take_ground(patch)?;
        Ok(true)
    }

    fn relocate(&mut self, places: &[(u64, Entry)]) {
        self.streamed.relocate(places);
    }

    fn held_pages(&self) -> usize {
        self.streamed.held_pages()
    }

    fn set_culling(&mut self, culling: Culling) -> bool {
        self.streamed.set_culling(culling);
        self.streamed.engine_mut().set_budget(self.budget);
        (self.begun, self.frame) = (false, StreamFrame::default());
        true
    }

    fn want_height(&mut self, east_m: f64, north_m: f64) {
        self.streamed.want_height(east_m, north_m);
    }

    fn is_waiting(&self) -> bool {
        let work = &self.frame.work;
        // What a budget leaves undone is done by the next updates; what none of them gets on with stays as it is.
        let is_late = work.late > work.unread && (work.tests > 0 || work.slots_written > 0);
        is_late || self.frame.outstanding > 0 || self.streamed.has_wants()
    }

    fn lacks_pages(&self) -> bool {
        self.frame.work.unread > 0
    }

    fn take_error(&mut self) -> Option<LayoutError> {
        self.streamed.take_error()
    }
}
