//! The feed of a terrain of which only some pages are in memory: nothing that it does waits for storage but the first frame, half a second at most.
//!
//! Tiles of heights are made of the same pool as the mesh. Where pages of one are away they are asked for, and the tile is made once all have come; a
//! coarser one stands in meanwhile. Where a page cannot be read, heights are those of the finest triangles at hand.

use super::feed::{Feed, Reads, Refined, shown_m, tile_points};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use terrasoar::refine::Culling;
use terrasoar::refine::kinetic::Patch;
use terrasoar::stream::{GroundPatch, Prefetch, StreamFrame, Streamed, ThreadFetch, height_at};
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::imagery::TileId;
use terrasoar_layout::read::loader::Loader;
use terrasoar_layout::read::pool::PagePool;
use terrasoar_layout::read::store::RecordStore;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;
use terrasoar_render::HEIGHTS_PER_TILE;

/// Threads that read: as many reads are under way at once.
const THREADS: usize = 4;
/// Longest that the first frame waits for its pages.
const FIRST_WAIT: Duration = Duration::from_millis(500);
/// Frames by which a tile's pages are wanted.
const TILE_FRAMES: f32 = 6.0;
/// Tiles remembered as waiting.
const TILES_WAITING: usize = 256;

/// A streamed engine as the renderer sees it.
struct StreamedFeed<C: RecordCodec> {
    streamed: Streamed<C, ThreadFetch>,
    reads: Reads,
    frame: StreamFrame,
    /// Pages that tiles lack.
    tiles: HashMap<TileId, Vec<u64>>,
    begun: bool,
}

/// The feed of a terrain whose pages are read into `cache_bytes` of memory.
///
/// # Errors
/// The first page cannot be read, or the system gives no thread.
pub fn streamed_feed(
    terrain: &Arc<Terrain>,
    cache_bytes: u64,
    culling: Culling,
) -> Result<Box<dyn Feed>, LayoutError> {
    let loader = ThreadFetch::from(Loader::start(Arc::clone(terrain), THREADS)?);
    Ok(with_records!(terrain.pool(cache_bytes)?, pool => {
        let reads = Reads::over(&pool);
        let streamed = Streamed::new(pool, loader, culling, Prefetch::Deadline);
        Box::new(StreamedFeed { streamed, reads, frame: StreamFrame::default(), tiles: HashMap::new(), begun: false }) as Box<dyn Feed>
    }))
}

impl<C: RecordCodec> StreamedFeed<C> {
    /// Distinct pages of a tile that are away and can be read for all that is known.
    fn pages_away(&self, tile: TileId) -> Vec<u64> {
        let pool = self.streamed.engine().store();
        let k = pool.grid().k();
        let mut pages: Vec<u64> = tile_points(pool.grid().samples(), tile)
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

impl<C: RecordCodec> Feed for StreamedFeed<C> {
    fn update(&mut self, view: &View) -> Refined {
        // The first mesh is asked for as a whole, so the patches on the way to it are not missed.
        if !std::mem::replace(&mut self.begun, true) {
            self.streamed.fill(view, FIRST_WAIT, &mut self.reads);
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

    fn heights_m(&mut self, tile: TileId, heights_m: &mut Vec<f32>) -> bool {
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
            heights_m.reserve(HEIGHTS_PER_TILE);
            heights_m.extend(tile_points(grid.samples(), tile).map(
                |point| match pool.get(slot_of(k, point)) {
                    Some(raw) => {
                        shown_m(&pool.decode(raw, if grid.is_corner(point) { 0 } else { grid.level(point) }))
                    }
                    None => {
                        let sounding = height_at(pool, f64::from(point.x()) * dx, f64::from(point.y()) * dy);
                        sounding.height_m.map_or(f32::NAN, |height_m| height_m as f32)
                    }
                },
            ));
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

    fn ground_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
        height_at(self.streamed.engine().store(), east_m, north_m).height_m
    }

    fn ground_changed(&mut self, patch: GroundPatch) -> Result<bool, LayoutError> {
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
        (self.begun, self.frame) = (false, StreamFrame::default());
        true
    }

    fn want_ground(&mut self, east_m: f64, north_m: f64) {
        self.streamed.want_height(east_m, north_m);
    }

    fn is_waiting(&self) -> bool {
        self.frame.outstanding > 0 || self.streamed.has_wants()
    }

    fn lacks_pages(&self) -> bool {
        self.frame.work.unread > 0
    }

    fn take_error(&mut self) -> Option<LayoutError> {
        self.streamed.take_error()
    }
}
