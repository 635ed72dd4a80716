//! Heights in steps that were asked for, against arithmetic: whole multiples, no farther from a sample than half a step.

mod common;

use common::{MemoryDem, build_bytes, open_bytes};
use proptest::prelude::*;
use terrasoar_layout::build::{BuildOptions, compact_step_m};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::packing::unpack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;
use terrasoar_layout::with_records;
use terrasoar_layout::{LayoutError, Remedy};

/// Hills of some metres that no step divides, with holes.
fn ground(size: [u32; 2], sample_type: SampleType, tall: f64) -> MemoryDem {
    MemoryDem::from_fn(size, sample_type, |x, y| {
        if (x / 5 + 2 * (y / 7)) % 11 == 1 {
            return f64::NAN;
        }
        let (u, v) = (f64::from(x), f64::from(y));
        let height = tall * (0.5 + 0.3 * (u * 0.21).sin() + 0.2 * (v * 0.13 + u * 0.02).cos());
        match sample_type {
            SampleType::F32 => f64::from(height as f32),
            SampleType::F64 => height,
            _ => height.round(),
        }
    })
}

/// Every sample in metres, and the height that the file has there.
fn pairs(dem: &MemoryDem, terrain: &Terrain, z_scale: f64) -> Vec<(f64, Option<f64>)> {
    let [wide, high] = terrain.grid().samples();
    let places = (0..high).flat_map(|y| (0..wide).map(move |x| (x, y)));
    places
        .map(|(x, y)| {
            let vertex =
                with_records!(terrain.records().unwrap(), records => records.vertex_at(GridPoint::new(x, y)));
            (dem.sample(x, y) * z_scale, (!vertex.class.is_void()).then_some(vertex.height_m))
        })
        .collect()
}

fn assert_in_steps(dem: &MemoryDem, terrain: &Terrain, z_scale: f64, step_m: f64) {
    let header = terrain.header();
    assert_eq!((header.record_kind, header.scale.height_step_m), (RecordKind::Compact, step_m));
    for (sample_m, height_m) in pairs(dem, terrain, z_scale) {
        let Some(height_m) = height_m else {
            assert!(sample_m.is_nan());
            continue;
        };
        let last_bits = 1e-12 * sample_m.abs().max(1.0);
        assert!((height_m - sample_m).abs() <= step_m / 2.0 + last_bits, "{sample_m} {height_m}");
        let steps = height_m / step_m;
        assert!((steps - steps.round()).abs() < 1e-6, "{height_m} is no multiple of {step_m}");
        let [low, high] = header.height_range_m;
        assert!(low <= height_m + last_bits && height_m <= high + last_bits);
    }
    assert!(verify(terrain, &|_| {}).unwrap().is_sound());
}

#[test]
fn every_height_is_the_nearest_multiple() {
    for sample_type in [SampleType::F32, SampleType::F64, SampleType::I16] {
        for (step_m, z_scale) in
            [(0.01, 1.0), (0.37, 1.0), (0.25, -1.0), (0.002, 0.1), (7.0, 1.0), (3.0, -0.5)]
        {
            let dem = ground([70, 53], sample_type, 90.0);
            for head_room in [true, false] {
                let options =
                    BuildOptions::default().height_step_m(step_m).z_scale(z_scale).head_room(head_room);
                let terrain = open_bytes(build_bytes(&dem, &options).unwrap()).unwrap();
                assert_in_steps(&dem, &terrain, z_scale, step_m);
            }
        }
    }
}

/// Where samples are whole multiples, heights are the samples, and the file says so.
#[test]
fn steps_that_samples_have_round_nothing() {
    let dem = ground([40, 33], SampleType::I16, 900.0);
    let own = build_bytes(&dem, &BuildOptions::default()).unwrap();
    assert!(own == build_bytes(&dem, &BuildOptions::default().height_step_m(1.0)).unwrap());
    for (step_m, rounds) in [(0.5, false), (0.125, false), (2.0, true), (0.3, true)] {
        let bytes = build_bytes(&dem, &BuildOptions::default().height_step_m(step_m)).unwrap();
        let terrain = open_bytes(bytes).unwrap();
        assert_eq!(terrain.header().heights_rounded, rounds, "{step_m}");
        assert_in_steps(&dem, &terrain, 1.0, step_m);
        let same =
            pairs(&dem, &terrain, 1.0).iter().all(|(sample, height)| height.is_none_or(|h| h == *sample));
        assert_eq!(same, !rounds, "{step_m}");
    }
}

