//! The same bytes for any order of names and any number of threads.

use crate::ground::{Patch, inside};
use crate::import_support::Random;
use std::path::PathBuf;
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, Priority, open_with};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;

#[test]
fn order_and_threads_change_no_byte() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let mut random = Random(7);
    let mut files: Vec<PathBuf> = Vec::new();
    for number in 0..9u32 {
        let step = [10.0, 10.0, 20.0][number as usize % 3];
        // Some on one grid, some half a step off it.
        let off = if number % 4 == 3 { step / 2.0 } else { 0.0 };
        let patch = Patch {
            samples: [40 + number, 50],
            west: 500_000.0 + 200.0 * f64::from(number % 3) + off,
            north: 5_000_000.0 - 240.0 * f64::from(number / 3),
            step,
        };
        let height = |x: f64, y: f64| (x * 0.01 + f64::from(number) * 3.0).sin() * 50.0 + y % 17.0;
        files.push(patch.write(file(&format!("{number}.asc")), "EPSG:32632", height));
    }
    for (priority, feather_m) in
        [(Priority::Finest, None), (Priority::Highest, None), (Priority::Finest, Some(60.0))]
    {
        let mut first: Option<Vec<u8>> = None;
        for threads in [1, 2, 4] {
            for at in (1..files.len()).rev() {
                files.swap(at, random.below(at as u64 + 1) as usize);
            }
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let out = file("out.iqt");
            // Little memory takes the other way, through temporary files.
            let memory_mib = if threads == 4 { 1 } else { 512 };
            pool.install(|| {
                let options = OpenOptions {
                    priority,
                    feather_m,
                    memory_mib: Some(memory_mib),
                    scratch: Some(folder.path().to_owned()),
                    ..OpenOptions::default()
                };
                let dem = open_with(&files, &options).unwrap();
                build(&*dem, &out, &BuildOptions::default(), &Silent).unwrap();
            });
            let bytes = std::fs::read(&out).unwrap();
            match &first {
                None => first = Some(bytes),
                Some(first) => assert!(*first == bytes, "{priority:?} {feather_m:?} on {threads} threads"),
            }
        }
    }
}
