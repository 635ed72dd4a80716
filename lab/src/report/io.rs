//! What a measurement of reading leaves in a directory.
//!
//! | file | what |
//! |---|---|
//! | `frames.csv` | every count of every frame, a line a frame, engine, layout and way of preloading |
//! | `summary.json` | the sums |
//! | `plot-io-*.svg`, `plot-io-*.png` | the plots, with the feature `plots` |
//! | `report.html` | tables and plots in one file that needs no other |

#[cfg(feature = "plots")]
mod figures;
mod page;

use super::csv::neat_ms;
use super::{Origin, PlotFile, ReportError};
use crate::iobench::{FrameIo, IoBench, Run, Timed, UpdateCost};
use std::io::Write;
use std::path::{Path, PathBuf};
use terrasoar::sink::{FileSink, FolderSink};

pub(super) const HEADER: &str = "engine,layout,source,prefetch,frame,reads,record_bytes,pages,lines,units,realtime_pages,preloaded_pages,tiles,tile_bytes,update_ms,update_ms_cold,major_faults,minor_faults,disk_read_bytes";

/// All that goes into a report.
#[derive(Debug, Clone, Copy)]
pub struct IoReport<'a> {
    /// The sums.
    pub bench: &'a IoBench,
    /// The counts of each of [`IoBench::runs`], in the same order, and what its frames cost where that was measured.
    pub runs: &'a [(Run, Option<Timed>)],
}

impl IoReport<'_> {
    /// Writes the report into the directory `dir`, made if missing, and gives the files written in order; the last
    /// is the page to open.
    ///
    /// # Errors
    /// [`ReportError`], which names the file. A new directory is not there then; in one that was, the files before it are complete.
    pub fn write(&self, dir: &Path) -> Result<Vec<PathBuf>, ReportError> {
        let mut out = FolderSink::create(dir).map_err(|error| ReportError::of_folder(dir, error))?;
        out.add("frames.csv", |to| write_io_frames(to, self.bench, self.runs))
            .map_err(ReportError::of_output)?;
        let json = serde_json::to_string_pretty(self.bench)
            .map_err(|source| ReportError::Json { path: dir.join("summary.json"), source })?;
        super::add_text(&mut out, "summary.json", &(json + "\n"))?;
        let plots = self.add_plots(dir, &mut out)?;
        super::add_text(&mut out, "report.html", &page::page(self.bench, &plots))?;
        out.publish().map_err(|error| ReportError::of_folder(dir, error))
    }

    #[cfg(feature = "plots")]
    fn add_plots(&self, dir: &Path, out: &mut FolderSink) -> Result<Vec<PlotFile>, ReportError> {
        super::add_charts(figures::all(self), dir, out)
    }

    #[cfg(not(feature = "plots"))]
    fn add_plots(&self, _: &Path, _: &mut FolderSink) -> Result<Vec<PlotFile>, ReportError> {
        Ok(Vec::new())
    }
}

/// Writes every frame of `runs` to `path`, behind remarks that say how they came about: a file appears when it is complete, a stream such as a pipe is written to directly. What was not measured or is not known is empty.
///
/// # Errors
/// [`ReportError::Write`] or [`ReportError::Output`].
pub fn write_io_frames_csv(
    path: &Path,
    bench: &IoBench,
    runs: &[(Run, Option<Timed>)],
) -> Result<(), ReportError> {
    let mut sink = FileSink::create(path).map_err(ReportError::of_output)?;
    write_io_frames(&mut sink, bench, runs)
        .map_err(|source| ReportError::Write { path: path.into(), source })?;
    sink.publish().map_err(ReportError::of_output)
}

fn write_io_frames(
    to: &mut dyn Write,
    bench: &IoBench,
    runs: &[(Run, Option<Timed>)],
) -> std::io::Result<()> {
    let origin = Origin {
        terrain: &bench.terrain,
        flight: &bench.flight,
        tolerance_px: bench.tolerance_px,
        metric: &bench.metric,
        viewport_px: bench.viewport_px,
        exaggeration: bench.exaggeration,
        culling: &bench.culling,
        // Counted with and flown over, by other rules than a replay: the object has it.
        cache_mib: None,
        made: bench.made.as_ref(),
    };
    origin.write(to, None)?;
    writeln!(to, "{HEADER}")?;
    runs.iter().try_for_each(|(run, timed)| write_run(to, run, timed.as_ref()))
}

fn write_run(to: &mut dyn Write, run: &Run, timed: Option<&Timed>) -> std::io::Result<()> {
    let words = [run.reader.name(), run.layout.name(), run.reader.source(), run.preload.name()].join(",");
    for (i, f) in run.frames.iter().enumerate() {
        // Named one by one, so that a new field cannot be forgotten.
        let FrameIo {
            frame,
            reads,
            record_bytes,
            pages,
            lines,
            units,
            realtime_pages,
            preloaded_pages,
            tiles,
            tile_bytes,
        } = f;
        let [lines, units] = [lines, units].map(|count| cell(run.counts_lines().then_some(*count)));
        let [tiles, tile_bytes] = [tiles, tile_bytes].map(|count| cell(run.counts_tiles.then_some(*count)));
        write!(
            to,
            "{words},{frame},{reads},{record_bytes},{pages},{lines},{units},{realtime_pages},{preloaded_pages},{tiles},{tile_bytes},"
        )?;
        let warm = timed.and_then(|t| t.warm.get(i));
        let cold = timed.filter(|t| t.was_forgotten).and_then(|t| t.cold.get(i));
        let faults = cold.and_then(|c| c.faults);
        writeln!(
            to,
            "{},{},{},{},{}",
            cell(warm.map(|c: &UpdateCost| neat_ms(c.ms))),
            cell(cold.map(|c| neat_ms(c.ms))),
            cell(faults.map(|f| f.major)),
            cell(faults.map(|f| f.minor)),
            cell(cold.and_then(|c| c.read_bytes)),
        )?;
    }
    Ok(())
}

