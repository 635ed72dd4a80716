//! The page of the newest header is damaged: the file reads as before the last commit, and says so; what is made of it opens.

mod common;

use common::edits::{Bench, set};
use std::path::Path;
use terrasoar_layout::edit::EditSession;
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::imagery::{DrapeOptions, MemoryImage, drape_on};
use terrasoar_layout::packing::pack;
use terrasoar_layout::packing::unpack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

const PAGE: usize = 4096;
/// Bytes of the mark in a file's last bytes (FORMAT.md, section 8.5).
const MARK: usize = 64;

/// The mark of a commit that was saved as it was before it was.
fn begun(mark: &[u8]) -> Vec<u8> {
    let mut mark = mark.to_vec();
    assert_eq!((&mark[..8], &mark[0x0c..0x10]), (&b"IQTSAVED"[..], &[2, 0, 0, 0][..]));
    mark[0x0c] = 1;
    let sum = crc32fast::hash(&mark[..0x3c]);
    mark[0x3c..].copy_from_slice(&sum.to_le_bytes());
    mark
}

fn commit(mut session: EditSession, i: u32) {
    session.apply(&[set(i)]).unwrap();
    session.commit("set").unwrap();
}

/// Flips a bit of a byte of a page.
fn damaged(path: &Path, page: usize, byte: usize) -> Vec<u8> {
    let whole = std::fs::read(path).unwrap();
    let mut bytes = whole.clone();
    bytes[page * PAGE + byte] ^= 4;
    std::fs::write(path, &bytes).unwrap();
    whole
}

#[test]
fn a_damaged_newest_header_is_told_and_an_older_one_passed_over() {
    for bench in Bench::both() {
        let (path, overlay) = (bench.path("t.iqt"), bench.path("t.iqo"));
        for commits in 1..4 {
            // In the file itself, and in an overlay over what it is then.
            commit(EditSession::open(&path).unwrap(), commits);
            let _ = std::fs::remove_file(&overlay);
            drop(EditSession::open_overlay(&path, &overlay).unwrap());
            assert_eq!(Terrain::open_with_overlay(&path, &overlay).unwrap().lost_header().unwrap(), None);
            commit(EditSession::open_overlay(&path, &overlay).unwrap(), 7);
            let open_file = || Terrain::open(&path).unwrap();
            let open_both = || Terrain::open_with_overlay(&path, &overlay).unwrap();
            let newest = commits as usize % 2;
            for (file, newest, open) in [
                (&path, newest, &open_file as &dyn Fn() -> Terrain),
                (&overlay, 1, &open_both as &dyn Fn() -> Terrain),
            ] {
                let generation = open().header().generation;
                assert_eq!(open().lost_header().unwrap(), None);
                let report = verify(&open(), &|_| {}).unwrap();
                assert_eq!((report.is_sound(), report.lost_header), (true, None));
                for byte in [9, 0x20, 0x88, 0x3ff, 0xfff] {
                    let whole = damaged(file, newest, byte);
                    if byte != 9 || file == &overlay {
                        let terrain = open();
                        let lost = terrain.lost_header().unwrap().unwrap();
                        assert_eq!((lost.page, lost.generation), (newest as u64, generation - 1));
                        assert_eq!(lost.was_saved, Some(true));
                        let report = verify(&terrain, &|_| {}).unwrap();
                        assert_eq!((report.is_sound(), report.lost_header), (true, Some(lost)));
                    }
                    std::fs::write(file, &whole).unwrap();
                    damaged(file, 1 - newest, byte);
                    let terrain = open();
                    assert_eq!(terrain.header().generation, generation);
                    assert_eq!(terrain.lost_header().unwrap(), None);
                    assert!(verify(&terrain, &|_| {}).unwrap().is_sound());
                    std::fs::write(file, &whole).unwrap();
                }
                for fill in [0, 0x5a, 0xff] {
                    let whole = std::fs::read(file).unwrap();
                    let mut bytes = whole.clone();
                    bytes[newest * PAGE..(newest + 1) * PAGE].fill(fill);
                    std::fs::write(file, &bytes).unwrap();
                    let lost = open().lost_header().unwrap().unwrap();
                    assert_eq!((lost.page, lost.was_saved), (newest as u64, Some(true)), "{fill}");
                    // A file of a program that makes no marks: after a first commit the other slot knows of none.
                    std::fs::write(file, &bytes[..bytes.len() - MARK]).unwrap();
                    let is_told = fill != 0 || (commits > 1 && file == &path);
                    let lost = open().lost_header().unwrap();
                    assert_eq!(lost.map(|lost| lost.was_saved), is_told.then_some(None), "{fill}");
                    // One whose last commit was not finished.
                    let at = bytes.len() - MARK;
                    let mark = begun(&bytes[at..]);
                    bytes[at..].copy_from_slice(&mark);
                    std::fs::write(file, &bytes).unwrap();
                    let lost = open().lost_header().unwrap();
                    assert_eq!(lost.map(|lost| lost.was_saved), is_told.then_some(Some(false)), "{fill}");
                    std::fs::write(file, &whole).unwrap();
                }
            }
        }
    }
}

