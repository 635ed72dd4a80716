//! The verbs `snapshot` and `movie` of the real program.

use super::support::{Bench, fields, text};
use super::{Outcome, Test, ensure};
use terrasoar_render::{Gpu, LOOKS};

pub const TESTS: &[Test] = &[
    ("program::a_snapshot_repeats", snapshot_repeats),
    ("program::every_style_draws", every_style),
    ("program::an_image_lies_where_it_belongs", draped),
    ("program::movies_repeat_and_leave_nothing_else", movies),
    ("program::a_film_needs_ffmpeg", film),
    ("program::compare_has_a_picture", report),
    ("program::nothing_is_said_on_standard_error", quiet),
];

/// Width and height of a PNG file.
fn png_size(bytes: &[u8]) -> Option<[u32; 2]> {
    let picture = image::load_from_memory(bytes).ok()?;
    Some([picture.width(), picture.height()])
}

fn read(bench: &Bench, name: &str) -> Vec<u8> {
    std::fs::read(bench.path(name)).unwrap()
}

/// An image of four quarters, seen from above.
fn draped(_: &Gpu) -> Outcome {
    let bench = Bench::with_terrain();
    std::fs::copy(bench.path("land.iqt"), bench.path("bare.iqt")).unwrap();
    const QUARTERS: [[u8; 3]; 4] = [[220, 30, 30], [30, 200, 30], [40, 40, 220], [210, 200, 30]];
    let quarter = |x: u32, y: u32| QUARTERS[(2 * (y / 32) + x / 32) as usize];
    image::RgbImage::from_fn(64, 64, |x, y| image::Rgb(quarter(x, y)))
        .save(bench.path("quarters.png"))
        .unwrap();
    bench.good(&["drape", "land.iqt", "--image", "quarters.png"]);
    let shoot = |terrain: &str, name: &str, more: &[&str]| {
        let from_above =
            ["--at", "1280,1280,9000", "--look", "0,-90", "--fov", "18", "--size", "240x240", "--json"];
        bench.json(&[&["snapshot", terrain, "-o", name][..], &from_above, more].concat())
    };
    let told = shoot("land.iqt", "a.png", &[]);
    ensure(told["style"] == "photo", || format!("{told}"))?;
    let picture = image::load_from_memory(&read(&bench, "a.png")).unwrap().to_rgb8();
    for (i, colour) in QUARTERS.into_iter().enumerate() {
        let seen = picture.get_pixel(80 + 80 * (i as u32 % 2), 80 + 80 * (i as u32 / 2)).0;
        // Light and haze change how bright it is, hardly which colour.
        let strongest = |c: [u8; 3]| {
            [0, 1, 2].map(|k| c[k] >= 100 && c[k].saturating_add(40) >= *c.iter().max().unwrap())
        };
        ensure(strongest(seen) == strongest(colour), || {
            format!("quarter {i} is {seen:?}, not about {colour:?}")
        })?;
    }
    shoot("land.iqt", "off.png", &["--image", "0"]);
    shoot("bare.iqt", "bare.png", &["--style", "photo"]);
    ensure(read(&bench, "off.png") == read(&bench, "bare.png"), || {
        "an image of which nothing shows shows".into()
    })?;
    ensure(read(&bench, "off.png") != read(&bench, "a.png"), || "an image that shows does not".into())?;
    shoot("land.iqt", "again.png", &[]);
    ensure(read(&bench, "again.png") == read(&bench, "a.png"), || "it does not repeat".into())?;
    // A terrain without an image goes as before.
    ensure(shoot("bare.iqt", "plain.png", &[])["style"] == "relief", || "the style is another".into())
}

