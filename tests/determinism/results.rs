//! Results and their digests.

use super::Digest;
use std::path::{Path, PathBuf};
use terrasoar::edits::rain::Rain;
use terrasoar::flight::FlightFrame;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround, generate};
use terrasoar::ground::{Ground, PictureEngine};
use terrasoar::refine::Culling;
use terrasoar::view::Viewport;
use terrasoar::{Area, Brush, Edit, MappedTerrain, StreamOptions, Terrain, View};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{HorizontalUnit, MemoryDem, SampleType};
use terrasoar_layout::edit::{BrushAction, Crest, Falloff, Limit, Line, Stamp, StampMode};
use terrasoar_layout::mix::Random;
use terrasoar_layout::progress::Silent;

const SIDE: u32 = 257;
const SPACING_M: [f64; 2] = [30.0, 27.3];

/// Hills of parabolas and grain: arithmetic alone.
fn height_m(x: u32, y: u32) -> f64 {
    let bump = |at: u32, wide: u32| {
        let t = f64::from(at % wide) / f64::from(wide);
        4.0 * t * (1.0 - t)
    };
    let grain = f64::from(x.wrapping_mul(2_654_435_761).wrapping_add(y.wrapping_mul(40_503)) >> 28);
    400.0 + 250.0 * bump(x, 97) * bump(y, 71) + 60.0 * bump(x + y, 41) + 0.5 * grain
}

fn built(folder: &Path, name: &str, of: SampleType) -> PathBuf {
    let path = folder.join(name);
    let dem = MemoryDem::from_fn([SIDE, SIDE], of, |x, y| {
        // Two corners leave room for what edits dig and heap up.
        let height = match [x, y] {
            [0, 0] => 0.0,
            [256, 256] => 1200.0,
            _ => height_m(x, y),
        };
        if of.is_integer() { height.round() } else { height }
    });
    build(&dem, &path, &BuildOptions::default().spacing_m(SPACING_M), &Silent).unwrap();
    path
}

fn digest_of_file(path: &Path) -> String {
    let mut digest = Digest::new();
    digest.bytes(&std::fs::read(path).unwrap());
    digest.hex()
}

/// Heights at places between samples.
fn heights(ground: &Ground<'_>, digest: &mut Digest) {
    let mut chance = Random::new(7);
    let [east_m, north_m] = ground.extent_m();
    for _ in 0..5000 {
        let found = ground.height_at(chance.unit() * east_m, chance.unit() * north_m);
        digest.number(found.height_m.unwrap());
        digest.bytes(&[u8::from(found.is_exact)]);
    }
}

fn rays(ground: &Ground<'_>, digest: &mut Digest) {
    let mut chance = Random::new(8);
    let [east_m, north_m] = ground.extent_m();
    let mut hits = 0;
    for _ in 0..500 {
        let from_m = [chance.unit() * east_m, chance.unit() * north_m, 800.0];
        let direction = [chance.unit() - 0.5, chance.unit() - 0.5, -0.3 * chance.unit()];
        if let Some(hit) = ground.ray_hit(from_m, direction, 20_000.0) {
            hits += 1;
            hit.place_m.iter().chain([&hit.distance_m]).for_each(|number| digest.number(*number));
        }
    }
    assert!(hits > 300, "{hits} rays hit");
}

/// A flight with turns and a roll, by arithmetic.
fn views() -> Vec<View> {
    (0..40)
        .map(|i| {
            let t = f64::from(i);
            let frame = FlightFrame {
                time_s: t / 30.0,
                eye_m: [1500.0 + 90.0 * t, 900.0 + 60.0 * t, 900.0 - 5.0 * t],
                yaw_deg: 20.0 + 3.7 * t,
                pitch_deg: -25.0 + 0.3 * t,
                roll_deg: 0.5 * t,
                vertical_fov_deg: 45.0,
            };
            frame.view(Viewport { width_px: 640, height_px: 480 }, 1.5)
        })
        .collect()
}

