//! OBJ, and PLY as text or in binary: coordinates in double precision, notes as comments.

use super::MeshFile;
use std::io::{self, Write};
use terrasoar_layout::printable;

pub(super) fn obj(file: &MeshFile<'_>, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# {}", file.note())?;
    for (name, value) in file.notes {
        writeln!(out, "# {name}: {}", printable::line(value))?;
    }
    for [x, y, z] in file.positions() {
        writeln!(out, "v {x} {y} {z}")?;
    }
    for triangle in file.triangles() {
        let [a, b, c] = triangle.map(|i| u64::from(i) + 1);
        writeln!(out, "f {a} {b} {c}")?;
    }
    Ok(())
}

pub(super) fn ply(file: &MeshFile<'_>, is_binary: bool, out: &mut dyn Write) -> io::Result<()> {
    let encoding = if is_binary { "binary_little_endian" } else { "ascii" };
    write!(out, "ply\nformat {encoding} 1.0\ncomment {}\n", file.note())?;
    for (name, value) in file.notes {
        writeln!(out, "comment {name}: {}", printable::line(value))?;
    }
    write!(
        out,
        "element vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        file.mesh.positions.len(),
        file.mesh.triangles.len()
    )?;
    for [x, y, z] in file.positions() {
        if is_binary {
            out.write_all([x, y, z].map(f64::to_le_bytes).as_flattened())?;
        } else {
            writeln!(out, "{x} {y} {z}")?;
        }
    }
    for [a, b, c] in file.triangles() {
        if is_binary {
            out.write_all(&[3])?;
            out.write_all([a, b, c].map(u32::to_le_bytes).as_flattened())?;
        } else {
            writeln!(out, "3 {a} {b} {c}")?;
        }
    }
    Ok(())
}
