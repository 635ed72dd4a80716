//! A mesh of a terrain, or of a part of it, that no sample is farther from than a given height: without an eye, for other programs.
//!
//! The bin tree is refined from the top as an engine does, by the records' errors alone: a vertex is in the mesh where its saturated error is over the bound. Saturation makes the mesh conforming,
//! and the bounded error is the largest vertical distance of all samples from the triangles that are left, so **every sample lies within the bound of the mesh**. Outlines of voids are refined down
//! to the samples: what has a height is covered, but for samples without a whole triangle among voids. A part is cut out along its sides, whose triangles keep their planes.
//!
//! Based on: P. Lindstrom, V. Pascucci, "Terrain Simplification Simplified", IEEE TVCG 8(3), 2002, section 3.
//!
//! Cost: a walk of the mesh's tree to count, another to make it; 50 bytes a triangle meanwhile.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use terrasoar::simplify::{SimplifyOptions, simplify};
//! use terrasoar_layout::{build::{BuildOptions, build}, dem::{MemoryDem, SampleType}, progress::Silent, read::terrain::Terrain};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("roof.iqt");
//! let roof = MemoryDem::from_fn([65, 65], SampleType::I16, |x, _| f64::from(x.min(64 - x)));
//! build(&roof, &path, &BuildOptions::default(), &Silent)?;
//! let mesh = simplify(&Terrain::open(&path)?, &SimplifyOptions::default().max_error_m(0.1))?;
//! assert!(mesh.triangles.len() < 16, "two planes need few triangles, not {}", mesh.triangles.len());
//! # Ok(())
//! # }
//! ```

mod clip;

use crate::mesh::{IndexedMesh, Triangle, has_area, is_drawn};
use clip::{Corner, Rectangle};
use std::collections::HashMap;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::ErrorKind;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::corners;
use terrasoar_layout::grid::record::VertexClass;
use terrasoar_layout::read::store::{CompleteStore, PagesRead, RecordStore};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;
use terrasoar_layout::with_records;
use terrasoar_layout::words::{number, thousands};

/// What to make.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SimplifyOptions {
    /// Largest vertical distance of a sample from the mesh in metres, 0 or more; default 1.
    pub max_error_m: f64,
    /// The part from the window's first sample to its last, whatever its step; all of the terrain without it.
    pub window: Option<SampleWindow>,
    /// Most triangles; default 20 million, which take a gigabyte while they are made.
    pub max_triangles: u64,
    /// Memory for pages, which are read when they are needed, whatever the terrain; without it as [`Terrain::cache_bytes`] has it.
    pub cache_bytes: Option<u64>,
}

impl Default for SimplifyOptions {
    fn default() -> Self {
        Self { max_error_m: 1.0, window: None, max_triangles: 20_000_000, cache_bytes: None }
    }
}

impl SimplifyOptions {
    /// These options with another largest distance in metres.
    pub fn max_error_m(self, max_error_m: f64) -> Self {
        Self { max_error_m, ..self }
    }

    /// These options for a part.
    pub fn window(self, window: impl Into<Option<SampleWindow>>) -> Self {
        Self { window: window.into(), ..self }
    }

    /// These options with another number of triangles that are too many.
    pub fn max_triangles(self, max_triangles: u64) -> Self {
        Self { max_triangles, ..self }
    }

    /// These options with pages that are read into so many bytes of memory when they are needed.
    pub fn cache_bytes(self, cache_bytes: impl Into<Option<u64>>) -> Self {
        Self { cache_bytes: cache_bytes.into(), ..self }
    }
}

/// Makes the mesh. Voids are left out; a terrain or part of voids alone gives no triangles.
///
/// # Errors
/// [`LayoutError::Usage`] for a bound that is no distance, for a terrain whose errors bound no distance, and where there would be too many triangles; damage and I/O.
pub fn simplify(terrain: &Terrain, options: &SimplifyOptions) -> Result<IndexedMesh, LayoutError> {
    simplify_with_reads(terrain, options).map(|(mesh, _)| mesh)
}

/// As [`simplify`], and what was read for it; `None` for a terrain whose records were taken where they lie.
///
/// # Errors
/// As [`simplify`].
pub fn simplify_with_reads(
    terrain: &Terrain,
    options: &SimplifyOptions,
) -> Result<(IndexedMesh, Option<PagesRead>), LayoutError> {
    let shown = terrain.path().display();
    let max_error_m = options.max_error_m;
    if !(max_error_m.is_finite() && max_error_m >= 0.0) {
        return Err(LayoutError::Usage(format!(
            "the largest error of a mesh is 0 or more metres, not {}",
            number(max_error_m)
        )));
    }
    if terrain.header().error_kind == ErrorKind::Step {
        return Err(LayoutError::Usage(format!(
            "{shown}: its errors are steps from level to level, which bound no distance from the ground; build it again with bounded errors"
        )));
    }
    let [wide, high] = terrain.grid().samples();
    let whole = Rectangle { from: [0; 2], to: [wide - 1, high - 1] };
    let rectangle = options.window.map_or(whole, |window| {
        let last = window.last();
        Rectangle { from: window.from, to: [last[0].min(wide - 1), last[1].min(high - 1)] }
    });
    match terrain.cache_bytes(options.cache_bytes) {
        None => {
            with_records!(terrain.records()?, records => mesh_over(&records, terrain, options, rectangle))
        }
        Some(bytes) => {
            with_records!(terrain.paged(bytes), records => mesh_over(&records, terrain, options, rectangle))
        }
    }
}