/// The triangles of the mesh, each with its corners from the least, in order.
fn triangles(ground: &Ground<'_>, digest: &mut Digest) -> usize {
    let mut all: Vec<[[u64; 3]; 3]> = Vec::new();
    ground.for_each_triangle(&mut |corners| {
        let mut bits = corners.map(|corner| corner.to_array().map(f64::to_bits));
        let least = (0..3).min_by_key(|i| bits[*i]).unwrap();
        bits.rotate_left(least);
        all.push(bits);
    });
    all.sort_unstable();
    all.iter().flatten().flatten().for_each(|bits| digest.bytes(&bits.to_le_bytes()));
    all.len()
}

fn flown(ground: &mut Ground<'_>) -> String {
    let mut digest = Digest::new();
    let mut drawn = 0;
    for view in views() {
        ground.update(&view);
        while ground.is_waiting() {
            std::thread::sleep(std::time::Duration::from_millis(1));
            ground.update(&view);
        }
        drawn += triangles(ground, &mut digest);
    }
    assert!(drawn > 10_000, "{drawn} triangles");
    digest.hex()
}

/// What differs, all of it at once.
fn same(made: &[(&str, String)], golden: &[&str]) {
    let golden: Vec<_> =
        made.iter().zip(golden).map(|((name, _), digest)| (*name, (*digest).to_owned())).collect();
    assert_eq!(made, golden, "this machine makes something else than others do");
}

#[test]
fn built_files() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, fractions] = [("i16.iqt", SampleType::I16), ("f32.iqt", SampleType::F32)]
        .map(|(name, of)| digest_of_file(&built(folder.path(), name, of)));
    // Degrees, whose length depends on a sine.
    let path = folder.path().join("degrees.iqt");
    let mut dem = MemoryDem::from_fn([129, 97], SampleType::F32, height_m);
    let reference = &mut dem.info_mut().georeference;
    reference.unit = HorizontalUnit::Degree;
    reference.pixel_to_crs = Some([7.1, 1.0 / 3600.0, 0.0, 46.7, 0.0, -1.0 / 3600.0]);
    build(&dem, &path, &BuildOptions::default(), &Silent).unwrap();
    let made = [("whole metres", whole), ("fractions", fractions), ("degrees", digest_of_file(&path))];
    same(&made, &["a988203673c6e5cb", "13874784a5f92e11", "f70fa5b312c18a7e"]);
}

/// Edits of every kind at crooked places.
fn edits() -> Vec<Edit> {
    let brush = |action, centre_m, falloff| Edit::Brush(Brush { action, centre_m, radius_m: 333.3, falloff });
    let stamp: Vec<f64> = (0..30).map(|i| 0.7 * f64::from(i)).collect();
    let rain = Rain {
        count: 25,
        seed: 3,
        extent_m: [500.0, 500.0, 7000.0, 6500.0],
        radius_m: [30.0, 250.0],
        depth_ratio: [0.1, 0.3],
        batch: 25,
    };
    let others = [
        brush(BrushAction::Raise(17.3), [2000.1, 3000.7], Falloff::Smooth),
        brush(BrushAction::Lower(9.1), [2300.1, 3100.7], Falloff::Linear),
        brush(BrushAction::Flatten { height_m: None, strength: 0.7 }, [4000.1, 3050.7], Falloff::Smooth),
        Edit::Set { area: Area::Disc { centre_m: [5000.5, 2000.5], radius_m: 222.2 }, height_m: 431.7 },
        Edit::Stamp(Stamp::new([100, 120], [6, 5], stamp, StampMode::Add).unwrap()),
        Edit::Restore(Area::Disc { centre_m: [3000.5, 2500.5], radius_m: 400.0 }),
    ];
    rain.craters().map(Edit::Crater).chain(others).collect()
}

