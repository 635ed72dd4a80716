//! The example of a window of one's own (examples/window), on the virtual display.

use super::driver::Display;
use super::{Outcome, ensure};
use std::path::PathBuf;
use std::process::Command;

/// Draws some frames and ends well; without a file, or with one that is none, it ends with words.
pub fn window_of_ones_own(display: &Display) -> Outcome {
    let example = built()?;
    let run = |arguments: &[&str]| {
        let mut command = display.in_display(Command::new(&example));
        command.args(arguments).output().map_err(|e| e.to_string())
    };
    let done = run(&["puget.iqt", "4"])?;
    let words = String::from_utf8_lossy(&done.stderr).into_owned();
    ensure(done.status.success(), || format!("{}: {words}", done.status))?;
    let wrong = run(&["nowhere.iqt", "4"])?;
    let words = String::from_utf8_lossy(&wrong.stderr).into_owned();
    ensure(wrong.status.code() == Some(1) && words.contains("nowhere.iqt"), || {
        format!("{}: {words}", wrong.status)
    })
}

/// The example's program. It is there where all tests are built; where this one was built alone it is built now.
fn built() -> Result<PathBuf, String> {
    let here = std::env::current_exe().map_err(|e| e.to_string())?;
    let profile = here.parent().and_then(|deps| deps.parent()).ok_or("a test without a folder")?;
    let example = profile.join("examples").join(format!("window{}", std::env::consts::EXE_SUFFIX));
    if !example.exists() {
        let built = Command::new(env!("CARGO"))
            .args(["build", "--offline", "-p", "terrasoar-scene", "--example", "window"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .status()
            .map_err(|e| e.to_string())?;
        ensure(built.success(), || "the example does not compile".into())?;
    }
    Ok(example)
}
