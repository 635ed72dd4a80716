//! The examples with a window of their own (examples/window, examples/steps), on the virtual display.

use super::driver::Display;
use super::{Outcome, ensure};
use std::path::PathBuf;
use std::process::Command;

/// Each draws some frames and ends well; without a file, or with one that is none, it ends with words.
pub fn windows_of_ones_own(display: &Display) -> Outcome {
    for name in ["window", "step_4_window", "step_5_game"] {
        let example = built(name)?;
        let run = |arguments: &[&str]| {
            let mut command = display.in_display(Command::new(&example));
            command.args(arguments).output().map_err(|e| e.to_string())
        };
        let done = run(&["puget.iqt", "4"])?;
        let words = String::from_utf8_lossy(&done.stderr).into_owned();
        ensure(done.status.success(), || format!("{name}: {}: {words}", done.status))?;
        let wrong = run(&["nowhere.iqt", "4"])?;
        let words = String::from_utf8_lossy(&wrong.stderr).into_owned();
        ensure(wrong.status.code() == Some(1) && words.contains("nowhere.iqt"), || {
            format!("{name}: {}: {words}", wrong.status)
        })?;
    }
    Ok(())
}

/// The example's program. It is there where all tests are built; where this one was built alone it is built now.
fn built(name: &str) -> Result<PathBuf, String> {
    let here = std::env::current_exe().map_err(|e| e.to_string())?;
    let profile = here.parent().and_then(|deps| deps.parent()).ok_or("a test without a folder")?;
    let example = profile.join("examples").join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    if !example.exists() {
        let built = Command::new(env!("CARGO"))
            .args(["build", "--offline", "-p", "terrasoar-scene", "--example", name])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .status()
            .map_err(|e| e.to_string())?;
        ensure(built.success(), || "the example does not compile".into())?;
    }
    Ok(example)
}