fn mesh_over(
    records: &impl CompleteStore,
    terrain: &Terrain,
    options: &SimplifyOptions,
    rectangle: Rectangle,
) -> Result<(IndexedMesh, Option<PagesRead>), LayoutError> {
    let walk = Walk { records, max_error_m: options.max_error_m, rectangle };
    let mut count = 0;
    let is_few = walk.leaves(&mut |_| {
        count += 1;
        count <= options.max_triangles
    });
    // What could not be read has no detail, and no more triangles than what is there.
    records.take_error().map_or(Ok(()), Err)?;
    if !is_few {
        return Err(LayoutError::Usage(format!(
            "{}: a mesh within {} m has more than {} triangles; allow a larger error, take a smaller window, or allow more triangles",
            terrain.path().display(),
            number(options.max_error_m),
            thousands(&options.max_triangles.to_string())
        )));
    }
    let mut making = Making::new(terrain.grid().spacing_m());
    walk.leaves(&mut |triangle| {
        making.add(triangle.map(|p| walk.corner(p)), &rectangle);
        true
    });
    records.take_error().map_or(Ok((making.mesh, records.read_so_far())), Err)
}

/// A walk of the tree of the mesh.
struct Walk<'w, S> {
    records: &'w S,
    max_error_m: f64,
    rectangle: Rectangle,
}

impl<S: RecordStore> Walk<'_, S> {
    /// Calls `visit` with each triangle of the mesh that is drawn, counter-clockwise, until it says no; whether it never did.
    fn leaves(&self, visit: &mut dyn FnMut(Triangle) -> bool) -> bool {
        let [sw, se, ne, nw] = corners(self.records.grid().k());
        let centre = sw.midpoint(ne);
        [[centre, sw, se], [centre, se, ne], [centre, ne, nw], [centre, nw, sw]]
            .into_iter()
            .all(|triangle| self.visit(triangle, visit))
    }

    fn visit(&self, [a, b, d]: Triangle, visit: &mut dyn FnMut(Triangle) -> bool) -> bool {
        let grid = self.records.grid();
        let folded = [a, b, d].map(|p| grid.fold(p));
        // What padding leaves without area is neither drawn nor refined, and neither is what lies beyond the part.
        if !self.rectangle.meets(folded) {
            return true;
        }
        let is_smallest = (b.x() + d.x()) & 1 == 1 || (b.y() + d.y()) & 1 == 1;
        if !is_smallest && self.is_active(b.midpoint(d)) {
            let v = b.midpoint(d);
            return self.visit([v, a, b], visit) && self.visit([v, d, a], visit);
        }
        let is_shown = has_area(grid, [a, b, d]) && is_drawn(self.records, [a, b, d]);
        !is_shown || visit([a, b, d])
    }

    fn is_active(&self, p: GridPoint) -> bool {
        let vertex = self.records.vertex_at(p);
        match vertex.class {
            VertexClass::Plain => vertex.error_m > self.max_error_m,
            VertexClass::Fringe | VertexClass::FringeVoid => true,
            VertexClass::Inert => false,
        }
    }

    fn corner(&self, p: GridPoint) -> Corner {
        let folded = self.records.grid().fold(p);
        [f64::from(folded.x()), f64::from(folded.y()), self.records.vertex_at(p).height_m]
    }
}

/// A mesh under construction.
struct Making {
    spacing_m: [f64; 2],
    mesh: IndexedMesh,
    /// Vertices by their place in samples: points that coincide are one.
    indices: HashMap<[u64; 2], u32>,
}

impl Making {
    fn new(spacing_m: [f64; 2]) -> Self {
        Self { spacing_m, mesh: IndexedMesh::default(), indices: HashMap::new() }
    }

    /// Adds what of a triangle lies in the rectangle.
    fn add(&mut self, triangle: [Corner; 3], rectangle: &Rectangle) {
        if rectangle.holds(&triangle) {
            let corners = triangle.map(|corner| self.index(corner));
            self.mesh.triangles.push(corners);
            return;
        }
        let polygon: Vec<u32> =
            rectangle.clip(&triangle).into_iter().map(|corner| self.index(corner)).collect();
        for pair in polygon.windows(2).skip(1) {
            self.mesh.triangles.push([polygon[0], pair[0], pair[1]]);
        }
    }

    fn index(&mut self, [x, y, height_m]: Corner) -> u32 {
        *self.indices.entry([x.to_bits(), y.to_bits()]).or_insert_with(|| {
            self.mesh.positions.push([x * self.spacing_m[0], y * self.spacing_m[1], height_m]);
            self.mesh.positions.len() as u32 - 1
        })
    }
}
