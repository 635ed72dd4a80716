//! Builds on a disk that fills, for real: a small file system in memory, mounted where only the program sees it (`unshare`, `mount`). Where
//! that is not allowed, or there is no Linux, the tests count as ignored and say why.

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::path::Path;
use std::process::{Command, ExitCode, Output};

/// A test's outcome: what is wrong, in words.
type Outcome = Result<(), String>;
type Test = fn() -> Outcome;

const TESTS: &[(&str, Test)] = &[
    ("no_room_for_the_terrain_file", no_room_for_the_terrain_file),
    ("no_room_for_the_samples", no_room_for_the_samples),
];

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let refusal = if arguments.list { None } else { refusal() };
    if let Some(why) = &refusal {
        println!("all tests are ignored: {why}");
    }
    let is_possible = refusal.is_none();
    let trials = TESTS.iter().map(|(name, test)| {
        Trial::ignorable_test(*name, move || {
            if !is_possible {
                return Ok(Completion::ignored_with("no small disk can be mounted"));
            }
            test().map(|()| Completion::Completed).map_err(Failed::from)
        })
    });
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}

/// Why no small disk can be had; `None` if one can.
fn refusal() -> Option<String> {
    let folder = tempfile::tempdir().ok()?;
    match on_disk(folder.path(), 64, "true") {
        Ok(output) if output.status.success() => None,
        Ok(output) => Some(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
        Err(error) => Some(format!("cannot run unshare: {error}")),
    }
}

/// Runs a shell command in a folder `disk` inside `folder` that has room for `kib` KiB, and is empty again afterwards.
fn on_disk(folder: &Path, kib: u64, command: &str) -> std::io::Result<Output> {
    let mount = format!("mkdir -p disk && mount -t tmpfs -o size={kib}k tmpfs disk && cd disk && {command}");
    Command::new("unshare").args(["-rm", "sh", "-c", &mount]).current_dir(folder).output()
}

fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}

/// Makes `land.tif` of `size` samples a side in `folder` and, beside the small disks, its terrain file, whose length it tells in KiB.
fn with_land(folder: &Path, size: &str) -> Result<u64, String> {
    let run = |args: &[&str]| {
        let output = Command::new(PROGRAM).args(args).current_dir(folder).output();
        let output = output.map_err(|e| format!("cannot run {args:?}: {e}"))?;
        ensure(output.status.success(), || String::from_utf8_lossy(&output.stderr).into_owned())
    };
    run(&["synth", "--size", size, "--seed", "5", "-o", "land.tif"])?;
    run(&["build", "land.tif", "-o", "land.iqt"])?;
    std::fs::metadata(folder.join("land.iqt")).map(|meta| meta.len() / 1024).map_err(|e| e.to_string())
}

const PROGRAM: &str = env!("CARGO_BIN_EXE_terrasoar");

/// Builds `land.tif` on a disk of `kib` KiB; tells the exit code, what was said, and what was left on the disk.
fn build(folder: &Path, kib: u64) -> Result<(Option<i32>, String, String), String> {
    let command = format!(
        "{{ '{PROGRAM}' build ../land.tif -o x.iqt --memory 48; code=$?; ls -A > ../left; exit $code; }}"
    );
    let output = on_disk(folder, kib, &command).map_err(|e| e.to_string())?;
    let left = std::fs::read_to_string(folder.join("left")).map_err(|e| e.to_string())?;
    Ok((output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned(), left))
}

fn fails_for_want_of_room(folder: &Path, kib: u64, words: &[&str]) -> Outcome {
    let (code, said, left) = build(folder, kib)?;
    ensure(code == Some(1), || format!("{kib} KiB: exit code {code:?}: {said}"))?;
    ensure(said.starts_with("error: x.iqt: ") && said.lines().count() == 1, || format!("{kib} KiB: {said}"))?;
    ensure(words.iter().all(|w| said.contains(w)), || format!("{kib} KiB: {words:?} not said: {said}"))?;
    ensure(left.is_empty(), || format!("{kib} KiB: left behind: {left}"))
}

fn succeeds(folder: &Path, kib: u64) -> Outcome {
    let (code, said, left) = build(folder, kib)?;
    ensure(code == Some(0) && left == "x.iqt\n", || format!("{kib} KiB: {code:?}, {left}: {said}"))
}

/// The samples fit into memory; the disk fills anywhere from the first page to the directory.
fn no_room_for_the_terrain_file() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let whole = with_land(folder.path(), "513")?;
    for kib in [4, 8, 100, whole / 3, whole / 2, whole - 100, whole - 12, whole - 8, whole - 4] {
        fails_for_want_of_room(folder.path(), kib, &["no room", "another", "os error 28"])?;
    }
    succeeds(folder.path(), whole + 64)
}

/// The samples take the way through a temporary file, 4 bytes each.
fn no_room_for_the_samples() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let whole = with_land(folder.path(), "2049")?;
    let samples = 2049 * 2049 * 4 / 1024;
    for kib in [4, 2000, samples - 100] {
        fails_for_want_of_room(folder.path(), kib, &["no room for the temporary file", "--memory"])?;
    }
    for kib in [samples + 100, samples + whole / 2, samples + whole - 40] {
        fails_for_want_of_room(folder.path(), kib, &["cannot write the terrain file", "os error 28"])?;
    }
    succeeds(folder.path(), samples + whole + 200)
}
