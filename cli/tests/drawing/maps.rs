//! Maps that other programs place, views in other systems, and contour lines of any width.

use super::support::{Bench, text};
use super::{Outcome, Test, ensure};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::progress::Silent;
use terrasoar_render::Gpu;

pub const TESTS: &[Test] = &[
    ("maps::a_part_of_the_ground_is_a_map_with_its_place", part),
    ("maps::an_eye_is_given_in_any_system_and_refused_where_it_sees_nothing", eye),
    ("maps::wide_lines_are_not_fewer_than_thin_ones", lines),
];

/// 201 x 101 samples 10 m apart from 500000,5000000 on in EPSG:32632: a plateau in the north-east quarter.
fn terrain(bench: &Bench, height: impl Fn(u32, u32) -> f64 + Sync + 'static) {
    let mut dem = MemoryDem::from_fn([201, 101], SampleType::F32, height);
    dem.info_mut().georeference.pixel_to_crs = Some([500_000.0, 10.0, 0.0, 5_001_000.0, 0.0, -10.0]);
    dem.info_mut().georeference.epsg = Some(32632);
    build(&dem, &bench.path("g.iqt"), &BuildOptions::default(), &Silent).unwrap();
}

fn part(_: &Gpu) -> Outcome {
    let bench = Bench::new();
    terrain(&bench, |x, y| if x >= 100 && y >= 50 { 300.0 } else { 0.0 });
    let map = [
        "snapshot",
        "g.iqt",
        "-o",
        "m.png",
        "--ortho",
        "--size",
        "400x400",
        "--ramp",
        "grey",
        "--ramp-range",
        "0,300",
    ];
    let window =
        ["--window", "500500,5000250,501500,5000750", "--crs", "dem", "--sun", "0,90", "--dpi", "254"];
    let told = bench.json(&[&map[..], &window, &["--world-file", "--json"]].concat());
    ensure(told["size_px"] == serde_json::json!([400, 200]), || format!("{told}"))?;
    ensure(
        told["metres_per_px"] == 2.5 && told["scale"].as_f64().is_some_and(|n| (n - 25_000.0).abs() < 1e-6),
        || format!("{told}"),
    )?;
    let beside: Vec<&str> =
        told["beside"].as_array().unwrap().iter().filter_map(|name| name.as_str()).collect();
    ensure(beside == ["m.pgw", "m.prj", "m.png.aux.xml"], || format!("{beside:?}"))?;
    let world = std::fs::read_to_string(bench.path("m.pgw")).unwrap();
    let lines: Vec<f64> = world.lines().map(|line| line.parse().unwrap()).collect();
    ensure(lines == [2.5, 0.0, 0.0, -2.5, 500_501.25, 5_000_748.75], || world)?;
    let system = std::fs::read_to_string(bench.path("m.prj")).unwrap();
    ensure(system.contains("UTM zone 32N"), || system)?;
    let bytes = std::fs::read(bench.path("m.png")).unwrap();
    // 254 dots an inch are 10,000 a metre.
    let dense = [&b"pHYs"[..], &10_000u32.to_be_bytes(), &10_000u32.to_be_bytes(), &[1]].concat();
    ensure(bytes.windows(dense.len()).any(|window| window == dense), || "no pHYs".into())?;
    let seen = image::load_from_memory(&bytes).unwrap().to_rgb8();
    // The wall lies at 1000 m east, 500 m north: in the picture's middle.
    for (x, y, is_high) in
        [(20, 20, false), (380, 20, true), (20, 180, false), (380, 180, false), (210, 90, true)]
    {
        let pixel = seen.get_pixel(x, y).0;
        ensure((pixel[0] > 150) == is_high, || format!("{x},{y}: {pixel:?}"))?;
    }
    // Again, over its own; and not over what somebody else made.
    bench.good(&[&map[..], &window, &["--world-file"]].concat());
    std::fs::write(bench.path("n.prj"), "mine").unwrap();
    let said = bench.bad(1, &["snapshot", "g.iqt", "--ortho", "--world-file", "-o", "n.png"]);
    ensure(said.contains("n.prj") && said.contains("--force"), || said)?;
    let human = bench.good(&[&map[..], &window].concat());
    ensure(human.contains("1:25,000 in print"), || human)?;
    let said = bench.bad(1, &[&map[..], &["--window", "0,0,1,1", "--crs", "dem"]].concat());
    ensure(said.contains("outside the terrain"), || said)?;
    let said = bench.bad(2, &[&map[..], &["--crs", "dem"]].concat());
    ensure(said.contains("--window"), || said)
}

fn eye(_: &Gpu) -> Outcome {
    let bench = Bench::new();
    terrain(&bench, |x, y| f64::from(x + y));
    let view = |at: &str, crs: &[&str], name: &str| {
        let size = ["--size", "160x120", "--look", "20,-30", "-o", name];
        bench.run(&[&["snapshot", "g.iqt", "--at", at][..], &size, crs].concat())
    };
    for (at, crs, name) in [
        ("300,200,900", &[][..], "a.png"),
        ("500300,5000200,900", &["--crs", "dem"], "b.png"),
        ("500300,5000200,900", &["--crs", "EPSG:32632"], "c.png"),
    ] {
        let output = view(at, crs, name);
        ensure(output.status.success() && output.stderr.is_empty(), || text(&output.stderr))?;
    }
    let [a, b, c] = ["a.png", "b.png", "c.png"].map(|name| std::fs::read(bench.path(name)).unwrap());
    ensure(a == b && a == c, || "the same eye, another picture".into())?;
    // Forgotten --crs: the terrain is 5,000 km away, hidden by the air.
    let said = bench.bad(1, &["snapshot", "g.iqt", "--at", "500300,5000200,900", "-o", "d.png"]);
    ensure(said.contains("nothing of the terrain is seen") && said.contains("--crs dem"), || said)?;
    let said = bench.bad(1, &["snapshot", "g.iqt", "--at", "150000,500,300", "-o", "d.png"]);
    ensure(said.contains("the air hides") && said.contains("--haze off"), || said)?;
    ensure(!bench.path("d.png").exists(), || "a picture of nothing".into())?;
    bench.good(&["snapshot", "g.iqt", "--at", "150000,500,300", "--haze", "off", "-o", "d.png"]);
    Ok(())
}

/// A slope whose lines lie so many pixels apart; how dark the picture is gets no less with wider lines.
fn lines(_: &Gpu) -> Outcome {
    let bench = Bench::new();
    // Ten metres of height every ten metres: lines of 20 m lie 20 m apart.
    terrain(&bench, |x, _| 10.0 * f64::from(x));
    for size in ["800x400", "400x200"] {
        let drawn = |more: &[&str]| {
            let args = [
                "snapshot", "g.iqt", "--ortho", "--size", size, "--style", "contours", "--ramp", "grey",
                "-o", "l.png", "--force",
            ];
            bench.good(&[&args[..], more].concat());
            image::load_from_memory(&std::fs::read(bench.path("l.png")).unwrap()).unwrap().to_rgb8()
        };
        // Against a picture whose lines lie beyond the ground.
        let bare = drawn(&["--contours", "100000"]);
        let mut before = 0;
        for width in ["1", "2", "3", "6"] {
            let seen = drawn(&["--contours", "20", "--contour-width", width]);
            let changed =
                seen.pixels().zip(bare.pixels()).filter(|(a, b)| a.0[0].abs_diff(b.0[0]) > 4).count();
            ensure(changed > 0 && changed >= before, || {
                format!("{size}, {width} px: {changed} after {before}")
            })?;
            before = changed;
        }
    }
    Ok(())
}
