//! Meshes as files for other programs: PLY and OBJ in double precision, STL and GLB in single, GLB with a picture on it.
//!
//! [`Placing`] says how metres become coordinates. **Large coordinates do not fit into single precision:** STL and GLB hold them less an origin, which both tell, and which GLB's node adds again. Written
//! is to any stream, once, from the first byte to the last. Cost: no copy of the mesh but 12 bytes a vertex for GLB's normals.
//!
//! ```
//! use terrasoar::mesh::IndexedMesh;
//! use terrasoar_lab::mesh_file::{Format, MeshFile, is_ours};
//! let mesh = IndexedMesh { positions: vec![[0.0; 3], [10.0, 0.0, 1.0], [0.0, 10.0, 2.0]], triangles: vec![[0, 1, 2]] };
//! let mut bytes = Vec::new();
//! MeshFile::new(&mesh).write(Format::Stl, &mut bytes)?;
//! assert!(bytes.len() == 84 + 50 && is_ours(&bytes));
//! # Ok::<(), std::io::Error>(())
//! ```

mod glb;
mod stl;
mod text;
mod texture;

pub use texture::Texture;

use std::io::{self, Write};
use terrasoar::mesh::IndexedMesh;

/// What says in a mesh that it is ours, and what its numbers are.
pub const LOCAL_NOTE: &str = "metres east, north and up of the terrain's south-west sample";
/// As [`LOCAL_NOTE`], of coordinates of a reference system.
pub const DEM_NOTE: &str = "terrain in the coordinates of its elevation model";

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// PLY, little-endian.
    PlyBinary,
    /// PLY as text.
    PlyText,
    /// Wavefront OBJ.
    Obj,
    /// STL, binary.
    Stl,
    /// glTF 2.0 in one file.
    Glb,
}

impl Format {
    /// Whether coordinates are held in single precision.
    pub fn is_single(self) -> bool {
        matches!(self, Self::Stl | Self::Glb)
    }
}

/// How metres east, north and up become coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placing {
    /// x = m0 + m1 east + m2 north, y = m3 + m4 east + m5 north.
    pub map: [f64; 6],
    /// Units of the coordinates a metre of height.
    pub height_factor: f64,
}

impl Placing {
    /// Metres as they are.
    pub const LOCAL: Self = Self { map: [0.0, 1.0, 0.0, 0.0, 0.0, 1.0], height_factor: 1.0 };

    /// Coordinates of a point in metres.
    pub fn place(&self, [east, north, up]: [f64; 3]) -> [f64; 3] {
        let m = &self.map;
        [m[0] + m[1] * east + m[2] * north, m[3] + m[4] * east + m[5] * north, up * self.height_factor]
    }

    /// Whether east and north turn the other way here, so that triangles have to be turned over.
    fn mirrors(&self) -> bool {
        self.map[1] * self.map[5] < self.map[2] * self.map[4]
    }
}

/// A mesh, and what a file of it says.
#[derive(Debug, Clone, Copy)]
pub struct MeshFile<'m> {
    mesh: &'m IndexedMesh,
    placing: Placing,
    notes: &'m [(&'static str, String)],
    texture: Option<&'m Texture>,
}

impl<'m> MeshFile<'m> {
    /// A mesh in metres, with nothing said of where that is.
    pub fn new(mesh: &'m IndexedMesh) -> Self {
        Self { mesh, placing: Placing::LOCAL, notes: &[], texture: None }
    }

    /// The mesh in other coordinates.
    pub fn placing(self, placing: Placing) -> Self {
        Self { placing, ..self }
    }

    /// With notes: names and values.
    pub fn notes(self, notes: &'m [(&'static str, String)]) -> Self {
        Self { notes, ..self }
    }

    /// With a picture on it, in files that can have one: GLB.
    pub fn texture(self, texture: Option<&'m Texture>) -> Self {
        Self { texture, ..self }
    }

    /// What coordinates in single precision are less of: whole units at the south-west of the mesh, or nothing where metres from the corner fit as they are.
    pub fn origin(&self, format: Format) -> [f64; 2] {
        let is_near = |corner: [f64; 2]| corner.iter().all(|value| value.abs() < f64::from(1 << 16));
        let corners =
            self.positions().fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], [x, y, _]| {
                [[low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]]
            });
        if !format.is_single() || self.mesh.positions.is_empty() || corners.into_iter().all(is_near) {
            return [0.0; 2];
        }
        corners[0].map(f64::floor)
    }

    /// Writes the file.
    ///
    /// # Errors
    /// Those of `out`; a mesh that does not fit into the format.
    pub fn write(&self, format: Format, out: &mut dyn Write) -> io::Result<()> {
        match format {
            Format::Obj => text::obj(self, out),
            Format::PlyText => text::ply(self, false, out),
            Format::PlyBinary => text::ply(self, true, out),
            Format::Stl => stl::write(self, out),
            Format::Glb => glb::write(self, out),
        }
    }

    /// What the numbers are.
    fn note(&self) -> &'static str {
        if self.placing == Placing::LOCAL { LOCAL_NOTE } else { DEM_NOTE }
    }

    fn positions(&self) -> impl Iterator<Item = [f64; 3]> {
        self.mesh.positions.iter().map(|position| self.placing.place(*position))
    }

    /// Triangles, counter-clockwise seen from above in these coordinates.
    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let mirrors = self.placing.mirrors();
        self.mesh.triangles.iter().map(move |[a, b, c]| if mirrors { [*a, *c, *b] } else { [*a, *b, *c] })
    }
}

/// Whether a file that begins with `start`, of which 64 KiB are enough, could be a mesh that was written here.
pub fn is_ours(start: &[u8]) -> bool {
    let notes = [LOCAL_NOTE, DEM_NOTE];
    if start.starts_with(b"glTF") {
        let has = |text: &str| start.windows(text.len()).any(|window| window == text.as_bytes());
        return notes.iter().any(|note| has(&glb::generator(note)));
    }
    if notes.iter().any(|note| start.starts_with(stl::head(note).as_bytes())) {
        return true;
    }
    let mut lines = start.split(|byte| *byte == b'\n');
    let is_note =
        |line: &[u8], sign: &str| notes.iter().any(|note| line == format!("{sign} {note}").as_bytes());
    match lines.next() {
        Some(b"ply") => lines.nth(1).is_some_and(|line| is_note(line, "comment")),
        Some(first) => is_note(first, "#"),
        None => false,
    }
}