#[test]
fn edits_heights_and_rays() {
    let folder = tempfile::tempdir().unwrap();
    let mut made = Vec::new();
    for (name, of) in [("i16", SampleType::I16), ("f32", SampleType::F32)] {
        let path = built(folder.path(), name, of);
        let mut ground = Terrain::open(&path).unwrap().stream(StreamOptions::default()).unwrap();
        ground.update(&views()[0]);
        ground.edit(&edits()).unwrap();
        ground.commit("all kinds").unwrap().wait().unwrap();
        drop(ground);
        let terrain = MappedTerrain::open(&path).unwrap();
        let mut ground = terrain.ground(PictureEngine::Kinetic, Culling::Vertices).unwrap();
        ground.update(&views()[0]);
        let mut digest = Digest::new();
        heights(&ground, &mut digest);
        rays(&ground, &mut digest);
        made.extend([("heights and rays", digest.hex()), ("the mesh", flown(&mut ground))]);
    }
    same(&made, &["841e737b0130caa3", "c596b88328c164a7", "bc52ef5e7cf41c73", "deec36f0d7032eb5"]);
}

/// Lines and limits, which came after the edits above: those keep their digests.
#[test]
fn dams_ditches_and_limits() {
    let folder = tempfile::tempdir().unwrap();
    let path = built(folder.path(), "f32.iqt", SampleType::F32);
    let mut ground = Terrain::open(&path).unwrap().stream(StreamOptions::default()).unwrap();
    ground.update(&views()[0]);
    let line = |crest, path_m: &[[f64; 2]]| {
        Edit::Line(Line { path_m: path_m.to_vec(), crest, width_m: 61.7, slope: 0.37 })
    };
    let level = Crest::Level { height_m: 611.3, limit: Some(Limit::AtLeast), sides_m: 150.0 };
    let area = Area::Disc { centre_m: [5200.3, 4100.9], radius_m: 333.3 };
    ground
        .edit(&[
            line(level, &[[700.3, 900.1], [2500.7, 1800.9], [4100.1, 1500.3]]),
            line(Crest::Above(23.7), &[[900.3, 4900.1], [3700.9, 5100.7]]),
            line(Crest::Below(11.9), &[[4300.3, 2900.1], [4700.9, 6100.7]]),
            Edit::Limit { area, height_m: 590.1, limit: Limit::AtMost },
        ])
        .unwrap();
    ground.commit("lines").unwrap().wait().unwrap();
    drop(ground);
    let terrain = MappedTerrain::open(&path).unwrap();
    let ground = terrain.ground(PictureEngine::Kinetic, Culling::Vertices).unwrap();
    let mut digest = Digest::new();
    heights(&ground, &mut digest);
    same(&[("heights", digest.hex())], &["97c8c483372c78b8"]);
}

#[test]
fn meshes_of_all_engines() {
    let folder = tempfile::tempdir().unwrap();
    let path = built(folder.path(), "land.iqt", SampleType::F32);
    let terrain = MappedTerrain::open(&path).unwrap();
    let mut made = Vec::new();
    for (name, engine) in [("kinetic", PictureEngine::Kinetic), ("soar", PictureEngine::Soar)] {
        let mut ground = terrain.ground(engine, Culling::Vertices).unwrap();
        made.push((name, flown(&mut ground)));
    }
    let mut ground = Terrain::open(&path).unwrap().stream(StreamOptions::default()).unwrap();
    made.push(("streamed", flown(&mut ground)));
    same(&made, &["446771b26d207468"; 3]);
}

#[test]
fn flights() {
    let folder = tempfile::tempdir().unwrap();
    let path = built(folder.path(), "land.iqt", SampleType::F32);
    let terrain = Terrain::open(&path).unwrap();
    let mut digest = Digest::new();
    for kind in FlightKind::ALL {
        let plan = FlightPlan::new(kind, 200, 37.5).turn_rate_deg_per_frame(1.3);
        let flight = generate(&TerrainGround::new(terrain.file()), &plan).unwrap();
        digest.bytes(&flight.write_to(Vec::new(), Path::new("flight")).unwrap());
    }
    same(&[("flights", digest.hex())], &["a99590ff8f8ebb1a"]);
}

#[test]
fn made_up_terrain() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("synth.tif");
    let options = terrasoar_import::synth::SynthOptions::default().size(257).seed(5);
    terrasoar_import::synth::write(&options, &path, &|_| {}).unwrap();
    same(&[("made-up terrain", digest_of_file(&path))], &["71278a896a195f3d"]);
}
