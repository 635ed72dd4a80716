//! Nothing told as durable is lost, and nothing of others is harmed: failed commits, lost jobs, second writers by other names, links and modes, files that grow.

mod common;

use common::MemoryDem;
use common::edits::{Bench, pages, session_pages, set};
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, HeightRoom, build};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect, compact, history, widen};
use terrasoar_layout::file::disk::{FailingDisk, Failure, SystemDisk};
use terrasoar_layout::file::header::Header;
use terrasoar_layout::imagery::{DrapeOptions, MemoryImage, Paint, Scorch};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// What is in the folder of a bench.
fn names(bench: &Bench) -> Vec<String> {
    let entries = std::fs::read_dir(bench.folder.path()).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn commit(path: &Path, i: u32) {
    let mut session = EditSession::open(path).unwrap();
    session.apply(&[set(i)]).unwrap();
    session.commit("set").unwrap();
}

fn draped(path: &Path) {
    let image = MemoryImage::from_fn([600, 500], |x, y| [x as u8, y as u8, (x / 16 + y / 16) as u8, 255]);
    common::drape::draped(path, image, &DrapeOptions::default()).unwrap();
}

fn scorch(i: u32) -> Paint {
    let centre_m = [200.0 + 100.0 * f64::from(i), 500.0];
    Paint::Scorch(Scorch { centre_m, radius_m: 90.0, direction_deg: 20.0, strength: 0.8 })
}

/// After a commit that failed at any call, discarding leads back to the last state that was told as durable, and undo goes on from there.
#[test]
fn discarding_a_failed_commit_frees_the_session() {
    for (at, make) in (0..).flat_map(|at| [(at, Bench::new as fn() -> Bench), (at, Bench::packed)]) {
        let bench = make();
        let path = bench.path("t.iqt");
        draped(&path);
        commit(&path, 1);
        let told = pages(&Terrain::open(&path).unwrap());
        let disk = Arc::new(FailingDisk::new(at, Failure::Once));
        let mut session = EditSession::open_on(Arc::clone(&disk) as _, &path).unwrap();
        session.apply_and_paint(&[set(2), set(3)], &[scorch(1)]).unwrap();
        if session.commit("fails").is_ok() {
            assert!(at >= 4, "four calls: data, sync, header, sync");
            break;
        }
        // Edits after the failure are taken back as well.
        session.apply_and_paint(&[set(4)], &[scorch(2)]).unwrap();
        assert!(!session.is_committed());
        session.discard();
        assert!(session.is_committed(), "call {at}");
        assert!(session_pages(&mut session) == told, "call {at}");
        assert!(session.painter().unwrap().is_committed() && session.painter().unwrap().painted().is_empty());
        assert!(session.undo().unwrap().is_some(), "call {at}");
        assert!(session.redo().unwrap().is_some(), "call {at}");
        drop(session);
        let there = Terrain::open(&path).unwrap();
        assert!(pages(&there) == told && verify(&there, &|_| {}).unwrap().is_sound());
    }
}

/// A commit that failed and one after it: the second holds what both were to write, and counts their edits.
#[test]
fn edits_are_counted_whatever_happens_to_commits() {
    for bench in Bench::both() {
        let path = bench.path("t.iqt");
        let mut session = EditSession::open(&path).unwrap();
        session.apply(&[set(1), set(2)]).unwrap();
        let job = session.prepare_commit("first").unwrap().unwrap();
        // Applied while the commit is under way: it is in the next one.
        session.apply(&[set(3), set(4), set(5)]).unwrap();
        assert!(session.prepare_commit("too early").is_err() && session.undo().is_err());
        let done = job.run();
        session.finish_commit(job, done).unwrap();
        assert!(!session.is_committed());
        session.commit("second").unwrap();
        session.apply(&[set(6)]).unwrap();
        let lost = session.prepare_commit("lost").unwrap().unwrap();
        session.apply(&[set(7)]).unwrap();
        drop(lost);
        session.commit("third").unwrap();
        let told: Vec<u64> = session.history().unwrap().iter().map(|entry| entry.edits).collect();
        assert_eq!(told, [2, 3, 2]);
        let here = session_pages(&mut session);
        drop(session);
        assert!(pages(&Terrain::open(&path).unwrap()) == here);
    }
}

/// A job that nobody finishes: by a thread that panics, before it was run and after.
#[test]
fn a_lost_job_is_a_failed_commit() {
    for (runs, paints) in [(false, false), (true, false), (false, true), (true, true)] {
        for bench in Bench::both() {
            let path = bench.path("t.iqt");
            draped(&path);
            let mut session = EditSession::open(&path).unwrap();
            let paint = if paints { vec![scorch(0)] } else { vec![] };
            session.apply_and_paint(&[set(1)], &paint).unwrap();
            let job = session.prepare_commit("lost").unwrap().unwrap();
            let thread = std::thread::spawn(move || {
                if runs {
                    job.run().unwrap();
                }
                std::panic::resume_unwind(Box::new("the thread of a commit dies"));
            });
            assert!(thread.join().is_err());
            assert!(!session.is_committed());
            session.commit("again").unwrap();
            let here = session_pages(&mut session);
            assert!(session.is_committed() && session.undo().unwrap().is_some());
            assert!(session.redo().unwrap().is_some());
            drop(session);
            let there = Terrain::open(&path).unwrap();
            assert!(pages(&there) == here && verify(&there, &|_| {}).unwrap().is_sound());
            assert_eq!(history(&there).unwrap().len(), 1);
        }
    }
}

/// A job of another commit is not taken for the one under way.
#[test]
fn only_the_commit_under_way_is_finished() {
    let [one, two] = [Bench::new(), Bench::new()];
    let mut sessions = [&one, &two].map(|bench| EditSession::open(&bench.path("t.iqt")).unwrap());
    let [a, b] = sessions.each_mut().map(|session| {
        session.apply(&[set(1)]).unwrap();
        session.prepare_commit("set").unwrap().unwrap()
    });
    let done = a.run();
    assert!(sessions[1].finish_commit(a, done).is_err());
    let done = b.run();
    assert_eq!(
        sessions[1].finish_commit(b, done).unwrap().places.len() as u64,
        sessions[1].editor().edited_pages().len() as u64
    );
}

/// A page of now that cannot be read any more: undo needs it to tell what changes, and is refused before the file changes.
#[test]
fn a_turn_that_memory_cannot_follow_is_not_made() {
    let bench = Bench::new();
    let path = bench.path("t.iqt");
    commit(&path, 1);
    commit(&path, 2);
    let mut session = EditSession::open(&path).unwrap();
    let before = session.header().clone();
    let terrain = Arc::clone(session.editor().terrain());
    let newest = terrain.present_pages().unwrap().map(|(_, entry)| entry.page).max().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[newest as usize * 4096 + 77] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let error = session.undo().unwrap_err().to_string();
    assert!(error.contains("checksum"), "{error}");
    assert_eq!(session.header(), &before);
    drop(session);
    assert!(std::fs::read(&path).unwrap() == bytes, "the file is as it was");
    let told = history(&Terrain::open(&path).unwrap()).unwrap();
    assert!(told[1].is_current);
}

/// Edited pages that are in the file can be read again, so memory holds a bounded number of them, and they are what they were.
#[test]
fn committed_pages_do_not_stay_in_memory() {
    for bench in Bench::both() {
        for is_overlay in [false, true] {
            let (path, overlay) = (bench.path("t.iqt"), bench.path("o.iqo"));
            let mut session = if is_overlay {
                EditSession::open_overlay(&path, &overlay).unwrap()
            } else {
                EditSession::open(&path).unwrap()
            };
            session.editor_mut().keep_at_most(3);
            let all = SampleRect { west: 0, south: 0, east: 149, north: 119 };
            for i in 0..12 {
                if i == 6 {
                    let half = SampleRect { east: 75, ..all };
                    session.apply(&[Edit::Set { area: Area::Rect(half), height_m: 44.0 }]).unwrap();
                }
                session.apply(&[set(i)]).unwrap();
                let changed = session.editor().uncommitted().len();
                session.commit("set").unwrap();
                if i % 5 == 4 {
                    session.undo().unwrap().unwrap();
                }
                // The next batch lets go of what the last one held.
                session.apply(&[]).unwrap();
                assert!(session.editor().held_pages() <= 3, "{} of {changed}", session.editor().held_pages());
            }
            let here = session_pages(&mut session);
            let heights = session.editor_mut().heights(all).unwrap();
            drop(session);
            let there = if is_overlay {
                Terrain::open_with_overlay(&path, &overlay).unwrap()
            } else {
                Terrain::open(&path).unwrap()
            };
            assert!(pages(&there) == here && verify(&there, &|_| {}).unwrap().is_sound());
            let mut again = if is_overlay {
                EditSession::open_overlay(&path, &overlay).unwrap()
            } else {
                EditSession::open(&path).unwrap()
            };
            assert_eq!(again.editor_mut().heights(all).unwrap(), heights);
        }
    }
}

/// The generations of a file run out in the same words whoever asks for the next.
#[test]
fn generations_that_ran_out_are_refused_by_every_writer() {
    let bench = Bench::new();
    let path = bench.path("t.iqt");
    let mut bytes = std::fs::read(&path).unwrap();
    let page: &[u8; 4096] = bytes[..4096].try_into().unwrap();
    let header = Header { generation: u32::MAX, ..Header::parse(&path, page).unwrap() };
    bytes[..4096].copy_from_slice(&header.to_page()[..]);
    std::fs::write(&path, &bytes).unwrap();
    let mut session = EditSession::open(&path).unwrap();
    session.apply(&[set(1)]).unwrap();
    let commit = session.commit("set").unwrap_err().to_string();
    drop(session);
    let image = MemoryImage::from_fn([60, 50], |x, y| [x as u8, y as u8, 7, 255]);
    let drape = common::drape::draped(&path, image, &DrapeOptions::default()).unwrap_err().to_string();
    for error in [commit, drape] {
        assert!(error.contains("four thousand million times") && error.contains("compact"), "{error}");
    }
    assert!(std::fs::read(&path).unwrap() == bytes);
    compact(&SystemDisk, &path, None, &path, &Silent).unwrap();
    assert_eq!(Terrain::open(&path).unwrap().header().generation, 1);
}

/// A header that counts more than there is, while somebody goes on appending nonsense.
#[test]
fn a_damaged_file_that_grows_is_told_and_not_waited_for() {
    for bench in Bench::both() {
        let path = bench.path("t.iqt");
        commit(&path, 1);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 4096 * 3]).unwrap();
        let growing = std::sync::atomic::AtomicBool::new(true);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                use std::io::Write;
                let mut file = std::fs::File::options().append(true).open(&path).unwrap();
                while growing.load(std::sync::atomic::Ordering::Relaxed) {
                    file.write_all(b"x").unwrap();
                    std::thread::yield_now();
                }
            });
            let opened = [Terrain::open(&path), Terrain::open_unmapped(&path)];
            growing.store(false, std::sync::atomic::Ordering::Relaxed);
            for error in opened.map(|opened| opened.unwrap_err()) {
                assert!(matches!(error, LayoutError::Damaged { .. }), "{error}");
            }
        });
    }
}