fn cell(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |v| v.to_string())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::iobench::kernel::Faults;
    use crate::iobench::{Cap, IoRun, LayoutKind, Prefetch, Reader};
    use terrasoar::flyover::EngineKind;

    /// Figures of two engines and the mesh under two layouts.
    pub(in super::super) fn made_up() -> (IoBench, Vec<(Run, Option<Timed>)>) {
        let engines = [Reader::Engine(EngineKind::Soar), Reader::Engine(EngineKind::Kinetic), Reader::Mesh];
        let mut runs = Vec::new();
        for (n, reader) in engines.into_iter().enumerate() {
            for layout in [LayoutKind::Row, LayoutKind::Ours] {
                for preload in [Prefetch::None, Prefetch::Frustum] {
                    let scale = if layout == LayoutKind::Row { 40 } else { 2 } * (n as u64 + 1);
                    let frames = (0..5).map(|frame| FrameIo {
                        frame,
                        reads: 1000,
                        record_bytes: 4000,
                        pages: 10 * scale + frame,
                        lines: 100 * scale,
                        units: scale,
                        realtime_pages: if frame == 0 { 10 * scale } else { frame },
                        preloaded_pages: 1,
                        tiles: 3,
                        tile_bytes: 700,
                    });
                    let run = Run {
                        reader,
                        layout,
                        preload,
                        record_bytes: 4,
                        file_bytes: 1 << 30,
                        counts_tiles: layout == LayoutKind::Ours,
                        frames: frames.collect(),
                        trace: None,
                    };
                    let cost = UpdateCost {
                        ms: 1.5,
                        faults: Some(Faults { minor: 3, major: 2 }),
                        read_bytes: Some(8192),
                    };
                    let measured = layout == LayoutKind::Ours && preload == Prefetch::None && n < 2;
                    let timed = measured.then(|| Timed {
                        was_forgotten: true,
                        cold: vec![cost; 5],
                        warm: vec![UpdateCost { ms: 0.25, ..cost }; 5],
                        peak_memory_bytes: None,
                        resident_bytes: None,
                    });
                    runs.push((run, timed));
                }
            }
        }
        let sums = |(run, timed): &(Run, Option<Timed>)| match timed {
            Some(timed) => IoRun::of(run).with_times(timed),
            None => IoRun::of(run),
        };
        let bench = IoBench {
            terrain: "a & b <c>".into(),
            flight: "f".into(),
            tolerance_px: 1.0,
            metric: "ball".into(),
            viewport_px: [800, 600],
            exaggeration: 1.0,
            culling: "vertices".into(),
            page_bytes: 4096,
            cache_mib: 128,
            disk_pages_per_frame: 128,
            frames_per_second: 60.0,
            reads: "threads".into(),
            block_m: 1000.0,
            cap: Some(Cap { mib: 64, control_group_version: 1 }),
            cap_note: None,
            kernel_known: true,
            runs: runs.iter().map(sums).collect(),
            made: None,
        };
        (bench, runs)
    }

    #[test]
    fn the_directory_holds_what_the_page_names() {
        let (bench, runs) = made_up();
        let folder = tempfile::tempdir().unwrap();
        let written = IoReport { bench: &bench, runs: &runs }.write(&folder.path().join("r")).unwrap();
        assert_eq!(written.len(), if cfg!(feature = "plots") { 9 } else { 3 });
        let page = std::fs::read_to_string(written.last().unwrap()).unwrap();
        for file in &written[..written.len() - 1] {
            let name = file.file_name().unwrap().to_str().unwrap();
            assert!(file.is_file() && page.contains(&format!("href=\"{name}\"")), "{name}");
        }
        let json = std::fs::read_to_string(&written[1]).unwrap();
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(value["runs"][2]["layout"], "ours");
        assert_eq!(value["cap"]["mib"], 64);
    }

    #[test]
    fn every_frame_has_a_line_and_every_name_a_cell() {
        let (bench, runs) = made_up();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.csv");
        write_io_frames_csv(&path, &bench, &runs).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("# terrain: "), "{text}");
        let lines: Vec<&str> = text.lines().skip_while(|line| line.starts_with('#')).collect();
        assert_eq!(lines.len(), 1 + 5 * runs.len());
        assert!(lines.iter().all(|l| l.split(',').count() == HEADER.split(',').count()));
        assert_eq!(lines[1], "soar,row,map,none,0,1000,4000,400,4000,40,400,1,,,,,,,");
        assert_eq!(lines[11], "soar,ours,map,none,0,1000,4000,20,200,2,20,1,3,700,0.25,1.5,2,3,8192");
        let named = serde_json::to_string(&FrameIo::default()).unwrap();
        let fields: Vec<&str> = named.split('"').skip(1).step_by(2).collect();
        assert!(HEADER.contains(&fields.join(",")));
        let error = write_io_frames_csv(Path::new("/no/such/a.csv"), &bench, &runs).unwrap_err().to_string();
        assert!(error.contains("/no/such/a.csv"), "{error}");
    }
}