#[test]
fn steps_that_do_not_fit_are_refused_with_the_smallest_that_does() {
    let dem = ground([40, 33], SampleType::F32, 8000.0);
    let refused = |options: BuildOptions| {
        let error = build_bytes(&dem, &options).unwrap_err();
        assert_eq!(error.remedy(), Some(Remedy::HeightStep));
        error.to_string()
    };
    for step_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let said = refused(BuildOptions::default().height_step_m(step_m));
        assert!(said.contains("above 0"), "{said}");
    }
    let said = refused(BuildOptions::default().height_step_m(0.5).record(RecordKind::Exact8));
    assert!(said.contains("exact records"), "{said}");
    let mut smallest = Vec::new();
    for head_room in [true, false] {
        for step_m in [0.001, 1e-9, 1e-300] {
            let options = BuildOptions::default().head_room(head_room);
            let said = refused(options.clone().height_step_m(step_m));
            let (_, named) = said.rsplit_once(" is ").unwrap();
            let named: f64 = named.trim_end_matches(" m").parse().unwrap();
            let terrain = open_bytes(build_bytes(&dem, &options.height_step_m(named)).unwrap()).unwrap();
            assert_in_steps(&dem, &terrain, 1.0, named);
            smallest.push(named);
        }
    }
    // Room for edits takes a fifth of the steps.
    assert!(smallest[0] > smallest[3] * 1.1 && smallest[0] < smallest[3] * 1.4, "{smallest:?}");
    // What a build tells beforehand is the same.
    let exact = open_bytes(build_bytes(&dem, &BuildOptions::default()).unwrap()).unwrap();
    assert_eq!(compact_step_m(exact.header()), Some(smallest[0]));
}

#[test]
fn flat_ground_takes_any_step() {
    let dem = MemoryDem::from_fn([9, 9], SampleType::F64, |_, _| 1_234.567_89);
    for step_m in [1e-4, 1.0, 1e6] {
        let options = BuildOptions::default().height_step_m(step_m);
        let terrain = open_bytes(build_bytes(&dem, &options).unwrap()).unwrap();
        assert_in_steps(&dem, &terrain, 1.0, step_m);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_step_rounds_or_is_refused(
        wide in 2u32..40, high in 2u32..40, tall in 0.1f64..20_000.0, step in -6.0f64..3.0, turned: bool, double: bool,
    ) {
        let step_m = 10f64.powf(step);
        let sample_type = if double { SampleType::F64 } else { SampleType::F32 };
        let (dem, z_scale) = (ground([wide, high], sample_type, tall), if turned { -1.0 } else { 1.0 });
        let options = BuildOptions::default().height_step_m(step_m).z_scale(z_scale);
        match build_bytes(&dem, &options) {
            Ok(bytes) => assert_in_steps(&dem, &open_bytes(bytes).unwrap(), z_scale, step_m),
            Err(error) => prop_assert!(matches!(error.remedy(), Some(Remedy::HeightStep)) || error.to_string().contains("no heights"), "{}", error),
        }
    }
}

/// Packed, edited below the lowest and above the highest height, and unpacked.
#[test]
fn rounded_terrain_is_packed_and_edited() -> Result<(), LayoutError> {
    let folder = tempfile::tempdir().unwrap();
    let [packed, back] = ["packed.iqt", "back.iqt"].map(|name| folder.path().join(name));
    let dem = ground([150, 90], SampleType::F32, 50.0);
    let options = BuildOptions::default().height_step_m(0.01).spacing_m([20.0; 2]);
    terrasoar_layout::build::build(&dem, &packed, &options.clone().packed(true), &Silent)?;
    unpack(&SystemDisk, &packed, &back, &Silent)?;
    assert!(std::fs::read(&back).unwrap() == build_bytes(&dem, &options)?);
    let mut session = EditSession::open(&packed)?;
    for (i, height_m) in [(0u32, -30.004), (1, 80.006)] {
        let rect = SampleRect { west: 10 + 40 * i, south: 20, east: 30 + 40 * i, north: 44 };
        session.apply(&[Edit::Set { area: Area::Rect(rect), height_m }])?;
    }
    session.commit("dug and raised")?;
    drop(session);
    let terrain = Terrain::open_unmapped(&packed)?;
    for (place, height_m) in [([400.0, 480.0], -30.0), ([1200.0, 480.0], 80.01)] {
        let found = terrain.height_m(place[0], place[1])?.unwrap();
        assert!((found - height_m).abs() < 1e-9, "{found}");
    }
    assert!(verify(&terrain, &|_| {})?.is_sound());
    Ok(())
}

/// A lake, or the one sample that is no void: there is no range of heights to make a step of.
#[test]
fn heights_that_are_all_the_same_are_rounded_too() {
    for (height, z_scale) in [(79.940_750_215_718_85, 1.0), (-200_165.413_348_907_6, 1.0), (3e-7, -0.5)] {
        let flat = MemoryDem::from_fn([9, 6], SampleType::F64, |x, _| if x < 3 { f64::NAN } else { height });
        for record in [RecordKind::Compact, RecordKind::Fine] {
            let options = BuildOptions::default().spacing_m([10.0; 2]).record(Some(record)).z_scale(z_scale);
            let terrain = open_bytes(build_bytes(&flat, &options).unwrap()).unwrap();
            assert_eq!(terrain.header().record_kind, record);
            assert!(terrain.header().scale.height_step_m > 0.001);
            for (sample_m, height_m) in pairs(&flat, &terrain, z_scale) {
                assert_eq!(height_m.is_none(), sample_m.is_nan());
                assert!(height_m.is_none_or(|height_m| (height_m - sample_m).abs() < 1e-9));
            }
            assert!(verify(&terrain, &|_| {}).unwrap().is_sound());
        }
    }
}
