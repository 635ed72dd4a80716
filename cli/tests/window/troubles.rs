//! What must not end the program, and what must end it with a word.

use super::driver::Display;
use super::{Outcome, ensure};

pub fn broken_settings(display: &Display) -> Outcome {
    let path = display.settings();
    std::fs::create_dir_all(path.parent().unwrap()).map_err(|e| e.to_string())?;
    std::fs::write(&path, "style = [[[").map_err(|e| e.to_string())?;
    let (code, words, heard) = display.open(&["--exit-after-frames", "3"])?.end()?;
    ensure(code == Some(0), || format!("{code:?}: {words}"))?;
    let told = heard.iter().any(|line| line.starts_with("trouble ") && line.contains("view.toml"));
    ensure(told, || format!("it is told: {heard:?}"))?;
    let text = std::fs::read_to_string(&path).map_err(|e| e.to_string())?;
    ensure(text.contains("style = \"relief\""), || format!("defaults are in its place: {text}"))
}

pub fn lost_device(display: &Display) -> Outcome {
    let arguments = ["--lose-device-after-frames", "2", "--exit-after-frames", "8"];
    let (code, words, heard) = display.open(&arguments)?.end()?;
    ensure(code == Some(0), || format!("{code:?}: {words}; {heard:?}"))?;
    ensure(heard.iter().any(|line| line == "recovered"), || format!("{heard:?}; {words}"))
}

pub fn no_adapter(display: &Display) -> Outcome {
    // An interface that this system does not have has no adapters either.
    let output = display
        .program(&["view", "puget.iqt"])
        .env("WGPU_BACKEND", "vulkan")
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env("VK_ICD_FILENAMES", "/nonexistent.json")
        .output()
        .map_err(|e| e.to_string())?;
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure(output.status.code() == Some(1), || format!("{:?}: {words}", output.status))?;
    ensure(words.contains("error: ") && words.contains("mesa-vulkan-drivers"), || words.clone())
}

pub fn no_display(display: &Display) -> Outcome {
    // Nothing that names a display, and names of displays that are not there.
    let cases: [&[(&str, &str)]; 4] =
        [&[], &[("DISPLAY", "")], &[("DISPLAY", ":7654")], &[("WAYLAND_DISPLAY", "wayland-7654")]];
    for set in cases {
        let mut command = display.program(&["view", "puget.iqt"]);
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        command.envs(set.iter().copied());
        let output = command.output().map_err(|e| e.to_string())?;
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        let told = || format!("{set:?}: {words}");
        ensure(output.status.code() == Some(1), || format!("{:?}: {}", output.status, told()))?;
        ensure(words.contains("display") && words.contains("DISPLAY"), told)?;
        ensure(words.contains("snapshot") && words.contains("movie"), told)?;
        ensure(words.lines().count() == 1 && words.starts_with("error: "), told)?;
        // Neither places in source text nor names of a library's own types.
        let is_debug_text =
            [".rs", "os error at", "registry", "Os(", "{ ", "winit"].iter().any(|w| words.contains(w));
        ensure(!is_debug_text, told)?;
        if set.is_empty() {
            ensure(words.contains("no display") && words.contains("WAYLAND_DISPLAY"), told)?;
        }
    }
    let other = display.program(&["info", "puget.iqt"]).env_remove("DISPLAY").output();
    ensure(other.is_ok_and(|o| o.status.success()), || "other verbs need no display".into())
}

/// Drivers find nothing to complain about on standard error, whatever the variable is that they complain about.
pub fn nothing_on_standard_error(display: &Display) -> Outcome {
    for folder in [None, Some("not/absolute")] {
        let mut command = display.program(&["view", "puget.iqt", "--exit-after-frames", "3"]);
        if let Some(folder) = folder {
            command.env("XDG_RUNTIME_DIR", folder);
        }
        let output = command.output().map_err(|e| e.to_string())?;
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        ensure(output.status.success() && words.is_empty(), || format!("{folder:?}: {words}"))?;
    }
    Ok(())
}
