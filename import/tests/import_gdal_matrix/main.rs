//! Every combination that matters of format, type, storage, direction, system, voids and meaning of numbers: made by GDAL, built here, and held sample by sample against what GDAL
//! reads and what arithmetic says.
//!
//! One in three of them, or with `TERRASOAR_THOROUGH`, which `./test --full` sets, each. The comparison is ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal_matrix -- --ignored`. One combination by itself:
//! `TERRASOAR_ONLY='PNG uint8'`. The page docs/formats.md is made from the list: `TERRASOAR_BLESS=1`.

mod combination;
mod compare;
mod matrix;
mod page;
mod source;
#[path = "../import_support/tools.rs"]
mod tools;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use terrasoar_layout::testing::{is_thorough, one_in};

/// One combination in so many is tried where time is short.
const FEW: usize = 3;

#[test]
#[ignore = "needs gdal-bin"]
fn every_combination_is_what_gdal_and_arithmetic_say() {
    let only = std::env::var("TERRASOAR_ONLY").ok();
    let all = matrix::all();
    let list: Vec<_> = match &only {
        Some(only) => all.into_iter().filter(|combination| combination.name().contains(only)).collect(),
        None => one_in(FEW, all).collect(),
    };
    let next = AtomicUsize::new(0);
    let wrong = Mutex::new(Vec::new());
    let counts = Mutex::new([0usize; 2]);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(combination) = list.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
                    match compare::compare(folder.path(), combination) {
                        Ok(agreed) => {
                            let mut counts = counts.lock().unwrap();
                            counts[0] += agreed.heights;
                            counts[1] += agreed.voids;
                        }
                        Err(words) => wrong.lock().unwrap().push(format!("{}: {words}", combination.name())),
                    }
                }
            });
        }
    });
    let (wrong, [heights, voids]) = (wrong.into_inner().unwrap(), counts.into_inner().unwrap());
    println!("{} combinations, {heights} heights and {voids} voids agree", list.len() - wrong.len());
    assert!(wrong.is_empty(), "{} of {} differ:\n{}", wrong.len(), list.len(), wrong.join("\n"));
    let few = if is_thorough() { 1 } else { FEW };
    assert!(
        only.is_some() || list.len() * few >= 400 && heights * few > 400_000 && voids * few > 400,
        "too little was compared"
    );
}

#[test]
fn the_page_of_formats_is_that_of_the_list() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/formats.md");
    let wanted = page::page();
    if std::env::var_os("TERRASOAR_BLESS").is_some() {
        std::fs::write(&path, &wanted).unwrap();
    }
    // Checked-out files of Windows have other ends of lines.
    let found = std::fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    assert!(
        found == wanted,
        "docs/formats.md is not what the list makes; make it again with TERRASOAR_BLESS=1"
    );
}
