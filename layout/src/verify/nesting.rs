//! What records promise of one another: nested errors and radii, classes, folded padding, heights in the range stated, voids counted.
//!
//! Parents and children lie together within each level, so a task that walks neighbouring pages finds nearly every child in a small
//! cache of pages. Pages that failed their checksum are left out, and so are relations that reach into them: their problem is known already.
//! Absent pages are not walked, however many there are. Where the page of a vertex's parents is absent, the vertex looks up as well as down,
//! and the count of heights shows whether samples got lost in an absent page. Cost: four children a vertex, about 0.2 microseconds.

use super::{Findings, TASK_PAGES, record_page};
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::file::header::{Header, INERT_PAGE};
use crate::grid::order::{point_of, slot_of};
use crate::grid::record::{RecordCodec, Vertex, VertexClass};
use crate::grid::{Grid, GridPoint};
use crate::read::store::{byte_in_page, page_of, records_per_page};
use crate::read::terrain::Terrain;
use rayon::prelude::*;

/// Pages a task keeps; a power of two. A page's children lie in a handful of places.
const CACHED_PAGES: usize = 64;
/// Least ratio of a radius to distance and radius of a child (FORMAT.md, section 3).
const MARGIN: f64 = 1.0 + 1.0 / (1 << 20) as f64;
/// Rounding of distances in double precision, which another program may do in another order.
const ROUNDING: f64 = 1.0 + 1e-12;

/// What a run of pages adds up to.
#[derive(Debug, Default)]
struct Tally {
    findings: Findings,
    vertices: u64,
    /// Samples of the DEM that have a height.
    heights: u64,
}

impl Tally {
    fn merge(self, other: Self) -> Self {
        Self {
            findings: self.findings.merge(other.findings),
            vertices: self.vertices + other.vertices,
            heights: self.heights + other.heights,
        }
    }
}

/// Checks the records of the pages `present` that are not `damaged` (both sorted); gives the problems and the vertices seen.
pub(super) fn check<C: RecordCodec>(
    terrain: &Terrain,
    codec: &C,
    present: &[u64],
    damaged: &[u64],
    progress: &(dyn Fn(u64) + Sync),
) -> Result<(Findings, u64), LayoutError> {
    let grid = terrain.grid();
    let reach: Vec<u32> = (0..grid.levels()).map(|level| grid.reach_steps(level)).collect();
    let edges: Vec<f64> = (0..grid.levels()).map(|level| grid.edge_m(level)).collect();
    let task = |pages: &[u64]| {
        let mut walk = Walk {
            grid,
            header: terrain.header(),
            reach: &reach,
            edges: &edges,
            looks_up: (present.len() as u64) < terrain.page_count(),
            records: Cache::new(terrain, codec, damaged),
        };
        let mut tally = Tally::default();
        for &page in pages {
            if damaged.binary_search(&page).is_err() {
                walk.page(page, &mut tally)?;
            }
        }
        progress(pages.len() as u64);
        Ok::<_, LayoutError>(tally)
    };
    let tally = present
        .par_chunks(TASK_PAGES)
        .map(task)
        .try_reduce(Tally::default, |left, right| Ok(left.merge(right)))?;
    let mut findings = tally.findings;
    let [wide, high] = grid.samples().map(u64::from);
    let stated = wide * high - terrain.header().nodata_samples;
    if tally.heights != stated && damaged.is_empty() {
        let problem = format!("it says that {stated} samples have a height; {} have one", tally.heights);
        findings.add("header".into(), problem);
    }
    Ok((findings, tally.vertices))
}

/// The records of a file behind a small cache, damaged pages left out.
struct Cache<'a, C: RecordCodec> {
    terrain: &'a Terrain,
    codec: &'a C,
    damaged: &'a [u64],
    /// By the low bits of the page's number: whose bytes these are.
    held: Vec<Option<(u64, Box<Page>)>>,
}

impl<'a, C: RecordCodec> Cache<'a, C> {
    fn new(terrain: &'a Terrain, codec: &'a C, damaged: &'a [u64]) -> Self {
        Self { terrain, codec, damaged, held: std::iter::repeat_with(|| None).take(CACHED_PAGES).collect() }
    }

    fn is_absent(&self, slot: u64) -> bool {
        // All leaves were read before.
        self.terrain.known_entry(page_of::<C>(slot)).is_none_or(|entry| !entry.is_present())
    }

    fn page(&mut self, page: u64) -> Result<&Page, LayoutError> {
        let place = &mut self.held[page as usize % CACHED_PAGES];
        let (whose, bytes) = place.get_or_insert_with(|| (u64::MAX, Box::new([0; PAGE_BYTES])));
        if *whose != page {
            *whose = u64::MAX;
            let entry = self.terrain.entry(page)?;
            let number = if entry.is_present() { entry.page } else { INERT_PAGE };
            self.terrain.source().read_at(u64::from(number) * PAGE_BYTES as u64, &mut bytes[..])?;
            *whose = page;
        }
        Ok(bytes)
    }

