//! Verbs that are ended by signals at several moments: what was there is there, or the whole new output is; nothing else.

use crate::support::Bench;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use terrasoar_layout::testing::one_in;

/// Signals that end a program, and their numbers.
pub const SIGNALS: [(&str, i32); 4] = [("INT", 2), ("TERM", 15), ("HUP", 1), ("KILL", 9)];
/// Moments of a run at which each signal comes, in parts of its time.
const MOMENTS: [f64; 3] = [0.2, 0.6, 0.95];

/// Every file and folder below `folder`, by its path: what is in it, if it is a file. What a killed process may leave between naming a complete file and renaming it is left out.
pub fn tree(folder: &Path) -> BTreeMap<String, Option<Vec<u8>>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(here) = open.pop() {
        for entry in fs::read_dir(&here).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            if name.ends_with(".terrasoar-new") {
                continue;
            }
            let is_folder = path.is_dir();
            found.insert(name, (!is_folder).then(|| fs::read(&path).unwrap()));
            if is_folder {
                open.push(path);
            }
        }
    }
    found
}

/// What is compared of a tree: everything, or names alone where bytes have times in them.
fn seen(tree: &BTreeMap<String, Option<Vec<u8>>>, repeats: bool) -> BTreeMap<String, Option<Vec<u8>>> {
    let bytes = |bytes: &Option<Vec<u8>>| bytes.clone().filter(|_| repeats);
    tree.iter().map(|(name, file)| (name.clone(), bytes(file))).collect()
}

