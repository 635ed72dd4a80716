//! Flags of `snapshot` and `movie` that say how a picture is taken: maps from above, haze, ramps, eyes below the ground, the flight's own time.

use super::support::{Bench, text};
use super::{Outcome, Test, ensure};
use terrasoar_render::Gpu;

pub const TESTS: &[Test] = &[
    ("looks::a_map_from_above_ends_where_the_ground_ends", map),
    ("looks::flat_ground_has_no_snow_unless_stretched", ramps),
    ("looks::flags_of_haze_and_lines_change_the_picture", flags),
    ("looks::an_eye_below_the_ground_is_refused_or_raised", below),
    ("looks::movies_follow_the_flights_time", time),
    ("looks::a_picture_too_large_says_the_limit", too_large),
];

fn picture(bench: &Bench, name: &str) -> image::RgbImage {
    image::load_from_memory(&std::fs::read(bench.path(name)).unwrap()).unwrap().to_rgb8()
}

/// A terrain of 65 x 33 samples, 10 m apart, as text.
fn terrain(bench: &Bench, height: impl Fn(u32, u32) -> f64) {
    let rows: Vec<String> = (0..33)
        .map(|row| (0..65).map(|x| height(x, 32 - row).to_string()).collect::<Vec<_>>().join(" "))
        .collect();
    let head = "ncols 65\nnrows 33\nxllcorner 0\nyllcorner 0\ncellsize 10\n";
    std::fs::write(bench.path("g.asc"), format!("{head}{}\n", rows.join("\n"))).unwrap();
    bench.good(&["build", "g.asc", "-o", "g.iqt", "--force"]);
}

fn map(_: &Gpu) -> Outcome {
    let bench = Bench::new();
    // A plateau in the south-west quarter, 300 m above the rest.
    terrain(&bench, |x, y| if x < 32 && y < 16 { 300.0 } else { 0.0 });
    let snapshot = ["snapshot", "g.iqt", "-o", "m.png", "--ortho", "--size", "640x640", "--json"];
    let plain = ["--ramp", "grey", "--ramp-range", "0,300", "--sun", "0,90"];
    let told = bench.json(&[&snapshot[..], &plain].concat());
    ensure(told["size_px"] == serde_json::json!([640, 320]), || format!("{told}"))?;
    ensure(told["metres_per_px"] == 1.0 && told["ramp_range_m"][1] == 300.0, || format!("{told}"))?;
    let seen = picture(&bench, "m.png");
    let is_high = |x: u32, y: u32| seen.get_pixel(x, y).0[0] > 150;
    // Straight down: a wall of 300 m shows in the cell that it falls in, 310 to 320 east or 150 to 160 north, and in its neighbours by their slopes.
    for y in 0..320 {
        for x in 0..640 {
            let (east, north) = (f64::from(x) + 0.5, 319.5 - f64::from(y));
            if (east < 295.0 && north < 135.0) || east > 335.0 || north > 175.0 {
                let expected = east < 295.0 && north < 135.0;
                ensure(is_high(x, y) == expected, || format!("{east},{north}: {:?}", seen.get_pixel(x, y)))?;
            }
            // The sky is blue, the ramp grey.
            let [r, _, b] = seen.get_pixel(x, y).0.map(i32::from);
            ensure((b - r).abs() < 25, || format!("sky at {x},{y}"))?;
        }
    }
    let refused = bench.bad(2, &[&snapshot[..], &["--at", "1,2,3"]].concat());
    ensure(refused.contains("--ortho"), || refused)
}

fn ramps(_: &Gpu) -> Outcome {
    let bench = Bench::new();
    terrain(&bench, |x, _| 50.0 * f64::from(x) / 64.0);
    let brightest = |more: &[&str]| {
        let args =
            ["snapshot", "g.iqt", "-o", "m.png", "--ortho", "--size", "64x64", "--sun", "0,90", "--force"];
        bench.good(&[&args[..], more].concat());
        // The highest ground is in the east. Snow is as blue as it is red.
        picture(&bench, "m.png").get_pixel(62, 16).0.map(i32::from)
    };
    let [r, g, b] = brightest(&[]);
    ensure(g > b + 20 && g > r, || format!("meadow at 50 m, not {:?}", [r, g, b]))?;
    for more in [&["--ramp-range", "stretch"][..], &["--ramp-range", "0,50"]] {
        let [r, g, b] = brightest(more);
        ensure((r - b).abs() < 20 && (g - b).abs() < 20, || {
            format!("snow when stretched, not {:?}", [r, g, b])
        })?;
    }
    Ok(())
}

