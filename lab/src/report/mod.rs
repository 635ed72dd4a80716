//! What a comparison leaves in a directory: figures for programs, plots and one page for people. `io.rs` has the same of what flights read.
//!
//! | file | what |
//! |---|---|
//! | `frames-<engine>.csv` | every figure of every frame, a file an engine |
//! | `summary.json` | sums, ratios and sweeps |
//! | `plot-*.svg`, `plot-*.png` | the plots, with the feature `plots` |
//! | `report.html` | tables and plots in one file that needs no other |
//!
//! **Equal input gives equal bytes**: nothing here reads a clock, a locale or a system font. A new directory appears when all of it is there; in one that was there before, files of
//! the same name are replaced, others left alone, and the page comes last. [`remove_stale`] then removes what an earlier report left.

#[cfg(feature = "plots")]
mod chart;
mod csv;
#[cfg(feature = "plots")]
mod figures;
mod files;
mod html;
mod io;
mod number;
mod origin;
#[cfg(feature = "plots")]
mod plot;

pub use crate::made::Made;
pub use csv::write_frames_csv;
pub use files::{ReportFile, START_BYTES, remove_stale};
pub use html::FLIGHT_PICTURE;
pub use io::{IoReport, write_io_frames_csv};
pub use origin::{Origin, ReportTitle, command_of};

use serde::Serialize;
use std::path::{Path, PathBuf};
use terrasoar::sink::FolderSink;
use terrasoar::stats::{Comparison, FrameStats};
use terrasoar_layout::LayoutError;

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The directory cannot be made.
    #[error("cannot make the report's directory {}: {source}; choose another one or check its permissions", path.display())]
    Directory {
        /// The directory.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {source}; check the directory's permissions and free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file cannot be what it was to be, whatever is in it.
    #[error(transparent)]
    Output(LayoutError),
    /// A plot cannot be drawn.
    #[error("cannot draw {}: {reason}; build without the feature `plots` for a report without them", path.display())]
    Draw {
        /// The plot's file.
        path: PathBuf,
        /// What the drawing library says.
        reason: String,
    },
    /// The summary cannot be put into JSON.
    #[error("cannot put the summary into {}: {source}; this is a fault of terrasoar, please report it", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What the JSON library says.
        source: serde_json::Error,
    },
}

impl ReportError {
    /// What went wrong where a file was to go.
    fn of_output(error: LayoutError) -> Self {
        match error {
            LayoutError::Io { path, source, .. } => Self::Write { path, source },
            other => Self::Output(other),
        }
    }

    /// What went wrong where the directory `dir` or a file in it was to go.
    fn of_folder(dir: &Path, error: LayoutError) -> Self {
        match error {
            LayoutError::Io { path, source, .. } if path == dir => Self::Directory { path, source },
            other => Self::of_output(other),
        }
    }
}

/// One engine's figures at one value of what a sweep varies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepPoint {
    /// Tolerance in pixels or incoherence in percent; above 0.
    pub x: f64,
    /// The engine.
    pub engine: String,
    /// Median over the frames of the base engine's update time over this one's.
    pub speedup_median: f64,
    /// Vertex tests over the base engine's.
    pub vertex_tests_ratio: f64,
    /// Frames flown.
    pub frames: u64,
    /// Triangles drawn a frame, averaged over all frames.
    pub triangles_mean: f64,
    /// Mean incoherence of the frames but the first, in percent.
    pub incoherence_percent: f64,
    /// Speed that was found for the incoherence, metres a frame; `None` where the flight itself was flown.
    pub speed_m_per_frame: Option<f64>,
}

