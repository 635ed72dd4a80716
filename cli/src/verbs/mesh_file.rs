//! Meshes as PLY (text or little-endian binary, coordinates in double precision) and OBJ (text). Streamed; the file appears when complete.

use super::outputs::MESH_NOTE;
use anyhow::{Context, Result};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use terrasoar::flyover::FrameMesh;
use terrasoar_layout::file::atomic::AtomicFile;
use terrasoar_layout::printable;

/// What to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    PlyBinary,
    PlyText,
    Obj,
}

/// What a file says of where the mesh lies: names and values.
type Notes<'n> = &'n [(&'static str, String)];

/// Writes `mesh` to `path`, with `notes` as comments.
pub(super) fn write(path: &Path, mesh: &FrameMesh, format: Format, notes: Notes<'_>) -> Result<()> {
    let file = AtomicFile::create(path)?;
    let mut out = BufWriter::with_capacity(1 << 20, file.file());
    write_to(&mut out, mesh, format, notes)
        .and_then(|()| out.flush())
        .with_context(|| format!("{}: cannot write the mesh; check the free space", path.display()))?;
    drop(out);
    Ok(file.publish()?)
}

fn write_to(out: &mut impl Write, mesh: &FrameMesh, format: Format, notes: Notes<'_>) -> io::Result<()> {
    match format {
        Format::Obj => {
            writeln!(out, "# {MESH_NOTE}")?;
            for (name, value) in notes {
                writeln!(out, "# {name}: {}", printable::line(value))?;
            }
            for [x, y, z] in &mesh.positions {
                writeln!(out, "v {x} {y} {z}")?;
            }
            for [a, b, c] in &mesh.triangles {
                let [a, b, c] = [a, b, c].map(|i| u64::from(*i) + 1);
                writeln!(out, "f {a} {b} {c}")?;
            }
        }
        Format::PlyText => {
            ply_header(out, mesh, "ascii", notes)?;
            for [x, y, z] in &mesh.positions {
                writeln!(out, "{x} {y} {z}")?;
            }
            for [a, b, c] in &mesh.triangles {
                writeln!(out, "3 {a} {b} {c}")?;
            }
        }
        Format::PlyBinary => {
            ply_header(out, mesh, "binary_little_endian", notes)?;
            for position in &mesh.positions {
                for coordinate in position {
                    out.write_all(&coordinate.to_le_bytes())?;
                }
            }
            for triangle in &mesh.triangles {
                out.write_all(&[3])?;
                for index in triangle {
                    out.write_all(&index.to_le_bytes())?;
                }
            }
        }
    }
    Ok(())
}

fn ply_header(out: &mut impl Write, mesh: &FrameMesh, encoding: &str, notes: Notes<'_>) -> io::Result<()> {
    write!(out, "ply\nformat {encoding} 1.0\ncomment {MESH_NOTE}\n")?;
    for (name, value) in notes {
        writeln!(out, "comment {name}: {}", printable::line(value))?;
    }
    write!(
        out,
        "element vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.triangles.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(format: Format) -> Vec<u8> {
        let mesh = FrameMesh {
            positions: vec![[0.0, 0.0, 1.5], [10.0, 0.0, 2.0], [0.0, 10.0, 3.25]],
            triangles: vec![[0, 1, 2]],
        };
        let mut out = Vec::new();
        let notes = [("Reference system", "a\nb".to_owned()), ("Coordinates", "x = 1 + 2 * east".to_owned())];
        write_to(&mut out, &mesh, format, &notes).unwrap();
        out
    }

    #[test]
    fn text_formats_read_as_specified() {
        let obj = String::from_utf8(written(Format::Obj)).unwrap();
        assert!(
            obj.contains("\n# Reference system: a\\nb\n# Coordinates: x = 1 + 2 * east\nv 0 0 1.5\n"),
            "{obj}"
        );
        assert!(obj.ends_with("v 0 0 1.5\nv 10 0 2\nv 0 10 3.25\nf 1 2 3\n"));
        let ply = String::from_utf8(written(Format::PlyText)).unwrap();
        assert!(ply.contains("\ncomment Reference system: a\\nb\ncomment Coordinates: "), "{ply}");
        assert!(
            ply.starts_with("ply\nformat ascii 1.0\n")
                && ply.ends_with("end_header\n0 0 1.5\n10 0 2\n0 10 3.25\n3 0 1 2\n")
        );
    }

    #[test]
    fn binary_has_24_bytes_a_vertex_and_13_a_face() {
        let ply = written(Format::PlyBinary);
        let end = b"end_header\n";
        let at = ply.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        assert_eq!(ply.len() - at, 3 * 24 + 13);
        assert_eq!(ply[at + 16..at + 24], 1.5f64.to_le_bytes());
        assert_eq!(ply[at + 72..at + 77], [3, 0, 0, 0, 0]);
    }
}