fn snapshot_repeats(_: &Gpu) -> Outcome {
    let bench = Bench::with_flight();
    let frame = ["--flight", "land.flight", "--frame", "25", "--size", "200x150"];
    let snapshot = |name: &str, more: &[&str]| {
        bench.json(&[&["snapshot", "land.iqt", "-o", name, "--json"][..], &frame, more].concat())
    };
    let told = snapshot("a.png", &[]);
    let names = [
        "output",
        "size_px",
        "style",
        "ramp",
        "ramp_range_m",
        "frame",
        "eye_m",
        "raised_m",
        "metres_per_px",
        "scale",
        "beside",
        "yaw_deg",
        "pitch_deg",
        "vertical_fov_deg",
        "tolerance_px",
        "metric",
        "exaggeration",
        "engine",
        "triangles",
        "adapter",
        "backend",
    ];
    let mut sorted = names;
    sorted.sort_unstable();
    let mut said = fields(&told);
    said.sort_unstable();
    ensure(said == sorted, || format!("{told}"))?;
    snapshot("b.png", &[]);
    snapshot("soar.png", &["--engine", "soar"]);
    let a = read(&bench, "a.png");
    ensure(png_size(&a) == Some([200, 150]), || "the size is another".into())?;
    for other in ["b.png", "soar.png"] {
        ensure(a == read(&bench, other), || format!("{other} is another picture"))?;
    }
    let said = bench.good(&["snapshot", "land.iqt", "-o", "all.png", "--size", "160x120"]);
    ensure(said.starts_with("all.png: 160 x 120 pixels, "), || said)?;
    bench.good(&["snapshot", "land.iqt", "-o", "at.png", "--at", "-500,200,900", "--size", "160x120"]);
    bench.bad(1, &["snapshot", "land.iqt", "-o", "c.png", "--flight", "land.flight", "--frame", "40"]);
    let expected = ["a.png", "all.png", "at.png", "b.png", "land.flight", "land.iqt", "land.tif", "soar.png"];
    ensure(bench.names() == expected, || format!("{:?}", bench.names()))
}

fn every_style(_: &Gpu) -> Outcome {
    let bench = Bench::with_terrain();
    let mut pictures: Vec<(String, Vec<u8>)> = Vec::new();
    let mut keep = |name: &str, more: &[&str]| -> Outcome {
        bench.good(&[&["snapshot", "land.iqt", "-o", "a.png", "--size", "160x120"][..], more].concat());
        let picture = read(&bench, "a.png");
        let like = pictures.iter().find(|(_, p)| *p == picture).map(|(n, _)| n.clone());
        ensure(like.is_none(), || format!("{name} looks as {}", like.unwrap_or_default()))?;
        pictures.push((name.to_owned(), picture));
        Ok(())
    };
    for (style, _) in LOOKS {
        keep(style, &["--style", style])?;
    }
    keep("another ramp", &["--ramp", "mars"])?;
    keep("another sun", &["--sun", "90,10"])?;
    keep("lines", &["--contours", "20"])?;
    keep("exaggerated", &["--exaggeration", "2"])?;
    let near = ["--at", "1280,-200,900", "--tolerance-px", "6", "--style", "wireframe"];
    keep("coarse", &near)?;
    keep("at rest", &[&near[..], &["--morph", "off"]].concat())
}