#[test]
fn what_is_packed_of_a_file_with_one_header_opens() {
    for bench in Bench::both() {
        let [path, packed, plain] = ["t.iqt", "packed.iqt", "plain.iqt"].map(|name| bench.path(name));
        commit(EditSession::open(&path).unwrap(), 1);
        for slot in [0, 1] {
            let mut bytes = std::fs::read(&path).unwrap();
            let whole = bytes.clone();
            bytes[slot * PAGE..(slot + 1) * PAGE].fill(0x5a);
            std::fs::write(&path, &bytes).unwrap();
            let there = Terrain::open(&path).unwrap();
            if there.source().packed_bytes().is_some() {
                unpack(&SystemDisk, &path, &plain, &Silent).unwrap();
            } else {
                pack(&SystemDisk, &path, &packed, &Silent).unwrap();
                unpack(&SystemDisk, &packed, &plain, &Silent).unwrap();
                assert_eq!(Terrain::open(&packed).unwrap().header(), there.header());
            }
            assert_eq!(Terrain::open(&plain).unwrap().header(), there.header());
            std::fs::write(&path, &whole).unwrap();
        }
    }
}

/// A picture is lost as edits are, though it stands in no journal; and a file that grew by marks alone is as long as it was.
#[test]
fn pictures_leave_a_mark_too_and_marks_do_not_pile_up() {
    for bench in Bench::both() {
        let path = bench.path("t.iqt");
        for round in 0..3 {
            let image = MemoryImage::from_fn([60, 40], move |x, y| [x as u8, y as u8, round, 255]);
            let options = DrapeOptions::default();
            drape_on(&SystemDisk, &path, &[Box::new(image)], &options, &Silent).unwrap();
            let whole = std::fs::read(&path).unwrap();
            let newest = (Terrain::open(&path).unwrap().header().generation as usize - 1) % 2;
            let mut bytes = whole.clone();
            bytes[newest * PAGE..(newest + 1) * PAGE].fill(0);
            std::fs::write(&path, &bytes).unwrap();
            let lost = Terrain::open(&path).unwrap().lost_header().unwrap().unwrap();
            assert_eq!((lost.page, lost.was_saved), (newest as u64, Some(true)));
            std::fs::write(&path, &whole).unwrap();
        }
        let mut session = EditSession::open(&path).unwrap();
        session.apply(&[set(3)]).unwrap();
        session.commit("set").unwrap();
        let length = || std::fs::metadata(&path).unwrap().len();
        let before = length();
        for _ in 0..4 {
            session.undo().unwrap().unwrap();
            session.redo().unwrap().unwrap();
        }
        assert_eq!(length(), before, "undo and redo write headers alone");
        // What is behind the end already is left there.
        drop(session);
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend([7; 100]);
        std::fs::write(&path, &bytes).unwrap();
        let mut session = EditSession::open(&path).unwrap();
        session.undo().unwrap().unwrap();
        session.redo().unwrap().unwrap();
        assert_eq!(length(), before + 100 + MARK as u64);
    }
}
