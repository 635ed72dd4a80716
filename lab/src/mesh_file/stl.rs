//! Binary STL: each triangle with its normal and corners, in single precision.

use super::{Format, MeshFile};
use std::io::{self, Write};

/// Bytes before the count of triangles.
const HEAD: usize = 80;

/// How our files begin. Those that begin with "solid" are taken for text.
pub(super) fn head(note: &str) -> String {
    format!("Terrasoar, {}", note.chars().take(36).collect::<String>())
}

pub(super) fn write(file: &MeshFile<'_>, out: &mut dyn Write) -> io::Result<()> {
    let count = u32::try_from(file.mesh.triangles.len()).map_err(|_| {
        io::Error::other("STL holds 4,294,967,295 triangles; allow a larger error, or write PLY")
    })?;
    let [x0, y0] = file.origin(Format::Stl);
    let mut text = head(file.note());
    if [x0, y0] != [0.0; 2] {
        text.push_str(&format!(", less {x0},{y0}"));
    }
    let mut head = text.into_bytes();
    head.resize(HEAD, b' ');
    out.write_all(&head)?;
    out.write_all(&count.to_le_bytes())?;
    let place = |i: u32| {
        let [x, y, z] = file.placing.place(file.mesh.positions[i as usize]);
        [x - x0, y - y0, z]
    };
    for triangle in file.triangles() {
        let [a, b, c] = triangle.map(place);
        let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        let normal = if length > 0.0 { normal.map(|n| n / length) } else { [0.0, 0.0, 1.0] };
        for vector in [normal, a, b, c] {
            out.write_all(vector.map(|value| (value as f32).to_le_bytes()).as_flattened())?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}
