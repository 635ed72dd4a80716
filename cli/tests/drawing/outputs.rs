//! What `snapshot` and `movie` may replace, and what they leave when a signal ends them.

use super::support::Bench;
use super::{Outcome, Test, ensure};
use std::fs;
use terrasoar_render::Gpu;

pub const TESTS: &[Test] = &[
    ("outputs::pictures_replace_pictures_of_ours_alone", replace),
    ("outputs::a_folder_of_pictures_is_replaced_when_that_is_asked_for", folder),
    ("outputs::names_need_not_be_unicode", names),
    #[cfg(unix)]
    ("outputs::a_killed_picture_or_movie_leaves_nothing", killed),
];

const SNAPSHOT: [&str; 6] = ["snapshot", "land.iqt", "--size", "80x60", "-o", "a.png"];
const MOVIE: [&str; 10] =
    ["movie", "land.iqt", "--flight", "land.flight", "--size", "80x60", "--every", "20", "-o", "a.gif"];

fn replace(_: &Gpu) -> Outcome {
    let bench = Bench::with_flight();
    let read = |name: &str| fs::read(bench.path(name)).unwrap();
    image::ImageBuffer::<image::Luma<u16>, _>::new(9, 9).save(bench.path("dem.png")).unwrap();
    image::RgbImage::new(80, 60).save(bench.path("photo.png")).unwrap();
    bench.good(&["synth", "--size", "33", "--seed", "1", "-o", "synth.png"]);
    fs::write(bench.path("notes"), "dear diary").unwrap();
    for (args, out) in [(&SNAPSHOT[..], "a.png"), (&MOVIE, "a.gif")] {
        let treasures = [
            ("dem.png", "a PNG of 16-bit grey"),
            ("synth.png", "a PNG of 16-bit grey"),
            ("photo.png", "a PNG picture"),
            ("land.tif", "a TIFF file"),
            ("land.flight", "a flight"),
            ("land.iqt", "a terrain file"),
            ("notes", "a text file"),
        ];
        for (treasure, called) in treasures {
            fs::copy(bench.path(treasure), bench.path(out)).unwrap();
            let said = bench.bad(1, args);
            let is_told =
                said.contains("this would replace") && said.contains(called) && said.contains("--force");
            ensure(is_told, || format!("{out} over {treasure}: {said}"))?;
            ensure(read(out) == read(treasure), || format!("{treasure} is lost"))?;
        }
        bench.good(&[args, &["--force"]].concat());
        let made = read(out);
        bench.good(args);
        ensure(read(out) == made, || format!("{out} does not repeat"))?;
        fs::remove_file(bench.path(out)).unwrap();
    }
    // An input stays one by whatever name.
    #[cfg(unix)]
    {
        fs::hard_link(bench.path("land.flight"), bench.path("b.gif")).unwrap();
        let said = bench.bad(1, &[&MOVIE[..8], &["-o", "b.gif", "--force"]].concat());
        ensure(said.contains("the output is the input"), || said)?;
    }
    Ok(())
}

fn folder(_: &Gpu) -> Outcome {
    let bench = Bench::with_flight();
    let movie = |every: &str, force: &[&str]| {
        [&MOVIE[..7], &[every, "-o", "frames"], force]
            .concat()
            .iter()
            .map(|s| (*s).to_owned())
            .collect::<Vec<_>>()
    };
    let run = |args: Vec<String>| bench.run(&args.iter().map(String::as_str).collect::<Vec<_>>());
    let names = || {
        let entries = fs::read_dir(bench.path("frames")).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    ensure(run(movie("10", &[])).status.success(), || "no movie".into())?;
    ensure(names().len() == 4, || format!("{:?}", names()))?;
    fs::write(bench.path("frames/notes.txt"), "mine").unwrap();
    ensure(run(movie("20", &[])).status.code() == Some(1), || "pictures were mixed".into())?;
    ensure(names().len() == 5, || format!("{:?}", names()))?;
    ensure(run(movie("20", &["--force"])).status.success(), || "not replaced".into())?;
    ensure(names() == ["frame-00000.png", "frame-00001.png", "notes.txt"], || format!("{:?}", names()))?;
    // A picture of somebody else with such a name stays.
    image::RgbImage::new(9, 9).save(bench.path("frames/frame-00002.png")).unwrap();
    ensure(run(movie("20", &["--force"])).status.success(), || "not replaced".into())?;
    ensure(names().len() == 4, || format!("{:?}", names()))
}

fn names(_: &Gpu) -> Outcome {
    #[cfg(target_os = "linux")]
    {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        let bench = Bench::with_flight();
        for (args, name) in
            [(&SNAPSHOT[..5], &b"\xff.png"[..]), (&MOVIE[..9], b"\xff.gif"), (&MOVIE[..9], b"\xff")]
        {
            let name = OsStr::from_bytes(name);
            let output = bench.command(args).arg(name).arg("--json").output().unwrap();
            ensure(output.status.success(), || String::from_utf8_lossy(&output.stderr).into_owned())?;
            ensure(bench.folder().join(name).exists(), || format!("{name:?} is not there"))?;
        }
    }
    Ok(())
}

#[cfg(unix)]
fn killed(_: &Gpu) -> Outcome {
    use super::killed::check;
    let bench = Bench::with_flight();
    let picture = ["--flight", "land.flight", "--frame", "39"];
    check(&bench, &[&SNAPSHOT[..], &picture].concat(), true, &|bench| {
        let _ = fs::remove_file(bench.path("a.png"));
    });
    check(&bench, &MOVIE, true, &|bench| {
        let _ = fs::remove_file(bench.path("a.gif"));
    });
    check(&bench, &[&MOVIE[..8], &["-o", "new/frames"]].concat(), true, &|bench| {
        let _ = fs::remove_dir_all(bench.path("new"));
    });
    Ok(())
}
