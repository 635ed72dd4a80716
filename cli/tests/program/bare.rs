//! A system without `/proc`, as in a bare chroot or a strict sandbox: nothing that the program does may need it.

use crate::support::{Bench, text};
use std::process::Command;

/// What a shell says after hiding `/proc` from `script`; nothing where this system does not let it be hidden.
fn without_proc(bench: &Bench, script: &str) -> Option<(bool, String)> {
    let program = env!("CARGO_BIN_EXE_terrasoar");
    let hidden = format!("mount -t tmpfs none /proc && echo hidden && set -e && {script}");
    let run = Command::new("unshare")
        .args(["--map-root-user", "--mount", "sh", "-c", &hidden])
        .env("terrasoar", program)
        .env("XDG_CACHE_HOME", bench.cache())
        .current_dir(bench.folder())
        .output()
        .ok()?;
    let said = text(&run.stdout);
    said.starts_with("hidden\n").then(|| (run.status.success(), said + &text(&run.stderr)))
}

#[test]
fn files_are_made_replaced_and_measured_without_proc() {
    let bench = Bench::with_flight();
    let before = bench.names();
    let script = "
        $terrasoar synth --size 129 --seed 5 -o new.tif
        $terrasoar build new.tif -o new.iqt
        $terrasoar build new.tif -o new.iqt
        cmp new.iqt land.iqt
        $terrasoar crater new.iqt --at 900,900 --radius 60 --depth 9
        $terrasoar undo new.iqt
        $terrasoar compact new.iqt
        $terrasoar verify new.iqt
        $terrasoar height new.iqt --at 900,900
        $terrasoar replay new.iqt --flight land.flight --stats new.csv
        $terrasoar iobench new.iqt --flight land.flight --engines kinetic --layouts ours
        $terrasoar export new.iqt -o out.tif";
    let Some((is_good, said)) = without_proc(&bench, script) else { return };
    assert!(is_good, "{said}");
    let mut names = before;
    names.extend(["new.tif", "new.iqt", "new.csv", "out.tif"].map(String::from));
    names.sort();
    assert_eq!(bench.names(), names);
}
