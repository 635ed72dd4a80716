//! A tour of the window: everything a person would do first.

use super::driver::Display;
use super::{Outcome, ensure};
use std::path::Path;
use terrasoar::flight::Flight;

pub fn tour(display: &Display) -> Outcome {
    let mut window = display.open(&["--size", "900x600"])?;
    let overview = window.rest()?;
    let id = window.focus()?;

    window.fly("w")?;
    let forward = window.rest()?;
    ensure(forward[1] > overview[1] + 10.0, || format!("w flies north: {overview:?} {forward:?}"))?;

    window.xdotool(&["mousemove", "--window", &id, "600", "300"])?;
    window.xdotool(&["mousedown", "1"])?;
    window.xdotool(&["mousemove_relative", "--", "120", "40"])?;
    window.hear("moving true")?;
    window.xdotool(&["mouseup", "1"])?;
    let turned = window.rest()?;
    ensure(turned[3] > 5.0 && turned[4] < forward[4] - 2.0, || {
        format!("it looks around: {forward:?} {turned:?}")
    })?;
    ensure(turned[..3] == forward[..3], || "and stays where it is".into())?;

    window.key("F1")?;
    window.hear("help true")?;
    window.key("Escape")?;
    window.hear("help false")?;
    window.key("Tab")?;
    window.hear("panel false")?;
    window.key("Tab")?;
    window.hear("panel true")?;
    window.key("f")?;
    window.hear("frozen true")?;
    window.key("f")?;
    window.hear("frozen false")?;

    window.key("r")?;
    window.hear("recording true")?;
    window.fly("d")?;
    window.key("r")?;
    let path = window.hear("flight ")?;
    let last = window.rest()?;
    let flight = Flight::read(Path::new(&path)).map_err(|e| e.to_string())?;
    let ends = [flight.frames.first(), flight.frames.last()].map(|f| f.map(|f| f.eye_m));
    ensure(flight.frames.len() > 3 && ends[0] != ends[1], || format!("{path}: nothing was flown"))?;

    window.key("space")?;
    window.hear("playing true")?;
    window.hear("playing false")?;
    let replayed = window.rest()?;
    let away = last.iter().zip(&replayed).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    ensure(away < 0.02, || format!("the flight ends where it was ended: {last:?} {replayed:?}"))?;

    window.xdotool(&["windowsize", &id, "760", "540"])?;
    window.hear("size 760x540")?;
    window.key("v")?;
    window.hear("style hillshade")?;
    window.key("p")?;
    let path = window.hear("picture ")?;
    check_picture(Path::new(&path), [760, 540])?;

    window.key("ctrl+q")?;
    let (code, words, _) = window.end()?;
    ensure(code == Some(0), || format!("it ended with {code:?}: {words}"))
}

/// A picture of ground and sky, not of nothing.
fn check_picture(path: &Path, size: [u32; 2]) -> Outcome {
    let picture = image::open(path).map_err(|e| e.to_string())?.to_rgb8();
    ensure([picture.width(), picture.height()] == size, || format!("{:?} pixels", picture.dimensions()))?;
    let mut colours: Vec<[u8; 3]> = picture.pixels().map(|p| p.0).collect();
    colours.sort_unstable();
    colours.dedup();
    ensure(colours.len() > 60, || format!("{}: {} colours only", path.display(), colours.len()))
}

/// After the tour: its style and its window's size.
pub fn settings_are_remembered(display: &Display) -> Outcome {
    let text = std::fs::read_to_string(display.settings()).map_err(|e| e.to_string())?;
    ensure(text.contains("style = \"hillshade\"") && text.contains("window = [760, 540]"), || text.clone())?;
    let window = display.open(&["--exit-after-frames", "3"])?;
    let (code, words, heard) = window.end()?;
    ensure(code == Some(0), || format!("{code:?}: {words}"))?;
    let has = |line: &str| heard.iter().any(|l| l == line);
    ensure(has("style hillshade") && has("size 760x540"), || format!("{heard:?}"))
}

/// A driver in software begins coarser and says so; what was set once stays, and is nothing to be said.
pub fn tolerance_suits_the_adapter(display: &Display) -> Outcome {
    let settings = display.settings();
    let heard = |arguments: &[&str]| -> Result<[bool; 3], String> {
        let all = [&["--exit-after-frames", "3"], arguments].concat();
        let (code, words, heard) = display.open(&all)?.end()?;
        ensure(code == Some(0), || format!("{code:?}: {words}"))?;
        let has = |beginning: &str| heard.iter().any(|line| line.starts_with(beginning));
        Ok([has("tolerance 4 px"), has("tolerance 1 px"), has("news Drawn in software")])
    };
    // The tour may not have come before.
    let _ = std::fs::remove_file(&settings);
    let software = display.software;
    for time in ["first", "second"] {
        let seen = heard(&[])?;
        ensure(seen == [software, !software, software], || format!("{time} time: {seen:?}"))?;
    }
    for (arguments, what) in [(&["--tolerance-px", "1"][..], "asked for"), (&[], "remembered")] {
        let seen = heard(arguments)?;
        ensure(seen == [false, true, false], || format!("{what}: {seen:?}"))?;
    }
    std::fs::remove_file(&settings).map_err(|e| e.to_string())
}

/// A window that was larger than this screen is not begun beyond it.
pub fn window_within_the_screen(display: &Display) -> Outcome {
    let settings = display.settings();
    std::fs::create_dir_all(settings.parent().unwrap()).map_err(|e| e.to_string())?;
    for (scale, size) in [("1", "size 1177x736"), ("2", "size 1176x736")] {
        std::fs::write(&settings, "window = [2000, 1500]").map_err(|e| e.to_string())?;
        let mut window = display.open_scaled(&["--exit-after-frames", "2"], scale)?;
        window.hear(size)?;
        window.end()?;
    }
    std::fs::remove_file(&settings).map_err(|e| e.to_string())
}

/// Elevation data is built and shown, a flight is taken, and what is neither is told.
pub fn dropped_files(display: &Display) -> Outcome {
    let folder = display.folder.path();
    // This file says how far apart its samples are. Where one does not, a metre is taken, and ground so steep takes a processor half a minute to draw.
    let input = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/crater_lake_1025.bt");
    std::fs::copy(input, folder.join("dropped.bt")).map_err(|e| e.to_string())?;
    std::fs::write(folder.join("bad.flight"), "no flight").map_err(|e| e.to_string())?;
    std::fs::write(folder.join("bad.iqt"), "no terrain").map_err(|e| e.to_string())?;
    let dropped = ["--drop", "bad.flight", "--drop", "bad.iqt", "--drop", "dropped.bt"];
    let mut window = display.open(&dropped)?;
    for file in ["bad.flight", "bad.iqt"] {
        let words = window.hear("trouble ")?;
        ensure(words.contains(file), || words.clone())?;
    }
    let built = window.hear("built ")?;
    ensure(built.ends_with("dropped.iqt") && folder.join("dropped.iqt").exists(), || built.clone())?;
    window.hear("opened ")?;
    window.rest()?;
    window.focus()?;
    window.key("ctrl+q")?;
    let (code, words, _) = window.end()?;
    ensure(code == Some(0), || format!("it ended with {code:?}: {words}"))
}