#[cfg(unix)]
mod names {
    use super::*;
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};

    /// Every way to write, through a link that leads to a file of mode 0600 in another folder: the file changes, link and mode stay, and nothing is left beside either.
    #[test]
    fn links_and_modes_stay_whatever_is_written() {
        for bench in Bench::both() {
            std::fs::create_dir(bench.path("far")).unwrap();
            let (real, link) = (bench.path("far/real.iqt"), bench.path("link.iqt"));
            std::fs::rename(bench.path("t.iqt"), &real).unwrap();
            symlink("far/real.iqt", &link).unwrap();
            std::fs::set_permissions(&real, PermissionsExt::from_mode(0o600)).unwrap();
            let mut last = std::fs::read(&real).unwrap();
            for step in 0..6 {
                match step {
                    0 | 2 | 4 => commit(&link, step),
                    1 => {
                        let room = HeightRoom { lowest_m: -900.0, highest_m: 0.0 };
                        widen(&SystemDisk, &link, room, 512, &Silent).map(drop).unwrap();
                    }
                    3 => compact(&SystemDisk, &link, None, &link, &Silent).map(drop).unwrap(),
                    _ => draped(&link),
                }
                let now = std::fs::read(&real).unwrap();
                assert!(now != last, "step {step} changed the file that the link leads to");
                last = now;
                assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
                assert_eq!(std::fs::metadata(&real).unwrap().mode() & 0o777, 0o600, "step {step}");
                assert_eq!(names(&bench), ["far", "link.iqt"]);
                assert_eq!(std::fs::read_dir(bench.path("far")).unwrap().count(), 1);
                assert!(verify(&Terrain::open(&link).unwrap(), &|_| {}).unwrap().is_sound());
            }
        }
    }

    /// While one writes, every other writer is told by whatever name it comes.
    #[test]
    fn the_second_writer_is_told_by_every_name() {
        for bench in Bench::both() {
            let real = bench.path("t.iqt");
            symlink("t.iqt", bench.path("link.iqt")).unwrap();
            std::fs::hard_link(&real, bench.path("hard.iqt")).unwrap();
            symlink(bench.folder.path(), bench.path("self")).unwrap();
            let names =
                ["t.iqt", "link.iqt", "hard.iqt", "self/link.iqt", "./t.iqt"].map(|name| bench.path(name));
            let before = std::fs::read(&real).unwrap();
            for first in &names {
                let session = EditSession::open(first).unwrap();
                for second in &names {
                    let room = HeightRoom { lowest_m: -900.0, highest_m: 0.0 };
                    let image = MemoryImage::from_fn([60, 50], |x, y| [x as u8, y as u8, 7, 255]);
                    let dem = MemoryDem::from_fn([9, 9], SampleType::I16, |x, y| f64::from(x + y));
                    let options = BuildOptions::default().spacing_m([10.0; 2]);
                    let errors = [
                        EditSession::open(second).map(drop),
                        compact(&SystemDisk, second, None, second, &Silent).map(drop),
                        widen(&SystemDisk, second, room, 512, &Silent).map(drop),
                        common::drape::draped(second, image, &DrapeOptions::default()).map(drop),
                        build(&dem, second, &options, &Silent).map(drop),
                    ]
                    .map(|done| done.unwrap_err().to_string());
                    for error in errors {
                        assert!(error.contains("another program is writing"), "{error}");
                    }
                }
                drop(session);
                assert!(std::fs::read(&real).unwrap() == before);
            }
            // With more than one name, writing anew would part them.
            let error = compact(&SystemDisk, &real, None, &real, &Silent).unwrap_err().to_string();
            assert!(error.contains("hard links"), "{error}");
            compact(&SystemDisk, &real, None, &bench.path("new.iqt"), &Silent).unwrap();
        }
    }

    /// Files with names that a lock could have are others'.
    #[test]
    fn files_called_lock_are_left_alone() {
        let bench = Bench::new();
        let path = bench.path("t.iqt");
        for name in ["t.iqt.lock", "Cargo.lock", "o.iqo.lock"] {
            std::fs::write(bench.path(name), "mine").unwrap();
        }
        commit(&path, 1);
        compact(&SystemDisk, &path, None, &bench.path("Cargo"), &Silent).unwrap();
        compact(&SystemDisk, &path, None, &path, &Silent).unwrap();
        draped(&path);
        drop(EditSession::open_overlay(&path, &bench.path("o.iqo")).unwrap());
        for name in ["t.iqt.lock", "Cargo.lock", "o.iqo.lock"] {
            assert_eq!(std::fs::read_to_string(bench.path(name)).unwrap(), "mine");
        }
        assert_eq!(names(&bench), ["Cargo", "Cargo.lock", "o.iqo", "o.iqo.lock", "t.iqt", "t.iqt.lock"]);
    }
}