/// Runs `args` in `bench` and ends it by every signal, each at one or two moments, or with `./test --full` at all; `restore` brings back what was there before.
pub fn check(bench: &Bench, args: &[&str], repeats: bool, restore: &dyn Fn(&Bench)) {
    restore(bench);
    let before = seen(&tree(bench.folder()), repeats);
    let mut whole = Duration::MAX;
    let mut after = BTreeMap::new();
    // The first run is often the slowest.
    for _ in 0..2 {
        restore(bench);
        let start = Instant::now();
        bench.good(args);
        whole = whole.min(start.elapsed());
        after = seen(&tree(bench.folder()), repeats);
    }
    assert!(before != after, "{args:?} writes nothing");
    let mut ended = 0_u32;
    let all = SIGNALS.into_iter().flat_map(|signal| MOMENTS.map(|moment| (signal, moment)));
    for ((name, number), moment) in one_in(2, all) {
        // A machine that has become faster since is met earlier.
        for share in [1.0, 0.5, 0.25, 0.1, 0.0] {
            restore(bench);
            let mut child = bench.command(args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
            std::thread::sleep(whole.mul_f64(moment * share));
            let kill = format!("kill -{name} {}", child.id());
            // It may have ended by itself.
            let _ = Command::new("sh").args(["-c", &kill]).stderr(Stdio::null()).status();
            let status = child.wait().unwrap();
            let now = seen(&tree(bench.folder()), repeats);
            let is_whole = now == after;
            assert!(
                is_whole || now == before,
                "{args:?}, {name} at {moment}: {:?} instead of {:?} or {:?}",
                now.keys(),
                before.keys(),
                after.keys()
            );
            assert!(status.signal() == Some(number) || status.success(), "{args:?}, {name}: {status}");
            assert!(is_whole || status.signal() == Some(number), "{args:?}, {name}: {status}");
            if !is_whole {
                ended += 1;
                break;
            }
        }
    }
    assert!(ended >= 4, "{args:?}: the signals came too late: {ended}");
}

/// As [`check`], of a file that is not there before.
fn check_file(bench: &Bench, args: &[&str], out: &str) {
    check(bench, &[args, &["-o", out]].concat(), true, &|bench| {
        let _ = fs::remove_file(bench.path(out));
    });
}

#[test]
fn a_killed_synth_leaves_nothing() {
    let bench = Bench::with_terrain();
    let [tiff, png] =
        if terrasoar_layout::testing::is_thorough() { ["2049", "1025"] } else { ["1025", "513"] };
    check_file(&bench, &["synth", "--size", tiff, "--seed", "1"], "a.tif");
    check_file(&bench, &["synth", "--size", png, "--seed", "1"], "a.png");
    check_file(&bench, &["synth", "--colour", "land.iqt", "--texels", "16"], "b.tif");
}

#[test]
fn a_killed_build_leaves_nothing() {
    let bench = Bench::with_terrain();
    bench.good(&["synth", "--size", "513", "--seed", "3", "-o", "large.tif"]);
    check_file(&bench, &["build", "large.tif", "--memory", "48"], "a.iqt");
}

#[test]
fn a_killed_compact_leaves_nothing() {
    let bench = Bench::new();
    bench.good(&["synth", "--size", "1025", "--seed", "3", "-o", "land.tif"]);
    bench.good(&["build", "land.tif", "-o", "land.iqt"]);
    check_file(&bench, &["compact", "land.iqt"], "b.iqt");
}

#[test]
fn a_killed_flight_or_script_leaves_what_was_there() {
    let bench = Bench::with_terrain();
    let flight =
        ["flight", "orbit", "land.iqt", "--frames", "50000", "--speed", "5", "-o", "a.flight", "--force"];
    let script = ["crater", "land.iqt", "--rain", "50000", "--seed", "1", "-o", "a.edits", "--force"];
    for (args, out) in [(&flight[..], "a.flight"), (&script, "a.edits")] {
        check(&bench, args, true, &|bench| fs::write(bench.path(out), "what was there").unwrap());
    }
}

#[test]
fn a_killed_mesh_or_replay_leaves_nothing() {
    let bench = Bench::with_terrain();
    bench.good(&["flight", "orbit", "land.iqt", "--frames", "600", "--speed", "9", "-o", "a.flight"]);
    let mesh = ["mesh", "land.iqt", "--flight", "a.flight", "--frame", "599", "--engine", "soar"];
    check_file(&bench, &mesh, "a.ply");
    let replay = ["replay", "land.iqt", "--flight", "a.flight", "--stats", "a.csv"];
    check(&bench, &replay, false, &|bench| {
        let _ = fs::remove_file(bench.path("a.csv"));
    });
}

#[test]
fn a_killed_report_leaves_no_folder() {
    let bench = Bench::with_flight();
    let land = ["land.iqt", "--flight", "land.flight", "--engines", "soar", "-o", "x/r"];
    for verb in [&["compare", "--no-sweeps"][..], &["iobench", "--layouts", "row"]] {
        check(&bench, &[verb, &land].concat(), false, &|bench| {
            let _ = fs::remove_dir_all(bench.path("x"));
        });
    }
}

/// The copy of the program that measures under a cap ends with the program, and the control group is gone.
#[test]
#[cfg(target_os = "linux")]
fn a_killed_measurement_under_a_cap_leaves_no_process_and_no_group() {
    let bench = Bench::with_terrain();
    bench.good(&["flight", "orbit", "land.iqt", "--frames", "900", "--speed", "9", "-o", "a.flight"]);
    let args = ["iobench", "land.iqt", "--flight", "a.flight", "--layouts", "ours", "--cap", "256", "--json"];
    let (mut ended, mut tries) = (0, 0);
    while ended < SIGNALS.len() {
        tries += 1;
        assert!(tries < 40, "the measurement always ends before the signal comes");
        let (name, _) = SIGNALS[ended];
        let mut child = bench.command(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let group = format!("terrasoar-iobench-{}", child.id());
        let start = Instant::now();
        while groups(&group) == 0
            && start.elapsed() < Duration::from_secs(20)
            && child.try_wait().unwrap().is_none()
        {
            std::thread::sleep(Duration::from_millis(5));
        }
        if groups(&group) == 0 {
            // Either it was quicker than the look, or there is no such thing here.
            if child.wait().unwrap().success() && tries < 10 {
                continue;
            }
            println!("not tried: there are no control groups here");
            return;
        }
        std::thread::sleep(Duration::from_millis(100 / tries));
        let kill = format!("kill -{name} {}", child.id());
        let _ = Command::new("sh").args(["-c", &kill]).stderr(Stdio::null()).status();
        let status = child.wait().unwrap();
        assert!(status.signal().is_some() || status.success(), "{name}: {status}");
        ended += usize::from(status.signal().is_some());
        let start = Instant::now();
        while groups(&group) > 0 || copies(&group) > 0 {
            assert!(start.elapsed() < Duration::from_secs(20), "{name}: {} copies", copies(&group));
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Control groups of this name, wherever they are.
#[cfg(target_os = "linux")]
fn groups(name: &str) -> usize {
    let found =
        Command::new("find").args(["/sys/fs/cgroup", "-name", name]).stderr(Stdio::null()).output().unwrap();
    String::from_utf8_lossy(&found.stdout).lines().count()
}

/// Processes that were given this group.
#[cfg(target_os = "linux")]
fn copies(group: &str) -> usize {
    let is_copy = |entry: fs::DirEntry| {
        let line = fs::read(entry.path().join("cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&line).contains(group)
    };
    fs::read_dir("/proc").unwrap().flatten().map(is_copy).filter(|is| *is).count()
}

/// What a program is told to ignore it ignores, as `nohup` has it.
#[test]
fn a_signal_that_was_ignored_at_the_start_stays_ignored() {
    let bench = Bench::new();
    let program = env!("CARGO_BIN_EXE_terrasoar");
    let script = format!(
        "trap '' HUP; '{program}' synth --size 2049 --seed 1 -o a.tif & sleep 0.1; kill -HUP $!; wait $!"
    );
    let status = Command::new("sh").args(["-c", &script]).current_dir(bench.folder()).status().unwrap();
    assert_eq!(status.code(), Some(0));
    assert_eq!(bench.names(), ["a.tif"]);
}
