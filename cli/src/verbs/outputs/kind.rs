//! What verbs write, and whether a file that is there could be of that kind.

use super::there::{named, start_of, terrain};
use crate::beside::named_beside;
use std::io;
use std::path::Path;
use terrasoar::edits::{Script, Step};
use terrasoar::flight::generate::is_generated;
use terrasoar_import::export::is_exported;
use terrasoar_import::synth::is_synthetic;
use terrasoar_lab::report::ReportFile;
use terrasoar_lab::{mesh_file, picture};
use terrasoar_layout::edit::Edit;

/// What a verb writes under a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::verbs) enum Kind {
    /// A terrain file.
    Terrain,
    /// Synthetic elevation data, or a picture of synthetic colours.
    Synthetic,
    /// Heights of a terrain, or differences of them, as GeoTIFF.
    Elevation,
    /// A table of places with their heights.
    Heights,
    /// A flight that was generated.
    Flight,
    /// A script of craters.
    Craters,
    /// Triangles.
    Mesh,
    /// A picture.
    #[cfg_attr(not(feature = "pictures"), allow(dead_code, reason = "pictures need the feature"))]
    Picture,
    /// A film.
    #[cfg_attr(not(feature = "pictures"), allow(dead_code, reason = "films need the feature"))]
    Film,
    /// A part of a report.
    Report(ReportFile),
}

/// What says in a film that it is ours.
pub(in crate::verbs) const FILM_NOTE: &str = "made with Terrasoar";

impl Kind {
    #[cfg(test)]
    pub(super) const ALL: [Self; 15] = [
        Self::Terrain,
        Self::Synthetic,
        Self::Elevation,
        Self::Heights,
        Self::Flight,
        Self::Craters,
        Self::Mesh,
        Self::Picture,
        Self::Film,
        Self::Report(ReportFile::Frames),
        Self::Report(ReportFile::IoFrames),
        Self::Report(ReportFile::Summary),
        Self::Report(ReportFile::Drawing),
        Self::Report(ReportFile::Picture),
        Self::Report(ReportFile::Page),
    ];

    /// What would be lost if the file at `path` were replaced by one of this kind; nothing if the same verb could have made it.
    pub(super) fn refusal(self, path: &Path) -> io::Result<Option<String>> {
        let start = start_of(path)?;
        if start.is_empty() {
            return Ok(None);
        }
        let is_ours = match self {
            Self::Terrain => match terrain(path, &start) {
                Some(holds) => {
                    let under =
                        || named_beside(path).map(|names| format!("a terrain under edits in {names}"));
                    return Ok(holds.or_else(under));
                }
                None => false,
            },
            Self::Synthetic => is_synthetic(path)?,
            Self::Elevation => is_exported(&start),
            Self::Heights => is_heights(&start),
            Self::Flight => is_generated(&start),
            Self::Craters => is_craters(path, &start)?,
            Self::Mesh => mesh_file::is_ours(&start),
            Self::Picture => picture::is_ours(&start),
            Self::Film => is_film(&start),
            Self::Report(file) => file.is_ours(&start),
        };
        if is_ours {
            return Ok(None);
        }
        // A terrain is told by what it holds also where it could not have been made.
        let what = match terrain(path, &start) {
            Some(holds) => holds.unwrap_or_else(|| "a terrain file".into()),
            None => named(&start),
        };
        Ok(Some(format!("{what}, which this verb did not make")))
    }
}

/// Whether a table has heights in its last column, by its first row.
fn is_heights(start: &[u8]) -> bool {
    let first = start.split(|byte| *byte == b'\n').next().unwrap_or_default();
    first.trim_ascii_end().ends_with(b"height_m")
}

/// Whether a script reads as it was written, and has nothing but craters.
fn is_craters(path: &Path, start: &[u8]) -> io::Result<bool> {
    if !start.starts_with(b"terrasoar-edits ") {
        return Ok(false);
    }
    let bytes = std::fs::read(path)?;
    let Ok(script) = Script::parse(&bytes, path) else { return Ok(false) };
    let mut steps = script.batches.iter().flat_map(|batch| &batch.steps);
    let only_craters = steps.all(|step| matches!(step, Step::Edit(Edit::Crater(_))));
    Ok(only_craters && script.to_text(path).is_ok_and(|text| text.as_bytes() == bytes))
}

fn is_film(start: &[u8]) -> bool {
    let is_kind = start.starts_with(b"GIF8") || start.get(4..8) == Some(b"ftyp");
    is_kind && start.windows(FILM_NOTE.len()).any(|window| window == FILM_NOTE.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar::edits::Batch;
    use terrasoar_layout::edit::Crater;

    fn refused(kind: Kind, bytes: &[u8]) -> Option<String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        kind.refusal(file.path()).unwrap()
    }

    /// The only kind that may replace what is there.
    fn check(bytes: &[u8], ours: Kind) {
        for kind in Kind::ALL {
            assert_eq!(refused(kind, bytes).is_none(), kind == ours, "{kind:?} over {ours:?}");
        }
    }

    #[test]
    fn a_verb_replaces_what_it_makes_and_nothing_else() {
        check(craters().to_text(Path::new("a")).unwrap().as_bytes(), Kind::Craters);
        check(
            b"ply\nformat ascii 1.0\ncomment metres east, north and up of the terrain's south-west sample\n",
            Kind::Mesh,
        );
        check(b"# metres east, north and up of the terrain's south-west sample\nv 0 0 0\n", Kind::Mesh);
        check(b"GIF89a\x01\0\x01\0\0\0\0\x21\xfe\x13made with Terrasoar\0\x3b", Kind::Film);
        check(b"\0\0\0\x1cftypiso5\0\0\x02\0 made with Terrasoar", Kind::Film);
        let flight = "terrasoar-flight 1\nunits metres degrees seconds\n# flight: orbit\n0 1 2 3 0 0 0 45\n";
        check(flight.as_bytes(), Kind::Flight);
    }

    #[test]
    fn what_a_person_made_is_kept() {
        let made = craters().to_text(Path::new("a")).unwrap();
        assert_eq!(refused(Kind::Craters, made.as_bytes()), None);
        for text in [
            made.replace("\n\ncrater", "\n\n# the dam\ncrater"),
            made.replacen("crater at 10,", "crater at 10.0,", 1),
            format!("{made}\nset rect 1,1,2,2 to 5\n"),
            made.replacen("crater", "crate", 1),
        ] {
            assert!(text != made);
            let what = refused(Kind::Craters, text.as_bytes()).unwrap();
            assert!(what.contains("a script of edits"), "{what}");
        }
        let recorded = "terrasoar-flight 1\nunits metres degrees seconds\n# recorded-with: terrasoar view\n0 1 2 3 0 0 0 45\n";
        assert!(refused(Kind::Flight, recorded.as_bytes()).unwrap().contains("a flight"));
        assert!(refused(Kind::Mesh, b"ply\nformat ascii 1.0\ncomment by me\n").is_some());
        assert!(refused(Kind::Film, b"GIF89a\x01\0\x01\0\0\0\0\x3b").unwrap().contains("a GIF picture"));
    }

    fn craters() -> Script {
        let crater = Edit::Crater(Crater {
            centre_m: [10.0, 20.5],
            direction_deg: 30.0,
            radius_m: 40.0,
            depth_m: 9.0,
        });
        Script { batches: vec![Batch::of([crater.clone()]), Batch::of([crater])] }
    }
}
