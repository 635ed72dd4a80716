//! Kills at random moments of everything that writes to a terrain file, while others read it: what is there afterwards is a whole number of steps, what was told as done is
//! among them, and whoever opens the file in between sees a whole one.
//!
//! `TERRASOAR_KILLS` says how often; each time is another verb at another moment.

use crate::edit::write;
use crate::edit_processes::height_in_step;
use crate::support::{Bench, text};
use std::path::Path;
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use terrasoar_layout::edit::history;
use terrasoar_layout::imagery::Imagery;
use terrasoar_layout::mix::Random;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// Kills where nothing else is said.
const KILLS: u64 = 16;
/// Kills after which a new file begins, so that files stay small and are widened again.
const KILLS_A_FILE: u64 = 20;
/// Longest that a program is left running, in milliseconds.
const LONGEST_MS: u64 = 90;

/// What is seen of a file: the height of all rectangles, and whether there is a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    height_m: f64,
    has_picture: bool,
}

/// A file's past: what it was before, what was done, what was undone (the last one first to be done again).
#[derive(Debug, Clone, PartialEq)]
struct Past {
    built: Seen,
    done: Vec<Seen>,
    undone: Vec<Seen>,
}

impl Past {
    fn now(&self) -> Seen {
        self.done.last().copied().unwrap_or(self.built)
    }

    /// Whether the file at `path` has this past.
    fn is_that_of(&self, path: &Path) -> bool {
        let terrain = Terrain::open(path).unwrap();
        let entries = history(&terrain).unwrap();
        let done = entries.iter().position(|entry| entry.is_current).map_or(0, |at| at + 1);
        let has_picture = Imagery::open(&terrain).unwrap().is_some();
        let is_height = (height_in_step(path) - self.now().height_m).abs() < 0.051;
        (done, entries.len() - done, has_picture)
            == (self.done.len(), self.undone.len(), self.now().has_picture)
            && is_height
    }

    /// As another file made of this one has it.
    fn rewritten(&self) -> Self {
        Self { built: self.now(), done: Vec::new(), undone: Vec::new() }
    }

    fn with(&self, seen: Seen) -> Self {
        let done = self.done.iter().copied().chain([seen]).collect();
        Self { done, undone: Vec::new(), ..*self }
    }
}

/// What a program is started to do.
#[derive(Debug, Clone, PartialEq)]
enum Deed {
    /// So many batches; of heights that the file has no room for, or not.
    Edit {
        heights_m: Vec<f64>,
        widens: bool,
    },
    Undo(u64),
    Redo(u64),
    Compact,
    Drape,
}

impl Deed {
    /// The states on the way, that before it first and the last one last. `None`: there is nothing to do, and the program says so.
    fn states(&self, before: &Past) -> Option<Vec<Past>> {
        let mut states = vec![before.clone()];
        let last = |states: &[Past]| states[states.len() - 1].clone();
        match self {
            Self::Edit { heights_m, widens } => {
                if *widens {
                    states.push(before.rewritten());
                }
                for height_m in heights_m {
                    let past = last(&states);
                    if past.now().height_m == *height_m {
                        // Nothing changes, and nothing is committed.
                        continue;
                    }
                    states.push(past.with(Seen { height_m: *height_m, ..past.now() }));
                }
            }
            Self::Undo(count) => {
                for _ in 0..*count {
                    let mut past = last(&states);
                    let Some(seen) = past.done.pop() else { break };
                    past.undone.push(seen);
                    states.push(past);
                }
            }
            Self::Redo(count) => {
                for _ in 0..*count {
                    let mut past = last(&states);
                    let Some(seen) = past.undone.pop() else { break };
                    past.done.push(seen);
                    states.push(past);
                }
            }
            Self::Compact => states.push(before.rewritten()),
            // A picture over a file with a past is a step of it.
            Self::Drape if before.done.is_empty() && before.undone.is_empty() => {
                states.push(Past { built: Seen { has_picture: true, ..before.built }, ..before.clone() });
            }
            Self::Drape => states.push(before.with(Seen { has_picture: true, ..before.now() })),
        }
        (states.len() > 1 || matches!(self, Self::Edit { .. })).then_some(states)
    }

    fn args(&self, bench: &Bench) -> Vec<String> {
        let words = match self {
            Self::Edit { heights_m, .. } => {
                write(
                    bench,
                    "deed.edits",
                    &crate::edit_processes::batches_in_step(heights_m.iter().copied()),
                );
                vec!["edit", "land.iqt", "--script", "deed.edits", "--no-scorch"]
            }
            Self::Undo(count) => return ["undo", "land.iqt", &count.to_string()].map(String::from).to_vec(),
            Self::Redo(count) => return ["redo", "land.iqt", &count.to_string()].map(String::from).to_vec(),
            Self::Compact => vec!["compact", "land.iqt"],
            Self::Drape => vec!["drape", "land.iqt", "--image", "photo.tif", "--format", "raw"],
        };
        words.into_iter().map(String::from).collect()
    }
}