    /// The vertex at a slot; `None` on a damaged page.
    fn vertex(&mut self, slot: u64, level: u32) -> Result<Option<Vertex>, LayoutError> {
        let page = page_of::<C>(slot);
        if !self.damaged.is_empty() && self.damaged.binary_search(&page).is_ok() {
            return Ok(None);
        }
        let codec = self.codec;
        let at = byte_in_page::<C>(slot);
        let bytes = self.page(page)?;
        Ok(Some(codec.decode(C::read(&bytes[at..]), level)))
    }
}

/// What was found around and below a vertex.
enum Below {
    /// Nothing wrong: whether there is a void next to it, and whether all below it is inert.
    Is { fringe: bool, all_inert: bool },
    /// This is wrong.
    Wrong(String),
    /// A page of it is damaged, which is told elsewhere.
    Unknown,
}

/// One task's walk over pages.
struct Walk<'a, C: RecordCodec> {
    grid: &'a Grid,
    header: &'a Header,
    reach: &'a [u32],
    edges: &'a [f64],
    /// Whether any page is absent.
    looks_up: bool,
    records: Cache<'a, C>,
}

impl<C: RecordCodec> Walk<'_, C> {
    /// Checks every record of a page; adds at most one problem, the first, with the number of all.
    fn page(&mut self, page: u64, tally: &mut Tally) -> Result<(), LayoutError> {
        let per_page = records_per_page::<C>();
        let mut first: Option<String> = None;
        let mut count = 0u64;
        let start = page * per_page;
        for slot in start..start + per_page {
            let problem = match point_of(self.grid.k(), slot) {
                None => self.ghost(slot)?,
                Some(p) => {
                    tally.vertices += 1;
                    let level = self.level(p);
                    match self.records.vertex(slot, level.unwrap_or(0))? {
                        None => None,
                        Some(v) => {
                            tally.heights += u64::from(!self.grid.is_padding(p) && !v.class.is_void());
                            let problem = match level {
                                Some(level) => self.vertex(p, level, &v)?,
                                None => self.sample(p, &v)?,
                            };
                            problem.map(|problem| format!("vertex ({}, {}) {problem}", p.x(), p.y()))
                        }
                    }
                }
            };
            if let Some(problem) = problem {
                count += 1;
                first.get_or_insert(problem);
            }
        }
        if let Some(first) = first {
            let more =
                if count > 1 { format!(", and {} more on this page", count - 1) } else { String::new() };
            tally.findings.add(record_page(self.records.terrain, page), format!("{first}{more}"));
        }
        Ok(())
    }

    /// The level of a vertex; corners have none.
    fn level(&self, p: GridPoint) -> Option<u32> {
        (!self.grid.is_corner(p)).then(|| self.grid.level(p))
    }

    fn is_beyond(&self, p: GridPoint, level: u32) -> bool {
        let [wide, high] = self.grid.samples();
        let reach = self.reach[level as usize];
        p.x() >= wide - 1 + reach || p.y() >= high - 1 + reach
    }

    fn at(&mut self, p: GridPoint) -> Result<Option<Vertex>, LayoutError> {
        let level = self.level(p).unwrap_or(0);
        self.records.vertex(slot_of(self.grid.k(), p), level)
    }

    fn ghost(&mut self, slot: u64) -> Result<Option<String>, LayoutError> {
        let ghost = self.records.vertex(slot, 0)?;
        let is_inert = ghost.is_none_or(|v| v.class == VertexClass::Inert);
        Ok((!is_inert).then(|| format!("slot {slot} belongs to no vertex and its record is not inert")))
    }

    /// What a record says of its own sample: padding repeats the nearest one, heights lie in the range stated.
    fn sample(&mut self, p: GridPoint, v: &Vertex) -> Result<Option<String>, LayoutError> {
        if self.grid.is_padding(p) {
            let Some(nearest) = self.at(self.grid.fold(p))? else { return Ok(None) };
            if nearest.class.is_void() != v.class.is_void() {
                return Ok(Some("is padding and not void as the nearest sample is, or the reverse".into()));
            }
            if !v.class.is_void() && nearest.height_m != v.height_m {
                return Ok(Some(format!(
                    "is padding of height {} m, the nearest sample has {} m",
                    v.height_m, nearest.height_m
                )));
            }
        }
        let [low, high] = self.header.height_range_m;
        let slack = self.header.scale.height_step_m + 1e-6 * (high - low);
        let is_in_range = (low - slack..=high + slack).contains(&v.height_m);
        Ok((!v.class.is_void() && !is_in_range).then(|| {
            format!("has a height of {} m, outside the range {low} to {high} m of the header", v.height_m)
        }))
    }

    /// What a record says of its vertex and its descendants.
    fn vertex(&mut self, p: GridPoint, level: u32, v: &Vertex) -> Result<Option<String>, LayoutError> {
        let inert = v.class == VertexClass::Inert;
        if self.is_beyond(p, level) {
            return Ok((!inert).then(|| "lies beyond the data and is not inert".into()));
        }
        let sample = self.sample(p, v)?;
        if sample.is_some() {
            return Ok(sample);
        }
        let below = if level == 0 { self.around(p)? } else { self.below(p, level, v)? };
        let (fringe, all_inert) = match below {
            Below::Is { fringe, all_inert } => (fringe, all_inert),
            Below::Wrong(problem) => return Ok(Some(problem)),
            Below::Unknown => return Ok(None),
        };
        let expected = match (v.class.is_void(), all_inert, fringe) {
            (true, true, _) => VertexClass::Inert,
            (true, false, _) => VertexClass::FringeVoid,
            (false, _, true) => VertexClass::Fringe,
            (false, _, false) => VertexClass::Plain,
        };
        if v.class != expected {
            return Ok(Some(format!(
                "is {} and must be {} for what lies around and below it",
                name(v.class),
                name(expected)
            )));
        }
        if matches!(v.class, VertexClass::Fringe | VertexClass::FringeVoid) {
            let edge_m = self.edges[level as usize];
            if v.error_m < edge_m {
                return Ok(Some(format!(
                    "is next to a void and has an error of {} m, less than its edge of {edge_m} m",
                    v.error_m
                )));
            }
        }
        Ok(if self.looks_up && !inert { self.above(p, level) } else { None })
    }

    /// What lies around a vertex of level 0.
    fn around(&mut self, p: GridPoint) -> Result<Below, LayoutError> {
        let mut fringe = false;
        if self.header.has_voids {
            for corner in self.grid.edge_ends(p).into_iter().chain(self.grid.apexes(p)) {
                match self.at(self.grid.fold(corner))? {
                    None => return Ok(Below::Unknown),
                    Some(corner) => fringe |= corner.class.is_void(),
                }
            }
        }
        Ok(Below::Is { fringe, all_inert: true })
    }

    /// What a vertex of another level is to its children: no less in error, its sphere around theirs.
    fn below(&mut self, p: GridPoint, level: u32, v: &Vertex) -> Result<Below, LayoutError> {
        let (mut fringe, mut all_inert) = (false, true);
        let [x, y] = self.grid.position_m(p);
        for child in self.grid.children(p) {
            let Some(c) = self.records.vertex(slot_of(self.grid.k(), child), level - 1)? else {
                return Ok(Below::Unknown);
            };
            if c.class == VertexClass::Inert {
                fringe |= !self.is_beyond(child, level - 1);
                continue;
            }
            all_inert = false;
            fringe |= !c.class.is_plain();
            if v.class == VertexClass::Inert {
                continue;
            }
            if v.error_m < c.error_m {
                return Ok(Below::Wrong(format!(
                    "has an error of {} m, its child ({}, {}) of {} m",
                    v.error_m,
                    child.x(),
                    child.y(),
                    c.error_m
                )));
            }
            let [cx, cy] = self.grid.position_m(child);
            let dz = v.height_m - c.height_m;
            let distance_m = ((x - cx) * (x - cx) + (y - cy) * (y - cy) + dz * dz).sqrt();
            let needed_m = MARGIN * (distance_m + c.radius_m);
            if v.radius_m * ROUNDING < needed_m {
                return Ok(Below::Wrong(format!(
                    "has a radius of {} m, too small for its child ({}, {}) which needs {needed_m} m",
                    v.radius_m,
                    child.x(),
                    child.y()
                )));
            }
        }
        Ok(Below::Is { fringe, all_inert })
    }

    /// What is wrong with the parents of a vertex that is not inert: an absent one would never lead to it.
    fn above(&self, p: GridPoint, level: u32) -> Option<String> {
        if level + 1 >= self.grid.levels() {
            return None;
        }
        self.grid.apexes(p).find_map(|parent| {
            let slot = slot_of(self.grid.k(), parent);
            self.records.is_absent(slot).then(|| {
                format!(
                    "is not inert and its parent ({}, {}) is, on the absent record page {}",
                    parent.x(),
                    parent.y(),
                    page_of::<C>(slot)
                )
            })
        })
    }
}

fn name(class: VertexClass) -> &'static str {
    match class {
        VertexClass::Plain => "plain",
        VertexClass::Fringe => "fringe",
        VertexClass::FringeVoid => "a fringe void",
        VertexClass::Inert => "inert",
    }
}
