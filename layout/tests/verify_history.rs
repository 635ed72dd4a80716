//! Verification of edited files: not the current state alone but the journal and every state that it leads to.

mod common;

use common::open_bytes;
use terrasoar_layout::edit::EditSession;
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::{Counts, Sealed, reseal, seeds};
use terrasoar_layout::verify::verify;

const PAGE: usize = PAGE_BYTES;

fn seed(name: &str) -> Sealed {
    seeds().into_iter().find(|seed| seed.name == name).expect("a seed of that name").files
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

fn put(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// What verification says; that the file does not open counts as well.
fn problems(bytes: Vec<u8>) -> Vec<String> {
    match open_bytes(bytes) {
        Err(error) => vec![error.to_string()],
        Ok(terrain) => found(&terrain),
    }
}

fn found(terrain: &Terrain) -> Vec<String> {
    let report = verify(terrain, &|_| {}).unwrap();
    assert_eq!(report.problems.len(), report.problem_count.min(20) as usize);
    report.problems.iter().map(ToString::to_string).collect()
}

/// Journal pages from the newest to the first.
fn journal(bytes: &[u8]) -> Vec<usize> {
    let current = [0, PAGE].into_iter().max_by_key(|slot| u32_at(bytes, slot + 0x01c)).unwrap();
    let mut pages = vec![u32_at(bytes, current + 0x0ec)];
    while let Some(parent) = pages.last().map(|page| u32_at(bytes, page * PAGE + 0x010)).filter(|p| *p != 0) {
        pages.push(parent);
    }
    pages
}

#[test]
fn every_page_of_every_state_counts() {
    for name in ["edited", "edited, exact", "painted"] {
        let sound = seed(name).terrain;
        assert_eq!(problems(sound.clone()), [""; 0]);
        assert_eq!(journal(&sound).len(), 3);
        // Where one header slot is damaged the other one counts.
        for page in 2..sound.len() / PAGE {
            for at in [0, 5] {
                let mut changed = sound.clone();
                changed[page * PAGE + at] ^= 0x11;
                assert!(!problems(changed).is_empty(), "{name}: byte {at} of page {page}");
            }
        }
    }
}

#[test]
fn a_page_of_an_overlay_s_history_counts() {
    let sound = seed("overlay");
    let folder = tempfile::tempdir().unwrap();
    let problems = |files: &Sealed| {
        let (base, overlay) = files.write(folder.path()).unwrap();
        Terrain::open_with_overlay_unmapped(&base, &overlay.unwrap())
            .map_or_else(|error| vec![error.to_string()], |terrain| found(&terrain))
    };
    assert_eq!(problems(&sound), [""; 0]);
    let length = sound.overlay.as_ref().unwrap().len();
    for page in 2..length / PAGE {
        let mut changed = sound.clone();
        changed.overlay.as_mut().unwrap()[page * PAGE + 5] ^= 0x11;
        assert!(!problems(&changed).is_empty(), "page {page} of the overlay");
    }
}

#[test]
fn states_that_contradict_themselves_are_found_behind_right_checksums() {
    let sound = seed("edited").terrain;
    let commits = journal(&sound);
    let [newest, second, first] = [commits[0], commits[1], commits[2]].map(|page| page * PAGE);
    let found = |change: &dyn Fn(&mut Vec<u8>), words: &str| {
        let mut changed = sound.clone();
        change(&mut changed);
        reseal(&mut changed, Counts::Keep);
        let problems = problems(changed);
        assert!(problems.iter().any(|p| p.contains(words)), "{words}: {problems:?}");
    };
    let leaf_of = |bytes: &[u8], state: usize| u32_at(bytes, u32_at(bytes, state) * PAGE) * PAGE;
    // Two record pages of the newest state, which was undone, are one; one is its leaf; one is its journal page.
    let newest_leaf = leaf_of(&sound, newest + 0x040);
    let after = |sequence: u32, page: usize| format!("after commit {sequence} (journal on file page {page})");
    let name = after(3, commits[0]);
    for page in [u32_at(&sound, newest_leaf), newest_leaf / PAGE, commits[0]] {
        let words = format!("record page 1 {name}: file page {page} has another use as well");
        found(&|b| put(b, newest_leaf + 16, page as u32), &words);
    }
    // Another number of pages; a root that is not there.
    found(&|b| put(b, newest + 0x048, 1), &format!("directory {name}: it holds another number of pages"));
    found(&|b| put(b, newest + 0x040, 3), &name);
    // The journal itself.
    found(&|b| put(b, second + 0x00c, 7), "its sequence does not follow its parent's");
    found(&|b| put(b, first + 0x00c, 2), "its sequence does not follow its parent's");
    found(&|b| put(b, first + 0x0a0, 0x3f00_0000), "names another state before all commits");
    found(&|b| put(b, first + 0x040, 0xffff_ffff), "it names places that are not in the file");
    found(&|b| put(b, newest + 0x010, commits[2] as u32), "it does not lead to the commit");
    found(&|b| put(b, second + 0x050, 1), "the header names another state than it does for the same commit");
}

/// Undoing and redoing look at where they lead before they write: what would not open afterwards is refused, and the file stays as it was.
#[test]
fn no_header_is_written_that_leads_to_a_state_which_does_not_open() {
    let sound = seed("painted").terrain;
    let commits = journal(&sound);
    let newest = commits[0] * PAGE;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    let refused = |change: &dyn Fn(&mut Vec<u8>), words: &str| {
        let mut changed = sound.clone();
        change(&mut changed);
        reseal(&mut changed, Counts::Keep);
        std::fs::write(&path, &changed).unwrap();
        let mut session = EditSession::open(&path).unwrap();
        let error = session.redo().unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
        assert!(std::fs::read(&path).unwrap() == changed, "{words}: the file was written to");
        drop(session);
        Terrain::open(&path).unwrap();
    };
    let leaf = u32_at(&sound, u32_at(&sound, newest + 0x040) * PAGE) * PAGE;
    let first = u32_at(&sound, leaf) as u32;
    refused(&|b| put(b, leaf + 16, first), "has another use as well");
    refused(&|b| put(b, leaf + 16, 0xffff), "lies outside the file");
    refused(&|b| put(b, newest + 0x048, 1), "another number of pages");
    let section = u32_at(&sound, newest + 0x040 + 0x28);
    refused(&|b| put(b, section + 0x014, 0), "imagery header: the field texels");
    let directory = u32_at(&sound, section + 0x058) * PAGE;
    refused(
        &|b| b.copy_within(directory..directory + 4, directory + 16),
        "imagery directory entry of tile 1, 0",
    );
    // The imagery lies elsewhere: where there is none.
    refused(
        &|b| put(b, newest + 0x040 + 0x28, 3 * PAGE as u32),
        "imagery header: the magic bytes are missing",
    );
    // A sound one is redone.
    std::fs::write(&path, &sound).unwrap();
    assert!(EditSession::open(&path).unwrap().redo().unwrap().is_some());
    assert_eq!(found(&Terrain::open(&path).unwrap()), [""; 0]);
}