/// All that goes into a report. The first run is the base that the others are compared with.
#[derive(Debug, Clone, Copy)]
pub struct ComparisonReport<'a> {
    /// What was compared.
    pub title: &'a ReportTitle,
    /// Each engine's name and frames, in the order of the comparison.
    pub runs: &'a [(String, Vec<FrameStats>)],
    /// The comparison of these runs.
    pub comparison: &'a Comparison,
    /// Figures by tolerance; empty if none were taken.
    pub tolerance_sweep: &'a [SweepPoint],
    /// Figures by incoherence; empty if none were taken.
    pub incoherence_sweep: &'a [SweepPoint],
    /// What the flight looks like.
    pub picture: FlightPicture<'a>,
}

/// A picture of the flight.
#[derive(Debug, Clone, Copy)]
pub enum FlightPicture<'a> {
    /// A picture, which becomes the file [`FLIGHT_PICTURE`].
    Png {
        /// The file's bytes.
        file: &'a [u8],
        /// What it shows, in a sentence.
        caption: &'a str,
    },
    /// None could be drawn, and why.
    Missing(&'a str),
}

/// A plot as the page shows it.
struct PlotFile {
    /// What it shows, in a sentence.
    caption: String,
    /// File names of the drawing and the picture.
    svg: String,
    png: String,
    /// The drawing itself.
    drawing: String,
}

#[derive(Serialize)]
struct Summary<'a> {
    #[serde(flatten)]
    origin: Origin<'a>,
    comparison: &'a Comparison,
    tolerance_sweep: &'a [SweepPoint],
    incoherence_sweep: &'a [SweepPoint],
}

impl ComparisonReport<'_> {
    /// Writes the report into the directory `dir`, made if missing, and gives the files written in order; the last
    /// is the page to open.
    ///
    /// # Errors
    /// [`ReportError`], which names the file. A new directory is not there then; in one that was, the files before it are complete.
    pub fn write(&self, dir: &Path) -> Result<Vec<PathBuf>, ReportError> {
        let mut out = FolderSink::create(dir).map_err(|error| ReportError::of_folder(dir, error))?;
        let names: Vec<&str> = self.runs.iter().map(|(engine, _)| engine.as_str()).collect();
        let frame_files: Vec<String> =
            file_parts(&names).iter().map(|part| files::frames_name(part)).collect();
        for ((engine, frames), name) in self.runs.iter().zip(&frame_files) {
            out.add(name, |to| csv::write_frames(to, self.title, engine, frames))
                .map_err(ReportError::of_output)?;
        }
        if let FlightPicture::Png { file, .. } = self.picture {
            out.add(FLIGHT_PICTURE, |to| to.write_all(file)).map_err(ReportError::of_output)?;
        }
        add_text(&mut out, "summary.json", &self.summary_json(&dir.join("summary.json"))?)?;
        let plots = self.add_plots(dir, &mut out)?;
        add_text(&mut out, "report.html", &html::page(self, &frame_files, &plots))?;
        out.publish().map_err(|error| ReportError::of_folder(dir, error))
    }

    fn summary_json(&self, path: &Path) -> Result<String, ReportError> {
        let summary = Summary {
            origin: self.title.origin(),
            comparison: self.comparison,
            tolerance_sweep: self.tolerance_sweep,
            incoherence_sweep: self.incoherence_sweep,
        };
        match serde_json::to_string_pretty(&summary) {
            Ok(text) => Ok(text + "\n"),
            Err(source) => Err(ReportError::Json { path: path.into(), source }),
        }
    }

    #[cfg(feature = "plots")]
    fn add_plots(&self, dir: &Path, out: &mut FolderSink) -> Result<Vec<PlotFile>, ReportError> {
        add_charts(figures::all(self), dir, out)
    }

    #[cfg(not(feature = "plots"))]
    fn add_plots(&self, _: &Path, _: &mut FolderSink) -> Result<Vec<PlotFile>, ReportError> {
        Ok(Vec::new())
    }
}

