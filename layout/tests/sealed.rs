//! Files whose checksums are right and whose contents are nonsense, as a hostile writer would make them: refused with words, or used without a panic, in proportion
//! to the file.

use std::path::Path;
use std::time::{Duration, Instant};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::imagery::Imagery;
use terrasoar_layout::mix::Random;
use terrasoar_layout::testing::{Counts, Mutation, Sealed, Seed, exercise, reseal, seeds};

/// A recipe of one to four mutations; three in four settle the counts.
fn recipe(random: &mut Random) -> Vec<u8> {
    let count = 1 + random.index(4);
    let mut recipe = vec![u8::from(random.below(4) == 0)];
    (0..count).for_each(|_| recipe.extend(random.bits().to_le_bytes()));
    recipe
}

/// A folder that lies in memory, if the system has such: nothing here is about what becomes of files.
fn in_memory() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

fn seed(name: &str) -> Seed {
    seeds().into_iter().find(|seed| seed.name == name).expect("a seed of that name")
}

/// Longest that all uses of one small file may take.
const PATIENCE: Duration = Duration::from_secs(10);

fn try_out(name: &str, recipe: &[u8], files: &Sealed, folder: &Path) -> bool {
    let begun = Instant::now();
    let opened = exercise(files, folder);
    let took = begun.elapsed();
    assert!(took < PATIENCE, "{name} with {recipe:?} took {took:?}");
    opened
}

#[test]
fn whatever_a_sealed_file_says_it_is_used_or_refused() {
    let rounds = std::env::var("TERRASOAR_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    let folder = in_memory();
    let mut opened = 0;
    for (i, seed) in seeds().into_iter().enumerate() {
        assert!(exercise(&seed.files, folder.path()), "{}", seed.name);
        let mut random = Random::new(i as u64);
        for _ in 0..rounds {
            let recipe = recipe(&mut random);
            let mut files = seed.files.clone();
            files.mutate(&recipe);
            let tried = std::panic::catch_unwind(|| try_out(seed.name, &recipe, &files, folder.path()));
            opened += usize::from(tried.unwrap_or_else(|_| panic!("{} with {recipe:?}", seed.name)));
            let _ = std::fs::remove_file(folder.path().join("o.iqo"));
        }
    }
    assert!(opened > 3 * rounds, "{opened}");
}

/// A square of 2^12 steps in eight pages: all record pages are one page, all leaves one leaf.
fn bomb(leaf_pages: &[u32], leaves: impl Fn(usize) -> u32) -> Vec<u8> {
    let mut bytes = seed("exact 16").files.terrain;
    bytes.truncate(5 * PAGE_BYTES);
    let mut leaf = vec![0; PAGE_BYTES];
    leaf.chunks_exact_mut(16)
        .zip(leaf_pages.iter().cycle())
        .for_each(|(entry, page)| entry[..4].copy_from_slice(&page.to_le_bytes()));
    bytes.extend_from_slice(&leaf);
    bytes.extend_from_slice(&leaf);
    let mut root = vec![0; 2 * PAGE_BYTES];
    for (i, entry) in root.chunks_exact_mut(16).take(427).enumerate() {
        entry[..4].copy_from_slice(&leaves(i).to_le_bytes());
    }
    bytes.extend_from_slice(&root);
    let length = bytes.len() as u64;
    bytes[0x014..0x018].copy_from_slice(&4097u32.to_le_bytes());
    bytes[0x018..0x01c].copy_from_slice(&4097u32.to_le_bytes());
    bytes[0x078..0x07c].copy_from_slice(&7u32.to_le_bytes());
    bytes[0x088..0x090].copy_from_slice(&length.to_le_bytes());
    reseal(&mut bytes, Counts::Settle);
    bytes
}

/// What is said where all of it is asked for.
fn refusal(terrain: Vec<u8>) -> String {
    let opened = Sealed { terrain, overlay: None }.open();
    opened.and_then(|terrain| terrain.check_directory()).expect_err("it is refused").to_string()
}

#[test]
fn a_small_file_does_not_stand_for_a_large_terrain() {
    // Leaves that are one leaf; a leaf whose pages are one page; pages that are leaf, root, header slot, inert page.
    let said = refusal(bomb(&[3, 4], |i| if i == 426 { 6 } else { 5 }));
    assert!(said.contains("directory leaf 1: file page 5 has another use as well"), "{said}");
    let one_leaf = |i| if i == 0 { 5 } else { 0 };
    let said = refusal(bomb(&[3], one_leaf));
    assert!(said.contains("record page 1: file page 3 has another use as well"), "{said}");
    for page in [5, 7, 8] {
        let said = refusal(bomb(&[page], one_leaf));
        let words = format!("record page 0: file page {page} has another use as well");
        assert!(said.contains(&words), "{said}");
    }
    for page in [1, 2] {
        let said = refusal(bomb(&[page], one_leaf));
        assert!(said.contains("record page 0: the page lies outside the file"), "{said}");
    }
}

#[test]
fn tiles_that_share_pages_are_refused() {
    let draped = seed("draped").files;
    let imagery = |files: &Sealed| Imagery::open(&files.open().unwrap()).map(|_| ());
    imagery(&draped).unwrap();
    let header = draped.open().unwrap().header().imagery.unwrap().offset as usize;
    let directory = header + PAGE_BYTES;
    let page_of = |i: usize| {
        let at = directory + 16 * i;
        u32::from_le_bytes(draped.terrain[at..at + 4].try_into().unwrap())
    };
    // Tile 1 lies where tile 0 ends, in the directory, in the section's first page.
    for page in [page_of(0), page_of(0) + 1, (directory / PAGE_BYTES) as u32, (header / PAGE_BYTES) as u32] {
        let mut files = draped.clone();
        files.terrain[directory + 16..directory + 20].copy_from_slice(&page.to_le_bytes());
        reseal(&mut files.terrain, Counts::Keep);
        let said = imagery(&files).unwrap_err().to_string();
        assert!(said.contains("tile 1, 0 of level 0") && said.contains("has another use as well"), "{said}");
    }
}

#[test]
fn mutations_reach_every_part() {
    // Each kind of mutation changes some seed.
    for how in 0..16 {
        let is_felt = (0..64u8).any(|i| {
            let mutation = [how, i, i.wrapping_mul(7), 0, i.wrapping_mul(5), i, 1, 0];
            assert_eq!(mutation.len(), Mutation::BYTES);
            seeds().into_iter().any(|seed| {
                let mut files = seed.files.clone();
                files.mutate(&[&[1][..], &mutation[..]].concat());
                files != seed.files
            })
        });
        assert!(is_felt, "{how}");
    }
}
