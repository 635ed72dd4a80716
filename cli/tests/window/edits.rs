//! The ground changed by hand: what is seen, what is on the disk, and back again.

use super::driver::{Display, Window};
use super::{Outcome, ensure};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use terrasoar_layout::build::{BuildOptions, HeightRoom, build, rebuild};
use terrasoar_layout::edit::{EditSession, history};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::imagery::{DrapeOptions, ImageSource, MemoryImage, TileFormat, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// A copy of the terrain with room for other heights.
fn copy(display: &Display, name: &str) -> Result<std::path::PathBuf, String> {
    let path = display.folder.path().join(name);
    let terrain = Terrain::open(&display.folder.path().join("puget.iqt")).map_err(|e| e.to_string())?;
    let [low, high] = terrain.header().height_range_m;
    let room = HeightRoom { lowest_m: low - 30_000.0, highest_m: high + 30_000.0 };
    rebuild(&SystemDisk, &terrain, &path, Some(room), 512, &Silent).map_err(|e| e.to_string())?;
    Ok(path)
}

/// Keeps a picture and reads it.
fn picture(window: &mut Window<'_>) -> Result<image::RgbImage, String> {
    window.key("p")?;
    let path = window.hear("picture ")?;
    Ok(image::open(path).map_err(|e| e.to_string())?.to_rgb8())
}

/// Pixels that differ.
fn differing(a: &image::RgbImage, b: &image::RgbImage) -> usize {
    a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count()
}

/// Lets craters rain until some are saved, then quits: it ends well and had no trouble.
fn rain_and_quit(mut window: Window<'_>) -> Outcome {
    window.key("k")?;
    window.hear("raining true")?;
    window.hear("saved")?;
    window.key("k")?;
    window.hear("raining false")?;
    window.key("ctrl+q")?;
    let (code, words, heard) = window.end()?;
    ensure(code == Some(0), || format!("it ended with {code:?}: {words}"))?;
    ensure(!heard.iter().any(|line| line.starts_with("trouble")), || format!("{heard:?}"))
}

pub fn ground_changed_by_hand(display: &Display) -> Outcome {
    let path = copy(display, "edited.iqt")?;
    let original = std::fs::read(&path).map_err(|e| e.to_string())?;
    let mut window = display.open_file("edited.iqt", &["--size", "800x600", "--style", "relief"], "1")?;
    window.rest()?;
    let id = window.focus()?;
    window.xdotool(&["mousemove", "--window", &id, "560", "330"])?;
    let before = picture(&mut window)?;

    window.key("b")?;
    window.hear("tool crater")?;
    for _ in 0..8 {
        window.key("bracketright")?;
    }
    window.xdotool(&["click", "1"])?;
    window.hear_all(&["saved", "at-rest"])?;
    let cratered = picture(&mut window)?;
    let seen = differing(&before, &cratered);
    ensure(seen > 200, || format!("a crater is seen: {seen} pixels differ"))?;

    window.key("b")?;
    window.hear("tool raise")?;
    window.xdotool(&["mousedown", "1"])?;
    for _ in 0..6 {
        window.xdotool(&["mousemove_relative", "--", "15", "6"])?;
    }
    window.xdotool(&["mouseup", "1"])?;
    window.hear_all(&["saved", "at-rest"])?;
    let raised = picture(&mut window)?;
    let seen = differing(&cratered, &raised);
    ensure(seen > 200, || format!("a wall is seen: {seen} pixels differ; {:?}", window.heard()))?;

    window.key("ctrl+z")?;
    window.hear_all(&["undone", "at-rest"])?;
    let undone = picture(&mut window)?;
    ensure(differing(&cratered, &undone) == 0, || "the wall is gone to the last pixel".into())?;
    window.key("ctrl+z")?;
    window.hear_all(&["undone", "at-rest"])?;
    let nothing = picture(&mut window)?;
    let left = differing(&before, &nothing);
    ensure(left == 0, || format!("the crater is gone to the last pixel, but for {left}"))?;
    window.key("ctrl+z")?;
    window.hear("news There is nothing to undo")?;
    window.key("ctrl+y")?;
    window.hear_all(&["redone", "at-rest"])?;
    let redone = picture(&mut window)?;
    ensure(differing(&cratered, &redone) == 0, || "it is back to the last pixel".into())?;

    rain_and_quit(window)?;

    // What was told as saved is in the file, and can be taken back from elsewhere.
    let terrain = Terrain::open(&path).map_err(|e| e.to_string())?;
    let report = verify(&terrain, &|_| {}).map_err(|e| e.to_string())?;
    ensure(report.is_sound(), || format!("{:?}", report.problems))?;
    let told = history(&terrain).map_err(|e| e.to_string())?;
    ensure(told.len() >= 2 && told[0].label == "crater", || format!("{told:?}"))?;
    drop(terrain);
    let mut session = EditSession::open(&path).map_err(|e| e.to_string())?;
    while session.undo().map_err(|e| e.to_string())?.is_some() {}
    drop(session);
    same_pages(&path, &original)
}

/// Takes pictures until one is as it should be, and as the two before it.
fn picture_that(
    window: &mut Window<'_>,
    what: &str,
    is_as_it_should: impl Fn(&image::RgbImage) -> bool,
) -> Result<image::RgbImage, String> {
    let mut alike = 0;
    let mut before: Option<image::RgbImage> = None;
    for _ in 0..40 {
        window.key("p")?;
        let path = window.hear("picture ")?;
        let now = image::open(path).map_err(|e| e.to_string())?.to_rgb8();
        alike = if before.as_ref() == Some(&now) { alike + 1 } else { 0 };
        if alike >= 2 && is_as_it_should(&now) {
            return Ok(now);
        }
        before = Some(now);
    }
    Err(format!("{what}, but not in any of 40 pictures"))
}

/// Pixels that are much darker.
fn darker(before: &image::RgbImage, after: &image::RgbImage) -> usize {
    let light = |p: &image::Rgb<u8>| p.0.iter().map(|c| u32::from(*c)).sum::<u32>();
    before.pixels().zip(after.pixels()).filter(|(a, b)| 6 * light(b) < 5 * light(a)).count()
}

/// A crater scorches the picture on the ground, and an undo takes both back.
pub fn ground_and_picture_changed_by_hand(display: &Display) -> Outcome {
    let path = copy(display, "draped.iqt")?;
    let picture_of_land = MemoryImage::from_fn([4096, 4096], |x, y| {
        let grain = ((x * 7 + y * 13) % 32) as u8;
        [150 + grain, 160 + grain, 110 + (x / 64 % 2 * 40) as u8, 255]
    });
    let pictures: Vec<Box<dyn ImageSource>> = vec![Box::new(picture_of_land)];
    let options = DrapeOptions::default().format(TileFormat::Bc1);
    drape(&path, &pictures, &options, &Silent).map_err(|e| e.to_string())?;
    let imagery =
        || -> Result<_, String> { Ok(Terrain::open(&path).map_err(|e| e.to_string())?.header().imagery) };
    let original = imagery()?;
    let mut window = display.open_file("draped.iqt", &["--size", "800x600", "--style", "photo"], "1")?;
    window.rest()?;
    let id = window.focus()?;
    window.xdotool(&["mousemove", "--window", &id, "560", "330"])?;
    let before = picture_that(&mut window, "it comes to rest", |_| true)?;
    window.key("b")?;
    window.hear("tool crater")?;
    for _ in 0..11 {
        window.key("bracketright")?;
    }
    window.xdotool(&["click", "1"])?;
    window.hear("saved")?;
    let is_burnt = |now: &image::RgbImage| darker(&before, now) > 200;
    let cratered = picture_that(&mut window, "a scorch is seen", is_burnt)?;
    ensure(imagery()? != original, || "the scorch is in the file".into())?;
    window.key("ctrl+z")?;
    window.hear("undone")?;
    picture_that(&mut window, "ground and picture are back to the last pixel", |now| *now == before)?;
    window.key("ctrl+y")?;
    window.hear("redone")?;
    picture_that(&mut window, "the scorch is back to the last pixel", |now| *now == cratered)?;
    rain_and_quit(window)?;
    let terrain = Terrain::open(&path).map_err(|e| e.to_string())?;
    let report = verify(&terrain, &|_| {}).map_err(|e| e.to_string())?;
    ensure(report.is_sound(), || format!("{:?}", report.problems))?;
    drop(terrain);
    let mut session = EditSession::open(&path).map_err(|e| e.to_string())?;
    while session.undo().map_err(|e| e.to_string())?.is_some() {}
    drop(session);
    ensure(imagery()? == original, || "the picture is the old one again".into())
}

/// Whether the ground is that of another file, page by page.
fn same_pages(path: &Path, original: &[u8]) -> Outcome {
    let open = |bytes: Vec<u8>| {
        Terrain::from_source(Box::new(terrasoar_layout::file::source::MemorySource::new("original", bytes)))
    };
    let now = Terrain::open(path).map_err(|e| e.to_string())?;
    let then = open(original.to_vec()).map_err(|e| e.to_string())?;
    for page in 0..now.header().record_pages() {
        let [now, then] = [&now, &then].map(|terrain| terrain.checked_page(page).map_err(|e| e.to_string()));
        ensure(now? == then?, || format!("page {page} is another"))?;
    }
    Ok(())
}

/// Another program edits the file: the window says so, shows it, and changes nothing.
pub fn edits_of_a_file_that_is_taken(display: &Display) -> Outcome {
    let path = Arc::new(copy(display, "taken.iqt")?);
    let session = EditSession::open(&path).map_err(|e| e.to_string())?;
    let mut window = display.open_file("taken.iqt", &["--size", "640x480"], "1")?;
    window.rest()?;
    let id = window.focus()?;
    window.xdotool(&["mousemove", "--window", &id, "450", "260"])?;
    window.key("b")?;
    window.hear("tool crater")?;
    window.xdotool(&["click", "1"])?;
    let words = window.hear("trouble ")?;
    ensure(words.contains("another program is writing"), || words.clone())?;
    drop(session);
    window.xdotool(&["click", "1"])?;
    window.hear("saved")?;
    window.key("ctrl+q")?;
    let (code, words, _) = window.end()?;
    ensure(code == Some(0), || format!("it ended with {code:?}: {words}"))
}

/// A terrain whose records hold its own heights only: the window makes room for a crater while it goes on, what is ordered meanwhile follows, and a window that is closed meanwhile,
/// or asked to end by a signal, loses nothing.
pub fn edits_without_room(display: &Display) -> Outcome {
    let input = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/puget_sound_1025.png");
    let dem = terrasoar_import::open(&[input.into()]).map_err(|e| e.to_string())?;
    let options = BuildOptions::default().spacing_m([160.0; 2]).z_scale(0.1).head_room(false);
    let path = display.folder.path().join("tight.iqt");
    let history_of = || -> Result<_, String> {
        history(&Terrain::open(&path).map_err(|e| e.to_string())?).map_err(|e| e.to_string())
    };
    for ends in ["at leisure", "at once", "by a signal"] {
        build(&*dem, &path, &options, &Silent).map_err(|e| e.to_string())?;
        let before = Terrain::open_unmapped(&path).map_err(|e| e.to_string())?;
        let mut window = display.open_file("tight.iqt", &["--size", "800x600", "--style", "relief"], "1")?;
        window.rest()?;
        let id = window.focus()?;
        window.xdotool(&["mousemove", "--window", &id, "560", "330"])?;
        let intact = picture(&mut window)?;
        window.key("b")?;
        window.hear("tool crater")?;
        for _ in 0..12 {
            window.key("bracketright")?;
        }
        window.xdotool(&["click", "1"])?;
        if ends != "at leisure" {
            window.hear("widening")?;
        } else {
            window.hear_all(&["widening", "widened", "saved", "at-rest"])?;
            let is_dug = |now: &image::RgbImage| differing(&intact, now) > 200;
            let cratered = picture_that(&mut window, "a crater is seen", is_dug)?;
            window.key("ctrl+z")?;
            window.hear("undone")?;
            // The records round errors in another scale, by which a few triangles are others than before.
            picture_that(&mut window, "the crater is gone", |now| differing(&cratered, now) > 200)?;
            window.key("ctrl+y")?;
            window.hear("redone")?;
            picture_that(&mut window, "the crater is back to the last pixel", |now| *now == cratered)?;
        }
        match ends {
            "by a signal" => window.signal("-TERM")?,
            _ => window.key("ctrl+q")?,
        }
        let (code, words, heard) = window.end()?;
        let wanted = if ends == "by a signal" { None } else { Some(0) };
        ensure(code == wanted, || format!("{ends} it ended with {code:?}: {words}"))?;
        ensure(!heard.iter().any(|line| line.starts_with("trouble")), || format!("{heard:?}"))?;
        let told = history_of()?;
        ensure(told.len() == 1 && told[0].label == "crater", || format!("{told:?}"))?;
        let terrain = Terrain::open(&path).map_err(|e| e.to_string())?;
        let report = verify(&terrain, &|_| {}).map_err(|e| e.to_string())?;
        ensure(report.is_sound(), || format!("{:?}", report.problems))?;
        let lowest_m = [&before, &terrain].map(|terrain| terrain.header().height_range_m[0]);
        ensure(lowest_m[1] < lowest_m[0], || format!("dug from {} to {} m", lowest_m[0], lowest_m[1]))?;
    }
    Ok(())
}

/// A session that ends while the button is still down: what was done of the ground is saved.
pub fn signals_save_what_is_held(display: &Display) -> Outcome {
    for signal in ["-TERM", "-HUP"] {
        let path = copy(display, "held.iqt")?;
        let mut window = display.open_file("held.iqt", &["--size", "640x480"], "1")?;
        window.rest()?;
        let id = window.focus()?;
        window.xdotool(&["mousemove", "--window", &id, "450", "260"])?;
        window.key("b")?;
        window.key("b")?;
        window.hear("tool raise")?;
        window.xdotool(&["mousedown", "1"])?;
        for _ in 0..6 {
            window.xdotool(&["mousemove_relative", "--", "15", "6"])?;
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
        window.signal(signal)?;
        let (code, words, heard) = window.end()?;
        ensure(code.is_none(), || format!("{signal}: it ended with {code:?}: {words}"))?;
        ensure(!heard.iter().any(|line| line.starts_with("trouble")), || format!("{heard:?}"))?;
        let told = history(&Terrain::open(&path).map_err(|e| e.to_string())?).map_err(|e| e.to_string())?;
        ensure(told.len() == 1 && told[0].label == "raise", || format!("{signal}: {told:?}"))?;
        let mut up = display.in_display(Command::new("xdotool"));
        up.args(["mouseup", "1"]).status().map_err(|e| e.to_string())?;
    }
    Ok(())
}
