//! Making a terrain file from elevation data that was dropped on the window, on threads of its own.
//!
//! The file goes beside the elevation data where nothing has its name yet, else into the folder for temporary files. **Every error comes back as
//! a message.** If the window closes meanwhile nothing is left, because a build's output has no name before it is complete.

use super::meter::Meter;
use super::threads;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::file::atomic::folder_of;
use terrasoar_layout::file::header::SpacingOrigin;

/// A build that has ended well.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Built {
    /// The terrain file.
    pub path: PathBuf,
    /// What the user should know of it.
    pub note: Option<String>,
}

/// A build under way.
#[derive(Debug)]
pub(crate) struct Job {
    /// The elevation data.
    pub input: PathBuf,
    progress: Arc<Meter>,
    thread: Option<JoinHandle<Result<Built, String>>>,
}

impl Job {
    /// Starts to build. `wake` is called when it has ended.
    pub(crate) fn start(input: PathBuf, wake: impl Fn() + Send + 'static) -> Result<Self, String> {
        let progress = Arc::new(Meter::default());
        let (heard, from) = (Arc::clone(&progress), input.clone());
        let thread = std::thread::Builder::new()
            .name("build".into())
            .spawn(move || {
                // Frames share their work out to the other pool, and would wait for parts of the build there.
                let built = match threads::pool("build", usize::MAX) {
                    Ok(pool) => pool.install(|| make(&from, &heard)),
                    Err(e) => Err(format!("{}: no threads to build with: {e}", from.display())),
                };
                wake();
                built
            })
            .map_err(|e| format!("{}: no thread to build with: {e}", input.display()))?;
        Ok(Self { input, progress, thread: Some(thread) })
    }

    /// What it is at, and which part of that is done.
    pub(crate) fn progress(&self) -> (&'static str, f32) {
        self.progress.read()
    }

    /// What came of it, once it has ended; later on nothing.
    pub(crate) fn take(&mut self) -> Option<Result<Built, String>> {
        if !self.thread.as_ref()?.is_finished() {
            return None;
        }
        let ended = self.thread.take()?.join();
        Some(ended.unwrap_or_else(|_| {
            Err(format!("{}: the build came to an unexpected end", self.input.display()))
        }))
    }
}

/// Whether a file is a terrain file by its name; everything else is taken for elevation data.
pub(crate) fn is_terrain(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("iqt"))
}

fn make(input: &Path, progress: &Meter) -> Result<Built, String> {
    let dem =
        terrasoar_import::open(std::slice::from_ref(&input.to_path_buf())).map_err(|e| e.to_string())?;
    let path = output_for(input);
    let header = build(&*dem, &path, &BuildOptions::default(), progress).map_err(|e| e.to_string())?;
    let note = match header.spacing_origin {
        SpacingOrigin::Assumed => Some(format!(
            "{}: the samples were taken to be 1 m apart, for the file does not say; `terrasoar build` takes --spacing and --z-scale",
            input.display()
        )),
        _ => None,
    };
    Ok(Built { path, note })
}

/// Where the terrain file goes: beside the input, or where files may go in any case.
fn output_for(input: &Path) -> PathBuf {
    let beside = input.with_extension("iqt");
    let folder = folder_of(&beside);
    let writable = tempfile::tempfile_in(folder).is_ok();
    if writable && !beside.exists() {
        return beside;
    }
    let stem = input.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let elsewhere = if writable { folder.to_path_buf() } else { std::env::temp_dir() };
    (2..).map(|n| elsewhere.join(format!("{stem}-{n}.iqt"))).find(|path| !path.exists()).unwrap_or(beside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    fn run(input: &Path) -> Result<Built, String> {
        let mut job = Job::start(input.to_path_buf(), || {}).unwrap();
        let start = Instant::now();
        loop {
            if let Some(ended) = job.take() {
                assert!(job.take().is_none(), "told once");
                return ended;
            }
            assert!(start.elapsed() < Duration::from_secs(120), "stuck at {:?}", job.progress());
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_dem_becomes_a_terrain_file_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("puget.png");
        std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/puget_sound_1025.png"), &input)
            .unwrap();
        let built = run(&input).unwrap();
        assert_eq!(built.path, folder.path().join("puget.iqt"));
        assert!(built.note.unwrap().contains("--spacing"));
        let terrain = terrasoar_layout::read::terrain::Terrain::open(&built.path).unwrap();
        assert_eq!(terrain.grid().samples(), [1025, 1025]);
        assert_eq!(output_for(&input), folder.path().join("puget-2.iqt"), "nothing is replaced");
    }

    #[test]
    fn a_build_takes_none_of_the_threads_that_frames_have() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("puget.png");
        std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/puget_sound_1025.png"), &input)
            .unwrap();
        threads::while_frames_have_all_threads(|| {
            assert_eq!(run(&input).unwrap().path, folder.path().join("puget.iqt"));
        });
    }

    #[test]
    fn what_is_no_dem_comes_back_as_words() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("shopping.txt");
        std::fs::write(&input, "milk, bread").unwrap();
        assert!(run(&input).unwrap_err().contains("shopping.txt"));
        assert!(run(&folder.path().join("none.tif")).unwrap_err().contains("none.tif"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no leftovers");
        assert!(is_terrain(Path::new("a.IQT")) && !is_terrain(Path::new("a.tif")));
    }
}
