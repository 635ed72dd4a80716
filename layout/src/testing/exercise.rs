//! Everything that this crate does with a file, done to one that may hold nonsense. Each part works or says why not, and what it makes is in proportion to what it was given.

use super::sealed::Sealed;
use crate::edit::{
    Area, Brush, BrushAction, Crater, Edit, EditSession, Falloff, SampleRect, compact, history,
};
use crate::file::disk::SystemDisk;
use crate::grid::GridPoint;
use crate::imagery::{Imagery, Paint, Region, decode_tile};
use crate::progress::Silent;
use crate::read::terrain::Terrain;
use crate::verify::unused::unused_bytes;
use crate::verify::verify;
use crate::with_records;
use std::path::Path;

/// Bytes by which a compacted file may be longer than what it was made from: pages of its own that a header could name anywhere.
const ROOM_BYTES: u64 = 64 << 10;

/// Writes the file, and its overlay if there is one, into `folder`, and does to it all that can be done. Returns whether it opened.
///
/// # Panics
/// If something is not as it must be whatever the file holds; if the folder cannot be written to.
pub fn exercise(files: &Sealed, folder: &Path) -> bool {
    let (path, overlay) = files.write(folder).expect("the folder can be written to");
    let open = || match &overlay {
        Some(overlay) => Terrain::open_with_overlay_unmapped(&path, overlay),
        None => Terrain::open_unmapped(&path),
    };
    let session = || match &overlay {
        Some(overlay) => EditSession::open_overlay(&path, overlay),
        None => EditSession::open(&path),
    };
    let edited = overlay.as_ref().unwrap_or(&path);
    let Ok(terrain) = open() else {
        // What does not open is not written to.
        let before = std::fs::read(edited).ok();
        assert!(session().is_err(), "a session opens what does not open");
        assert_eq!(std::fs::read(edited).ok(), before, "what does not open was written to");
        return false;
    };
    look(&terrain);
    let out = folder.join("compact.iqt");
    if compact(&SystemDisk, &path, overlay.as_deref(), &out, &Silent).is_ok() {
        let bytes = std::fs::metadata(&out).expect("it was made").len();
        let allowed = terrain.source().byte_count() + ROOM_BYTES;
        assert!(bytes <= allowed, "{bytes} bytes out of {allowed}");
        Terrain::open(&out).expect("what was compacted opens");
    }
    drop(terrain);
    if let Ok(session) = session() {
        edit(session);
    }
    open().expect("what opened opens after edits");
    // A file that was edited can be gone through, end to end.
    if let Ok(mut session) = session() {
        for _ in 0..4 {
            let _ = session.undo();
            open().expect("what opened opens after undoing");
        }
        for _ in 0..4 {
            let _ = session.redo();
            open().expect("what opened opens after redoing");
        }
    }
    true
}

/// All that looks at an opened terrain.
fn look(terrain: &Terrain) {
    let grid = *terrain.grid();
    let n = grid.side_steps();
    let step = (n / 16).max(1);
    if let Ok(records) = terrain.records() {
        with_records!(records, records => {
            for (x, y) in (0..=n).step_by(step as usize).flat_map(|y| (0..=n).map(move |x| (x, y))) {
                let v = records.vertex_at(GridPoint::new(x, y));
                assert!(v.error_m >= 0.0 && v.radius_m >= 0.0 && v.height_m.is_finite(), "{v:?}");
            }
        });
    }
    let [dx, dy] = grid.spacing_m();
    for (x, y) in [(0.0, 0.0), (10.5 * dx, 3.25 * dy), (-1.0, 0.0), (f64::NAN, 1.0), (1e300, 0.0)] {
        let _ = terrain.height_m(x, y);
    }
    let _ = terrain.checked_vertex(GridPoint::new(n / 2, n / 2));
    let _ = unused_bytes(terrain);
    let _ = history(terrain);
    let _ = verify(terrain, &|_| {});
    if let Ok(Some(imagery)) = Imagery::open(terrain) {
        let mut texels = Vec::new();
        for id in imagery.shape().ids().take(8) {
            if imagery.read_tile(terrain, id, &mut texels).is_ok_and(|is_there| is_there) {
                let _ = decode_tile(imagery.shape().format, &texels);
            }
        }
    }
}

/// Edits of all kinds, some committed.
fn edit(mut session: EditSession) {
    let grid = *session.editor().terrain().grid();
    let [east, north] = grid.extent_m();
    let centre_m = [0.45 * east, 0.4 * north];
    let [dx, dy] = grid.spacing_m();
    let radius_m = 4.0 * dx.max(dy);
    let [low, high] = session.header().height_range_m;
    let rect = SampleRect { west: 0, south: 0, east: 5, north: 4 };
    let brush = Brush {
        centre_m,
        radius_m,
        falloff: Falloff::Smooth,
        action: BrushAction::Raise((high - low) / 20.0),
    };
    let crater = Crater { centre_m, direction_deg: 30.0, radius_m, depth_m: radius_m / 4.0 };
    let edits = [
        Edit::set(rect, (low + high) / 2.0),
        Edit::Brush(brush),
        Edit::Crater(crater),
        Edit::Restore(Area::Disc { centre_m, radius_m }),
    ];
    for (i, edit) in edits.into_iter().enumerate() {
        let _ = session.apply(std::slice::from_ref(&edit));
        let _ = session.editor_mut().heights(rect);
        if i == 1 {
            session.discard();
        }
    }
    let region = Region::Disc { centre_m, radius_m: 2.0 * radius_m };
    let _ = session.paint(&[Paint::scorch_of(&crater), Paint::Restore(region)]);
    let _ = session.commit("an edit");
    let _ = session.undo();
    let _ = session.redo();
    let _ = session.apply(&[Edit::set(rect, low)]);
    let _ = session.commit("another");
}