fn movies(_: &Gpu) -> Outcome {
    let bench = Bench::with_flight();
    let movie = |out: &str| {
        let size = ["--size", "120x90", "--every", "10", "--fps", "10"];
        bench.good(&[&["movie", "land.iqt", "--flight", "land.flight", "-o", out][..], &size].concat())
    };
    for (a, b) in [("a.gif", "b.gif"), ("a", "b")] {
        let said = movie(a);
        ensure(said.contains(": 4 pictures of 120 x 90 pixels"), || said)?;
        movie(b);
    }
    ensure(read(&bench, "a.gif") == read(&bench, "b.gif"), || "two GIFs differ".into())?;
    for i in 0..4 {
        let [a, b] = ["a", "b"].map(|folder| read(&bench, &format!("{folder}/frame-{i:05}.png")));
        ensure(a == b && png_size(&a) == Some([120, 90]), || format!("frame {i} differs"))?;
        let frame = (10 * i).to_string();
        let args = ["--flight", "land.flight", "--frame", &frame, "--size", "120x90"];
        bench.good(&[&["snapshot", "land.iqt", "-o", "s.png"][..], &args].concat());
        ensure(a == read(&bench, "s.png"), || format!("frame {i} is not the snapshot's"))?;
    }
    let again = bench.bad(1, &["movie", "land.iqt", "--flight", "land.flight", "-o", "a"]);
    ensure(again.contains("not empty"), || again)?;
    let expected = ["a", "a.gif", "b", "b.gif", "land.flight", "land.iqt", "land.tif", "s.png"];
    ensure(bench.names() == expected, || format!("{:?}", bench.names()))
}

/// Without an ffmpeg it says what to install and leaves nothing; with one that works the film is there.
fn film(_: &Gpu) -> Outcome {
    let bench = Bench::with_flight();
    let args =
        ["movie", "land.iqt", "--flight", "land.flight", "-o", "a.mp4", "--size", "121x90", "--every", "20"];
    let output = bench.command(&args).env("PATH", bench.folder()).output().unwrap();
    let said = text(&output.stderr);
    ensure(output.status.code() == Some(1) && said.contains("apt install ffmpeg"), || said)?;
    ensure(!bench.path("a.mp4").exists(), || "something was left".into())?;
    if std::process::Command::new("ffmpeg").arg("-version").output().is_ok() {
        bench.good(&args);
        let film = read(&bench, "a.mp4");
        ensure(film.get(4..8) == Some(b"ftyp"), || "no film".into())?;
    }
    Ok(())
}

fn report(_: &Gpu) -> Outcome {
    let bench = Bench::with_flight();
    let args =
        ["compare", "land.iqt", "--flight", "land.flight", "--no-sweeps", "--viewport", "160x120", "-o", "r"];
    bench.good(&args);
    ensure(png_size(&read(&bench, "r/flight.png")) == Some([160, 120]), || "no picture".into())?;
    let page = text(&read(&bench, "r/report.html"));
    ensure(page.contains("<img src=\"flight.png\"") && page.contains("Frame 20 of 40"), || page)
}

/// Whatever the variable is that drivers complain about.
fn quiet(_: &Gpu) -> Outcome {
    let bench = Bench::with_flight();
    let snapshot = ["snapshot", "land.iqt", "-o", "a b.png", "--size", "64x48"];
    let movie = [
        "movie",
        "land.iqt",
        "--flight",
        "land.flight",
        "-o",
        "film.gif",
        "--size",
        "64x48",
        "--every",
        "20",
    ];
    let compare = [
        "compare",
        "land.iqt",
        "--flight",
        "land.flight",
        "--engines",
        "soar",
        "--no-sweeps",
        "-o",
        "report",
    ];
    for verb in [&snapshot[..], &movie, &compare] {
        for folder in [None, Some(""), Some("not/absolute"), Some("/no/such/folder")] {
            let mut command = bench.command(verb);
            if let Some(folder) = folder {
                command.env("XDG_RUNTIME_DIR", folder);
            }
            let output = command.output().map_err(|e| e.to_string())?;
            let words = text(&output.stderr);
            ensure(output.status.success() && words.is_empty(), || format!("{verb:?} {folder:?}: {words}"))?;
            ensure(!output.stdout.is_empty(), || "it says what it did".into())?;
        }
    }
    ensure(bench.path("a b.png").exists(), || "words with spaces stay one".into())?;
    // What goes wrong is said once, with its exit code.
    bench.bad(1, &["snapshot", "none.iqt", "-o", "b.png"]);
    bench.bad(2, &["movie", "land.iqt", "--flight", "land.flight", "-o", "film.doc"]);
    Ok(())
}
