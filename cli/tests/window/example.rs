//! The examples with a window of their own (examples/window, examples/steps), on the virtual display.

use super::driver::Display;
use super::{Outcome, ensure, examples};
use std::process::Command;

/// Each draws some frames and ends well; without a file, or with one that is none, it ends with words.
pub fn windows_of_ones_own(display: &Display) -> Outcome {
    for name in ["window", "step_4_window", "step_5_game"] {
        let example = examples::built("terrasoar-scene", name)?;
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