fn flags(_: &Gpu) -> Outcome {
    let bench = Bench::with_terrain();
    let mut before: Vec<Vec<u8>> = Vec::new();
    for more in [
        &[][..],
        &["--haze", "off"],
        &["--haze", "800"],
        &["--contours", "20"],
        &["--contours", "20", "--contour-width", "4"],
    ] {
        let args =
            ["snapshot", "land.iqt", "-o", "a.png", "--at", "-500,-500,700", "--size", "160x120", "--force"];
        bench.good(&[&args[..], more].concat());
        let seen = picture(&bench, "a.png").into_raw();
        ensure(!before.contains(&seen), || format!("{more:?} changes nothing"))?;
        before.push(seen);
    }
    let refused = bench.bad(2, &["snapshot", "land.iqt", "-o", "b.png", "--contour-width", "2"]);
    ensure(refused.contains("--contours"), || refused)?;
    for wrong in [["--haze", "0"], ["--haze", "thick"], ["--ramp-range", "5,5"], ["--ramp-range", "9"]] {
        bench.bad(2, &[&["snapshot", "land.iqt", "-o", "b.png"][..], &wrong].concat());
    }
    Ok(())
}

fn below(_: &Gpu) -> Outcome {
    let bench = Bench::new();
    terrain(&bench, |_, _| 100.0);
    let at = |up: &str| {
        ["snapshot", "g.iqt", "-o", "a.png", "--size", "64x48", "--force", "--at"]
            .map(str::to_owned)
            .into_iter()
            .chain([format!("300,100,{up}")])
            .collect::<Vec<_>>()
    };
    let run = |args: Vec<String>| bench.run(&args.iter().map(String::as_str).collect::<Vec<_>>());
    let refused = text(&run(at("92.5")).stderr);
    ensure(
        refused.contains(
            "is 7.5 m below the ground, which is 100 m high there; give it a height of 101 or more",
        ),
        || refused,
    )?;
    ensure(run(at("101")).status.success(), || "the height that was named does not do".into())?;
    let away = bench
        .bad(1, &["snapshot", "g.iqt", "-o", "a.png", "--at", "9000,100,300", "--look", "90,0", "--force"]);
    ensure(away.contains("which extends from 0,0 to 640,320 metres"), || away)?;
    let frames =
        "terrasoar-flight 1\nunits metres degrees seconds\n0 300 100 50 0 0 0 45\n1 300 100 120 0 0 0 45\n";
    std::fs::write(bench.path("f.flight"), frames).unwrap();
    let flown =
        ["snapshot", "g.iqt", "-o", "b.png", "--size", "64x48", "--flight", "f.flight", "--frame", "0"];
    let output = bench.run(&flown);
    ensure(text(&output.stderr).contains("it was raised by 51 m"), || text(&output.stderr))?;
    bench.good(&[
        "snapshot",
        "g.iqt",
        "-o",
        "c.png",
        "--size",
        "64x48",
        "--at",
        "300,100,101",
        "--look",
        "0,0",
    ]);
    ensure(picture(&bench, "b.png") == picture(&bench, "c.png"), || "raised it sees something else".into())?;
    let movie =
        bench.run(&["movie", "g.iqt", "--flight", "f.flight", "-o", "m", "--size", "64x48", "--fps", "4"]);
    ensure(text(&movie.stderr).contains("in 3 of 5 pictures the eye is below"), || text(&movie.stderr))
}

fn time(_: &Gpu) -> Outcome {
    let bench = Bench::new();
    terrain(&bench, |x, y| f64::from((x * 3) ^ (y * 5)));
    // Two seconds in three frames, unevenly.
    let frames = "terrasoar-flight 1\nunits metres degrees seconds\n0 0 100 300 90 -30 0 45\n0.5 100 100 300 90 -30 0 45\n2 400 100 300 90 -30 0 45\n";
    std::fs::write(bench.path("f.flight"), frames).unwrap();
    let movie = ["movie", "g.iqt", "--flight", "f.flight", "--size", "64x48", "--json"];
    let told = bench.json(&[&movie[..], &["-o", "m", "--fps", "4"]].concat());
    ensure(told["frames"] == 9 && told["seconds"] == 2.25, || format!("{told}"))?;
    // Picture 5 is at 1.25 s, half the way from the second frame to the third.
    bench.good(&[
        "snapshot",
        "g.iqt",
        "-o",
        "s.png",
        "--size",
        "64x48",
        "--at",
        "250,100,300",
        "--look",
        "90,-30",
    ]);
    ensure(picture(&bench, "m/frame-00005.png") == picture(&bench, "s.png"), || {
        "the eye is elsewhere".into()
    })?;
    let told = bench.json(&[&movie[..], &["-o", "n", "--fps", "4", "--every", "2"]].concat());
    ensure(told["frames"] == 2, || format!("{told}"))?;
    ensure(picture(&bench, "n/frame-00001.png") == picture(&bench, "m/frame-00008.png"), || {
        "not the last frame".into()
    })
}

fn too_large(_: &Gpu) -> Outcome {
    let bench = Bench::with_terrain();
    let refused = bench.bad(1, &["snapshot", "land.iqt", "-o", "a.png", "--size", "65536x64"]);
    ensure(refused.contains("a picture of 65536 x 64 pixels") && refused.contains("pixels a side"), || {
        refused
    })
}
