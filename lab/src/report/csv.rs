//! The frames of a replay as CSV: remarks on how they came about, the field names of [`FrameStats`], then a line for each frame.
//!
//! Hashes are 16 hexadecimal digits; times are told to the nanosecond. A field that does not apply to the engine is empty.

use super::{ReportError, ReportTitle};
use std::io::Write;
use std::path::Path;
use terrasoar::sink::FileSink;
use terrasoar::stats::FrameStats;

pub(super) const HEADER: &str = "frame,triangles,new_triangles,vertex_tests,splits,merges,expired,slots_written,patch_bytes,late,late_error_px,pages_touched,record_bytes_touched,pages_read,tiles_unpacked,tile_bytes_read,read_ms,unpack_ms,update_ms,scan_us,test_us,apply_us,edited_records,edit_ms,mesh_hash";

/// Writes `frames`, flown by `engine`, to `path`, behind remarks that say how they came about: a file appears when it is complete, a stream such as a pipe is written to directly.
///
/// # Errors
/// [`ReportError::Write`] or [`ReportError::Output`].
pub fn write_frames_csv(
    path: &Path,
    title: &ReportTitle,
    engine: &str,
    frames: &[FrameStats],
) -> Result<(), ReportError> {
    let mut sink = FileSink::create(path).map_err(ReportError::of_output)?;
    write_frames(&mut sink, title, engine, frames)
        .map_err(|source| ReportError::Write { path: path.into(), source })?;
    sink.publish().map_err(ReportError::of_output)
}

pub(super) fn write_frames(
    to: &mut dyn Write,
    title: &ReportTitle,
    engine: &str,
    frames: &[FrameStats],
) -> std::io::Result<()> {
    title.origin().write(to, Some(engine))?;
    writeln!(to, "{HEADER}")?;
    for f in frames {
        // Named one by one, so that a new field cannot be forgotten.
        let FrameStats {
            frame,
            triangles,
            new_triangles,
            vertex_tests,
            splits,
            merges,
            expired,
            slots_written,
            patch_bytes,
            late,
            late_error_px,
            pages_touched,
            record_bytes_touched,
            pages_read,
            tiles_unpacked,
            tile_bytes_read,
            read_ms,
            unpack_ms,
            update_ms,
            scan_us,
            test_us,
            apply_us,
            edited_records,
            edit_ms,
            mesh_hash,
        } = f;
        let [expired, slots_written, patch_bytes] = [expired, slots_written, patch_bytes].map(|v| known(*v));
        let [pages_read, tiles_unpacked, tile_bytes_read] =
            [pages_read, tiles_unpacked, tile_bytes_read].map(|v| known(*v));
        let [read_ms, unpack_ms] = [read_ms, unpack_ms].map(|v| known(v.map(neat_ms)));
        let [scan_us, test_us, apply_us] = [scan_us, test_us, apply_us].map(|v| known(v.map(neat_us)));
        let [update_ms, edit_ms] = [update_ms, edit_ms].map(|v| neat_ms(*v));
        writeln!(
            to,
            "{frame},{triangles},{new_triangles},{vertex_tests},{splits},{merges},{expired},{slots_written},{patch_bytes},{late},{late_error_px},\
{pages_touched},{record_bytes_touched},{pages_read},{tiles_unpacked},{tile_bytes_read},{read_ms},{unpack_ms},{update_ms},{scan_us},{test_us},{apply_us},{edited_records},{edit_ms},{mesh_hash:016x}"
        )?;
    }
    Ok(())
}

/// Milliseconds to the nanosecond, without what computing them in binary left.
pub(super) fn neat_ms(ms: f64) -> f64 {
    (ms * 1e6).round() / 1e6
}

/// Microseconds to the nanosecond.
fn neat_us(us: f64) -> f64 {
    (us * 1e3).round() / 1e3
}

/// A figure, or nothing where there is none.
fn known(value: Option<impl ToString>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::tests::title;
    use super::*;

    #[test]
    fn the_header_names_the_fields_in_order() {
        let json = serde_json::to_string(&FrameStats::default()).unwrap();
        let names: Vec<&str> = json.split('"').skip(1).step_by(2).collect();
        assert_eq!(names.join(","), HEADER);
    }

    #[test]
    fn a_line_holds_a_frame() {
        let frame = FrameStats {
            frame: 7,
            triangles: 5,
            update_ms: 0.1 + 2e-14,
            mesh_hash: 0xab,
            ..Default::default()
        };
        let mut text = Vec::new();
        write_frames(&mut text, &title(), "soar", &[frame]).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.starts_with("# "), "{text}");
        let mut table = text.lines().skip_while(|line| line.starts_with('#'));
        assert_eq!(table.next(), Some(HEADER));
        assert_eq!(table.next(), Some("7,5,0,0,0,0,,,,0,0,0,0,,,,,,0.1,,,,0,0,00000000000000ab"));
    }

    #[test]
    fn a_file_that_cannot_be_made_is_named() {
        let error =
            write_frames_csv(Path::new("/no/such/a.csv"), &title(), "soar", &[]).unwrap_err().to_string();
        assert!(error.contains("/no/such/a.csv"), "{error}");
    }
}
