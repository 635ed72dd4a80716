//! Two writers of one file, whatever names they know it by: the second is told, and nothing that either was told is done gets lost.

use crate::edit::write;
use crate::edit_processes::{batches_in_step, height_in_step};
use crate::support::{Bench, text};
use std::fs::File;
use std::os::fd::AsRawFd;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use terrasoar_layout::edit::{EditSession, history};
use terrasoar_layout::read::terrain::Terrain;

/// A file and its names.
struct Names {
    bench: Bench,
    /// Names relative to the folder, or absolute.
    names: Vec<PathBuf>,
    /// Keeps the name by descriptor alive.
    _opened: File,
}

/// Names of every kind of the file `name`, which exists.
fn names_of(bench: Bench, name: &str) -> Names {
    let at = |name: &str| bench.path(name);
    symlink(name, at("link")).unwrap();
    symlink(at("link"), at("link-to-link")).unwrap();
    symlink(".", at("folder")).unwrap();
    std::fs::create_dir(at("below")).unwrap();
    symlink(format!("../{name}"), at("below/up")).unwrap();
    std::fs::hard_link(at(name), at("hard")).unwrap();
    std::fs::hard_link(at(name), at("below/hard")).unwrap();
    let opened = File::open(at(name)).unwrap();
    let mut names: Vec<PathBuf> =
        [name, "link", "link-to-link", "below/up", "hard", "below/hard"].map(PathBuf::from).to_vec();
    names.push(format!("./below/../{name}").into());
    names.push(format!("folder/{name}").into());
    names.push(at(name));
    names.push(format!("/proc/{}/fd/{}", std::process::id(), opened.as_raw_fd()).into());
    Names { bench, names, _opened: opened }
}

/// A bench with a script of one batch, a picture and a file of one height.
fn bench() -> Bench {
    let bench = Bench::with_terrain();
    bench.good(&["synth", "--colour", "land.iqt", "--texels", "4", "--seed", "2", "-o", "photo.tif"]);
    write(&bench, "a.edits", &batches_in_step([20.0]));
    bench.good(&["edit", "land.iqt", "--script", "a.edits"]);
    bench
}

fn is_told(error: &str) {
    assert!(error.contains("another program is writing"), "{error}");
}

#[test]
fn under_no_name_is_there_a_second_writer_in_one_process() {
    let names = names_of(bench(), "land.iqt");
    let paths: Vec<PathBuf> = names.names.iter().map(|name| names.bench.path("").join(name)).collect();
    for first in &paths {
        let mut held =
            EditSession::open(first).unwrap_or_else(|error| panic!("{}: {error}", first.display()));
        for second in &paths {
            match EditSession::open(second) {
                Ok(_) => panic!("{} is written to as {}", second.display(), first.display()),
                Err(error) => is_told(&error.to_string()),
            }
        }
        // Being refused takes nothing away from the first.
        held.undo().unwrap();
        held.redo().unwrap();
        drop(held);
    }
    assert_eq!(height_in_step(&names.bench.path("land.iqt")), 20.0);
}

/// Every verb that writes, by every name, while another process has the file under each of some other names.
#[test]
fn under_no_name_is_there_a_second_writer_in_another_process() {
    let names = names_of(bench(), "land.iqt");
    let before = std::fs::read(names.bench.path("land.iqt")).unwrap();
    for first in ["land.iqt", "link", "hard"] {
        let held = EditSession::open(&names.bench.path(first)).unwrap();
        for name in &names.names {
            let name = name.to_str().unwrap();
            for args in [
                &["edit", name, "--script", "a.edits"][..],
                &["crater", name, "--at", "900,900", "--radius", "50", "--depth", "5"],
                &["undo", name],
                &["compact", name],
                &["drape", name, "--image", "photo.tif"],
            ] {
                is_told(&names.bench.bad(1, args));
            }
        }
        drop(held);
    }
    assert!(std::fs::read(names.bench.path("land.iqt")).unwrap() == before, "a refused writer wrote");
    let links = ["below", "folder", "hard", "link", "link-to-link"];
    let others = ["a.edits", "land.iqt", "land.tif", "photo.tif"];
    let mut wanted: Vec<&str> = links.into_iter().chain(others).collect();
    wanted.sort_unstable();
    assert_eq!(names.bench.names(), wanted, "something is left behind");
}

/// An overlay is a file like any other.
#[test]
fn an_overlay_has_one_writer_by_every_name() {
    let bench = bench();
    write(&bench, "a.edits", &batches_in_step([25.0]));
    bench.good(&["edit", "land.iqt", "--script", "a.edits", "--overlay", "over.iqo"]);
    let names = names_of(bench, "over.iqo");
    let base = names.bench.path("land.iqt");
    let held = EditSession::open_overlay(&base, &names.bench.path("over.iqo")).unwrap();
    for name in &names.names {
        match EditSession::open_overlay(&base, &names.bench.path("").join(name)) {
            Ok(_) => panic!("{} is written to as over.iqo", name.display()),
            Err(error) => is_told(&error.to_string()),
        }
        is_told(&names.bench.bad(1, &["undo", "land.iqt", "--overlay", name.to_str().unwrap()]));
    }
    drop(held);
    names.bench.good(&["undo", "land.iqt", "--overlay", "link"]);
}

/// Two programs at once by two names: those that were told that all is done find all of it in the file.
#[test]
fn what_two_writers_were_told_is_done_is_there() {
    let names = names_of(bench(), "land.iqt");
    let batches = 40;
    write(&names.bench, "a.edits", &batches_in_step((0..batches).map(|i| 10.0 + f64::from(i) / 10.0)));
    write(&names.bench, "b.edits", &batches_in_step((0..batches).map(|i| 30.0 + f64::from(i) / 10.0)));
    let land = names.bench.path("land.iqt");
    // Those that the terrain is after: what was undone is no longer there once something else is done.
    let commits = || {
        let entries = history(&Terrain::open(&land).unwrap()).unwrap();
        entries.iter().position(|entry| entry.is_current).map_or(0, |at| at + 1)
    };
    for name in &names.names {
        let before = commits();
        let start = |name: &Path, script: &str| {
            let mut command = names.bench.command(&["edit", name.to_str().unwrap(), "--script", script]);
            command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
        };
        let running = [start(Path::new("land.iqt"), "a.edits"), start(name, "b.edits")];
        let mut done = 0;
        for child in running {
            let output = child.wait_with_output().unwrap();
            match output.status.code() {
                Some(0) => done += batches as usize,
                _ => is_told(&text(&output.stderr)),
            }
        }
        assert!(done > 0, "both were sent away");
        assert_eq!(commits(), before + done, "{}: batches told as done are lost", name.display());
        height_in_step(&land);
        names.bench.good(&["undo", "land.iqt", "1000"]);
    }
    names.bench.good(&["verify", "land.iqt"]);
}