/// A bench with a picture to drape and a file whose rectangles have one height.
fn bench() -> Bench {
    let bench = Bench::with_terrain();
    bench.good(&["synth", "--colour", "land.iqt", "--texels", "4", "--seed", "2", "-o", "photo.tif"]);
    write(&bench, "deed.edits", &crate::edit_processes::batches_in_step([20.0]));
    bench.good(&["edit", "land.iqt", "--script", "deed.edits"]);
    bench.good(&["compact", "land.iqt"]);
    std::fs::copy(bench.path("land.iqt"), bench.path("begin.iqt")).unwrap();
    bench
}

#[test]
fn whatever_is_killed_whole_steps_are_there_and_none_that_was_told_is_lost() {
    let kills = std::env::var("TERRASOAR_KILLS").map_or(KILLS, |number| number.parse().unwrap());
    let bench = bench();
    let land = bench.path("land.iqt");
    let (is_over, looks) = (AtomicBool::new(false), AtomicU64::new(0));
    std::thread::scope(|scope| {
        // However the deeds end, the readers do.
        struct Over<'a>(&'a AtomicBool);
        impl Drop for Over<'_> {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Relaxed);
            }
        }
        for reader in 0..2 {
            let (land, is_over, looks) = (&land, &is_over, &looks);
            scope.spawn(move || reads(land, reader == 0, is_over, looks));
        }
        let _over = Over(&is_over);
        let mut random = Random::new(kills);
        let mut killed = 0;
        while killed < kills {
            std::fs::copy(bench.path("begin.iqt"), bench.path("new.iqt")).unwrap();
            std::fs::rename(bench.path("new.iqt"), &land).unwrap();
            killed += kills_over_one_file(&bench, &mut random, (kills - killed).min(KILLS_A_FILE));
        }
    });
    println!("{kills} kills, {} looks", looks.load(Ordering::Relaxed));
    assert!(looks.load(Ordering::Relaxed) > kills);
    // There may be nothing left to undo.
    bench.run(&["undo", "land.iqt", "100000"]);
    bench.good(&["compact", "land.iqt"]);
    assert_eq!(bench.names(), ["begin.iqt", "deed.edits", "land.iqt", "land.tif", "photo.tif"]);
}

/// Deeds over one file until so many were killed.
fn kills_over_one_file(bench: &Bench, random: &mut Random, kills: u64) -> u64 {
    let land = bench.path("land.iqt");
    let mut past =
        Past { built: Seen { height_m: 20.0, has_picture: false }, done: Vec::new(), undone: Vec::new() };
    let (mut killed, mut number, mut has_widened) = (0, 0, false);
    while killed < kills {
        number += 1;
        let mut heights = |count: u64, from_m: f64| -> Vec<f64> {
            (0..count).map(|_| from_m + random.below(300) as f64 / 10.0).collect()
        };
        let deed = match number % 8 {
            0 => Deed::Compact,
            2 => Deed::Drape,
            3 if !has_widened => Deed::Edit { heights_m: heights(3, 3000.0), widens: true },
            4 => Deed::Undo(1 + random.below(4)),
            6 => Deed::Redo(1 + random.below(4)),
            _ => Deed::Edit {
                heights_m: {
                    let count = 1 + number % 9;
                    heights(count, 10.0)
                },
                widens: false,
            },
        };
        let Some(states) = deed.states(&past) else { continue };
        let args = deed.args(bench);
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        let mut child = bench.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // One in four may end as it likes.
        if random.below(4) > 0 {
            std::thread::sleep(Duration::from_micros(random.below(LONGEST_MS * 1000)));
            let _ = child.kill();
        }
        let output = child.wait_with_output().unwrap();
        killed += u64::from(output.status.code().is_none());
        let at = states.iter().rposition(|state| state.is_that_of(&land));
        let at = at.unwrap_or_else(|| {
            panic!("{deed:?} over {past:?}, {}: the file is in no state on the way", output.status)
        });
        if output.status.success() {
            assert_eq!(
                at,
                states.len() - 1,
                "{deed:?} over {past:?} was told as done: {}",
                text(&output.stdout)
            );
        } else {
            assert_eq!(output.status.code(), None, "{deed:?} over {past:?}: {}", text(&output.stderr));
        }
        has_widened |= matches!(deed, Deed::Edit { widens: true, .. }) && at > 0;
        past = states[at].clone();
        let report = verify(&Terrain::open(&land).unwrap(), &|_| {}).unwrap();
        assert!(report.is_sound(), "{deed:?}: {:?}", report.problems);
    }
    killed
}

/// Opens the file again and again, and goes on with one that it opened before.
fn reads(land: &Path, verifies: bool, is_over: &AtomicBool, looks: &AtomicU64) {
    let mut kept: Option<(Terrain, Option<f64>)> = None;
    let at = |terrain: &Terrain| terrain.height_m(4.0 * 20.0, 4.0 * 20.0).unwrap();
    while !is_over.load(Ordering::Relaxed) {
        height_in_step(land);
        let terrain = Terrain::open(land).unwrap();
        if verifies {
            let report = verify(&terrain, &|_| {}).unwrap();
            assert!(report.is_sound(), "{:?}", report.problems);
        }
        if let Some((before, height_m)) = &kept {
            assert_eq!(at(before), *height_m, "an opened file has changed");
        }
        let looked = looks.fetch_add(1, Ordering::Relaxed);
        if looked.is_multiple_of(16) {
            let height_m = at(&terrain);
            kept = Some((terrain, height_m));
        }
    }
}