/// Adds `charts`, each as SVG and as PNG, to what goes into the directory `dir`.
#[cfg(feature = "plots")]
fn add_charts(
    charts: Vec<chart::Chart>,
    dir: &Path,
    out: &mut FolderSink,
) -> Result<Vec<PlotFile>, ReportError> {
    let mut plots = Vec::new();
    for chart in charts {
        let (svg, png) = (format!("{}.svg", chart.stem), format!("{}.png", chart.stem));
        let drawn = |name: &str| {
            let path = dir.join(name);
            move |reason| ReportError::Draw { path, reason }
        };
        let drawing = plot::svg(&chart).map_err(drawn(&svg))?;
        add_text(out, &svg, &drawing)?;
        let pixels = plot::png(&chart).map_err(drawn(&png))?;
        out.add(&png, |to| to.write_all(&pixels)).map_err(ReportError::of_output)?;
        plots.push(PlotFile { caption: chart.caption, svg, png, drawing });
    }
    Ok(plots)
}

fn add_text(out: &mut FolderSink, name: &str, text: &str) -> Result<(), ReportError> {
    out.add(name, |to| to.write_all(text.as_bytes())).map_err(ReportError::of_output)
}

/// Engine names as parts of file names: lower-case letters, digits, `-`, `_`; all different.
fn file_parts(names: &[&str]) -> Vec<String> {
    let mut parts: Vec<String> = Vec::with_capacity(names.len());
    for name in names {
        let safe = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c.to_ascii_lowercase() } else { '-' };
        let mut part: String = name.chars().take(64).map(safe).collect();
        if part.is_empty() {
            part.push_str("engine");
        }
        let free = (2u32..).map(|n| format!("{part}-{n}")).find(|p| !parts.contains(p));
        parts.push(if parts.contains(&part) { free.unwrap_or(part) } else { part });
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flight of `frames` as three engines might fly it.
    pub(super) fn made_up_runs(frames: u64) -> Vec<(String, Vec<FrameStats>)> {
        let engine =
            |name: &str, tests: &dyn Fn(f64) -> f64, ms: &dyn Fn(f64) -> f64, pages: &dyn Fn(f64) -> f64| {
                let frame = |i: u64| {
                    let t = i as f64;
                    let mixed = (i + 1000 * name.len() as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                    let noise = ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64
                        / f64::from(1 << 24);
                    FrameStats {
                        frame: i,
                        triangles: 51_000 + 400 * (i % 17),
                        new_triangles: if i == 0 { 51_000 } else { 300 + i % 90 },
                        vertex_tests: (tests(t) * (0.9 + 0.2 * noise)) as u64,
                        splits: 140,
                        merges: 120,
                        pages_touched: (pages(t) * (0.95 + 0.1 * noise)) as u64,
                        record_bytes_touched: 1_234_567,
                        update_ms: ms(t) * (0.9 + 0.3 * noise * noise),
                        mesh_hash: 0x1234_5678_9abc ^ i,
                        ..FrameStats::default()
                    }
                };
                (name.to_owned(), (0..frames).map(frame).collect())
            };
        let wave = |t: f64| 1.0 + 0.25 * (t / 90.0).sin() + 0.1 * (t / 23.0).cos();
        vec![
            engine("soar", &|t| 120_000.0 * wave(t), &|t| 21.0 * wave(t), &|t| 900.0 * wave(t)),
            engine(
                "smart",
                &|t| 120_000.0 * wave(t) * (0.065 + 0.04 * (t / 41.0).sin().powi(8)),
                &|t| 2.1 * wave(t),
                &|t| 130.0 * wave(t),
            ),
            engine("smart-cache", &|t| 9_000.0 * wave(t), &|t| 1.4 * wave(t), &|t| 60.0 * wave(t)),
        ]
    }

    pub(super) fn made_up_sweep(xs: &[f64]) -> Vec<SweepPoint> {
        let point = |x: f64, engine: &str, top: f64| SweepPoint {
            x,
            engine: engine.into(),
            speedup_median: 1.0 + top / (0.6 + x),
            vertex_tests_ratio: 0.05 + 0.01 * x,
            frames: 120,
            triangles_mean: 51_000.0,
            incoherence_percent: 0.6,
            speed_m_per_frame: None,
        };
        xs.iter()
            .flat_map(|x| [point(*x, "soar", 0.0), point(*x, "smart", 12.0), point(*x, "smart-cache", 17.0)])
            .collect()
    }

    pub(super) fn title() -> ReportTitle {
        ReportTitle {
            terrain: "Puget Sound 8193 x 8193".into(),
            flight: "straight, 12 m a frame".into(),
            tolerance_px: 1.0,
            metric: terrasoar::view::ErrorMetric::default(),
            viewport: terrasoar::view::Viewport::default(),
            exaggeration: 1.0,
            culling: terrasoar::refine::Culling::default(),
            cache_mib: None,
            made: None,
        }
    }

    pub(super) fn with_report<T>(frames: u64, check: impl FnOnce(&ComparisonReport<'_>) -> T) -> T {
        let (runs, title) = (made_up_runs(frames), title());
        check(&ComparisonReport {
            title: &title,
            comparison: &Comparison::of(&runs),
            runs: &runs,
            tolerance_sweep: &made_up_sweep(&[0.5, 1.0, 2.0, 4.0, 8.0]),
            incoherence_sweep: &made_up_sweep(&[0.61, 1.36, 5.29]),
            picture: FlightPicture::Missing("no adapter"),
        })
    }

    #[test]
    fn the_directory_holds_what_the_report_says_and_twice_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let first = folder.path().join("a/b");
        let (a, b) =
            with_report(1000, |r| (r.write(&first).unwrap(), r.write(&folder.path().join("c")).unwrap()));
        assert_eq!(a.len(), if cfg!(feature = "plots") { 15 } else { 5 });
        for (a, b) in a.iter().zip(&b) {
            assert_eq!(a.file_name(), b.file_name());
            assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap(), "{}", a.display());
        }
        let page = std::fs::read_to_string(a.last().unwrap()).unwrap();
        for file in &a[..a.len() - 1] {
            let name = file.file_name().unwrap().to_str().unwrap();
            assert!(page.contains(&format!("href=\"{name}\"")), "{name}");
        }
        let json = std::fs::read_to_string(first.join("summary.json")).unwrap();
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(value["comparison"]["engines"][1]["engine"], "smart");
        assert_eq!(value["incoherence_sweep"][0]["x"], 0.61);
    }

    #[test]
    fn empty_and_short_comparisons_are_reported_too() {
        let title = title();
        let folder = tempfile::tempdir().unwrap();
        for frames in [0, 1, 2] {
            with_report(frames, |r| r.write(folder.path()).unwrap());
        }
        let report = ComparisonReport {
            title: &title,
            comparison: &Comparison::of(&[]),
            runs: &[],
            tolerance_sweep: &[],
            incoherence_sweep: &[],
            picture: FlightPicture::Missing("no adapter"),
        };
        let written = report.write(folder.path()).unwrap();
        assert!(written.last().unwrap().ends_with("report.html"));
    }

    #[test]
    fn a_directory_that_cannot_be_made_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "x").unwrap();
        let error = with_report(2, |r| r.write(&file.join("below")).unwrap_err());
        assert!(
            matches!(error, ReportError::Directory { .. }) && error.to_string().contains("file"),
            "{error}"
        );
        std::fs::create_dir(folder.path().join("summary.json")).unwrap();
        let error = with_report(2, |r| r.write(folder.path()).unwrap_err()).to_string();
        assert!(error.contains("summary.json"), "{error}");
    }

    #[test]
    fn engine_names_become_different_safe_file_names() {
        assert_eq!(
            file_parts(&["soar", "SOAR", "a/../b", "", "a b"]),
            ["soar", "soar-2", "a----b", "engine", "a-b"]
        );
    }
}
