//! Holes filled by a build, against brute force: which regions by a flood, which heights by sweeping over Laplace's equation until nothing moves.

use proptest::prelude::*;
use std::collections::BTreeSet;
use terrasoar_layout::build::{BuildOptions, MAX_FILL, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// The grid with its holes of at most `most` samples across filled, unrounded; which samples those are.
fn filled(size: [usize; 2], samples: &[f64], most: usize) -> (Vec<f64>, BTreeSet<usize>, usize) {
    let [wide, high] = size;
    let around = |i: usize| {
        let (x, y) = ((i % wide) as i64, (i / wide) as i64);
        [(1, 0), (-1, 0), (0, 1), (0, -1)]
            .map(|(dx, dy)| (x + dx, y + dy))
            .into_iter()
            .filter(|(x, y)| (0..wide as i64).contains(x) && (0..high as i64).contains(y))
            .map(|(x, y)| y as usize * wide + x as usize)
            .collect::<Vec<_>>()
    };
    let mut all = samples.to_vec();
    let (mut changed, mut holes) = (BTreeSet::new(), 0);
    for start in 0..samples.len() {
        if !samples[start].is_nan() || changed.contains(&start) {
            continue;
        }
        let mut region = BTreeSet::from([start]);
        let mut waiting = vec![start];
        while let Some(i) = waiting.pop() {
            waiting.extend(around(i).into_iter().filter(|n| samples[*n].is_nan() && region.insert(*n)));
        }
        let side = |of: &dyn Fn(usize) -> usize| {
            region.iter().map(|i| of(*i)).max().unwrap() - region.iter().map(|i| of(*i)).min().unwrap() + 1
        };
        if side(&|i| i % wide) > most || side(&|i| i / wide) > most {
            continue;
        }
        holes += 1;
        region.iter().for_each(|i| all[*i] = 0.0);
        for _ in 0..3000 {
            for i in &region {
                let near = around(*i);
                all[*i] = near.iter().map(|n| all[*n]).sum::<f64>() / near.len() as f64;
            }
        }
        changed.extend(region);
    }
    (all, changed, holes)
}

fn heights(terrain: &Terrain) -> Vec<f64> {
    let [wide, high] = terrain.grid().samples();
    let places = (0..high).flat_map(|y| (0..wide).map(move |x| (f64::from(x), f64::from(y))));
    places.map(|(x, y)| terrain.height_m(x, y).unwrap().unwrap_or(f64::NAN)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn small_holes_are_filled_and_nothing_else_changes(
        size in prop::array::uniform2(4..22u32),
        most in 1..9u32,
        share in 5..70u32,
        seed in any::<u32>(),
        kind in prop::sample::select(vec![(SampleType::I16, 1.0), (SampleType::F32, 0.1), (SampleType::F64, 0.0)]),
    ) {
        let (sample_type, step) = kind;
        let chance = |x: u32, y: u32, salt: u32| {
            let mixed = (x ^ seed).wrapping_mul(0x9e37_79b1) ^ y.wrapping_add(salt).wrapping_mul(0x85eb_ca6b);
            (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d) >> 8
        };
        let raw = |x: u32, y: u32| {
            // The corner is never void, so that there are heights.
            let is_void = (x, y) != (0, 0) && chance(x, y, 1) % 100 < share;
            let height = f64::from(chance(x, y, 7) % 20_000);
            match (is_void, sample_type) {
                (true, _) => f64::NAN,
                (_, SampleType::I16) => (height / 10.0).round() - 900.0,
                (_, SampleType::F32) => f64::from((height / 10.0) as f32),
                _ => height / 7.0,
            }
        };
        let dem = MemoryDem::from_fn(size, sample_type, raw);
        let source: Vec<f64> = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| raw(x, y))).collect();
        let (expected, changed, holes) = filled(size.map(|side| side as usize), &source, most as usize);
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str, threads: usize, most: u32| {
            let path = folder.path().join(name);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = BuildOptions::default().spacing_m([1.0, 1.0]).fill_voids(most);
            pool.install(|| build(&dem, &path, &options, &Silent)).unwrap();
            (std::fs::read(&path).unwrap(), Terrain::open(&path).unwrap())
        };
        let (plain, terrain) = make("plain.iqt", 2, 0);
        let kind_before = terrain.header().record_kind;
        let (bytes, terrain) = make("one.iqt", 1, most);
        prop_assert!(make("four.iqt", 4, most).0 == bytes, "threads change nothing");
        prop_assert_eq!(terrain.header().record_kind, kind_before);
        let voids = source.iter().filter(|v| v.is_nan()).count();
        prop_assert_eq!(terrain.header().nodata_samples as usize, voids - changed.len());
        let said = terrain.header().about.origins.iter().find(|(what, _)| what == "voids").map(|(_, words)| words.clone());
        if voids == 0 {
            prop_assert!(bytes == plain && said.is_none());
        } else {
            let words = format!("{} of {voids} void samples were filled, {holes} holes of up to {most} x {most}", changed.len());
            prop_assert!(said.as_ref().is_some_and(|said| said.starts_with(&words)), "{said:?} {words}");
        }
        for (i, (is, was)) in heights(&terrain).into_iter().zip(source).enumerate() {
            if changed.contains(&i) {
                prop_assert!((is - expected[i]).abs() <= 0.5 * step + 1e-3, "{i}: {is}, not {}", expected[i]);
            } else {
                prop_assert!(is.is_nan() == was.is_nan() && (is.is_nan() || (is - was).abs() < 1e-3), "{i}: {is} {was}");
            }
        }
    }
}

#[test]
fn holes_too_large_to_be_filled_are_refused_as_a_wish() {
    let dem = MemoryDem::from_fn([4, 4], SampleType::I16, |_, _| 1.0);
    let folder = tempfile::tempdir().unwrap();
    let options = BuildOptions::default().fill_voids(MAX_FILL + 1);
    let said = build(&dem, &folder.path().join("a.iqt"), &options, &Silent).unwrap_err().to_string();
    assert!(said.contains("the largest is 256"), "{said}");
}
