//! Disks that fail, threads that panic or do not start, edits that are refused, others who have the file.

use super::*;
use std::sync::atomic::AtomicBool;
use terrasoar_layout::build::HeightRoom;
use terrasoar_layout::edit::widen;
use terrasoar_layout::file::disk::{FailingDisk, Failure};

#[test]
fn a_commit_that_panics_is_told_and_what_it_was_to_write_is_in_the_next() {
    for call in 1..=7 {
        let land = Land::new();
        let mood = Arc::new(Mood::default());
        let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
        stroke(&mut workshop, 1);
        assert!(matches!(wait(&mut workshop), News::Edited(_)));
        mood.panics_in.store(call, Ordering::Relaxed);
        workshop.commit("first");
        let News::NotSaved(error) = wait(&mut workshop) else { panic!("call {call}") };
        assert!(error.to_string().contains("land.iqt") && error.to_string().contains("unexpected end"));
        assert!(workshop.is_unsaved(), "it is not told as saved");
        stroke(&mut workshop, 2);
        workshop.commit("second");
        wait_for(&mut workshop, is_saved);
        assert!(!workshop.is_unsaved(), "and does not stay unsaved for good");
        workshop.close().1.unwrap();
        assert!(land.pages() == land.pages_after(&[crater(1), crater(2)]), "call {call}");
    }
}

#[test]
fn a_disk_that_fails_once_or_is_full_is_told_and_nothing_is_lost_that_was_saved() {
    let counting = Arc::new(FailingDisk::new(u64::MAX, Failure::Once));
    let land = Land::new();
    let mut workshop = land.workshop_on(counting.clone());
    stroke(&mut workshop, 1);
    workshop.close().1.unwrap();
    // What is written with a mark, the header, the mark again: each with its sync.
    let calls = counting.calls();
    assert_eq!(calls, 7);
    for call in 0..calls {
        let land = Land::new();
        let mut workshop = land.workshop_on(Arc::new(FailingDisk::new(call, Failure::Once)));
        stroke(&mut workshop, 1);
        workshop.commit("first");
        wait_for(&mut workshop, |news| matches!(news, News::NotSaved(_)));
        assert!(workshop.is_unsaved());
        workshop.commit("again");
        wait_for(&mut workshop, is_saved);
        workshop.close().1.unwrap();
        assert!(land.pages() == land.pages_after(&[crater(1)]), "call {call}");
    }
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(FailingDisk::new(calls, Failure::Full { quarters: 2 })));
    stroke(&mut workshop, 1);
    workshop.commit("first");
    wait_for(&mut workshop, is_saved);
    stroke(&mut workshop, 2);
    stroke(&mut workshop, 3);
    let (news, closed) = workshop.close();
    assert_eq!(news.len(), 2, "{news:?}");
    let words = closed.unwrap_err();
    assert!(
        words.contains("room") && words.contains("2 edits were not told as saved and may be gone"),
        "{words}"
    );
    assert!(land.pages() == land.pages_after(&[crater(1)]));
    // The right to edit was given back.
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    stroke(&mut workshop, 4);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(4)]));
}

/// Whether threads of these names start.
static WORKSHOPS: AtomicBool = AtomicBool::new(true);
static COMMITS: AtomicBool = AtomicBool::new(true);

fn spawn_some(name: &str, work: Box<dyn FnOnce() + Send>) -> io::Result<JoinHandle<()>> {
    let starts = if name == "commit" { &COMMITS } else { &WORKSHOPS };
    if !starts.load(Ordering::Relaxed) {
        return Err(io::Error::from(io::ErrorKind::WouldBlock));
    }
    spawn(name, work)
}

#[test]
fn threads_that_cannot_start_are_words_and_the_next_edit_tries_again() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    workshop.spawn = spawn_some;
    WORKSHOPS.store(false, Ordering::Relaxed);
    let words = workshop.apply(1, vec![crater(1)], Vec::new()).unwrap_err();
    assert!(words.contains("land.iqt") && words.contains("no thread to edit with"), "{words}");
    assert!(!workshop.is_unsaved() && workshop.take().is_none());
    WORKSHOPS.store(true, Ordering::Relaxed);
    COMMITS.store(false, Ordering::Relaxed);
    for _ in 0..2 {
        stroke(&mut workshop, 1);
        workshop.commit("a stroke");
        let News::NotOpened(error) = wait(&mut workshop) else { panic!() };
        assert!(error.to_string().contains("cannot start a thread that writes"), "{error}");
        assert!(!workshop.is_unsaved() && workshop.in_flight() == 0 && workshop.take().is_none());
    }
    COMMITS.store(true, Ordering::Relaxed);
    stroke(&mut workshop, 2);
    workshop.commit("a stroke");
    wait_for(&mut workshop, is_saved);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(2)]));
}

#[test]
fn a_thread_that_panics_is_words_and_the_terrain_can_be_opened_again() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
    stroke(&mut workshop, 1);
    workshop.commit("first");
    wait_for(&mut workshop, is_saved);
    // An undo writes on the thread that edits. What comes after it is lost with that.
    mood.panics_in.store(1, Ordering::Relaxed);
    workshop.turn(true).unwrap();
    stroke(&mut workshop, 2);
    stroke(&mut workshop, 3);
    let News::Broken(words) = wait(&mut workshop) else { panic!() };
    assert!(words.contains("land.iqt") && words.contains("unexpected end"), "{words}");
    assert!(words.contains("2 edits were not told as saved and may be gone"), "{words}");
    assert!(!workshop.is_unsaved() && workshop.in_flight() == 0 && workshop.take().is_none());
    let refused = workshop.apply(4, vec![crater(4)], Vec::new()).unwrap_err();
    assert!(refused.contains("open the terrain again"), "{refused}");
    assert!(workshop.turn(true).is_err());
    workshop.commit("nothing");
    workshop.close().1.unwrap();
    // What was saved is there, and the right to edit was given back.
    assert!(land.pages() == land.pages_after(&[crater(1)]));
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    stroke(&mut workshop, 5);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(5)]));
}

#[test]
fn a_commit_under_way_is_written_although_its_thread_has_panicked() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
    let armed = Arc::new(AtomicBool::new(false));
    let arm = Arc::clone(&armed);
    // Whoever reports wakes the window, and panics at that.
    workshop.wake = Arc::new(move || assert!(!armed.swap(false, Ordering::Relaxed), "as it was asked to"));
    stroke(&mut workshop, 1);
    assert!(matches!(wait(&mut workshop), News::Edited(_)));
    mood.slow_ms.store(100, Ordering::Relaxed);
    workshop.commit("first");
    arm.store(true, Ordering::Relaxed);
    stroke(&mut workshop, 2);
    wait_for(&mut workshop, |news| matches!(news, News::Broken(_)));
    // The right to edit was given back after that was written, or another could have written in between.
    let mut next = EditSession::open(&land.path).unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1)]));
    next.apply(&[crater(3)]).unwrap();
    next.commit("another").unwrap();
    std::thread::sleep(Duration::from_millis(500));
    assert!(land.pages() == land.pages_after(&[crater(1), crater(3)]));
}

#[test]
fn of_a_stroke_that_is_refused_nothing_more_is_applied() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let too_deep =
        Edit::Crater(Crater { centre_m: [900.0; 2], direction_deg: 0.0, radius_m: 300.0, depth_m: 1e7 });
    workshop.apply(1, vec![crater(1)], Vec::new()).unwrap();
    // Deeper than any file holds.
    workshop.apply(1, vec![too_deep; 150], Vec::new()).unwrap();
    workshop.apply(1, vec![crater(2)], Vec::new()).unwrap();
    workshop.apply(2, vec![crater(3)], Vec::new()).unwrap();
    workshop.commit("strokes");
    let heard = wait_for(&mut workshop, is_saved);
    // Room for one is made, and room for all is not to be had. What was applied before comes again each time.
    assert_eq!(letters(&heard), "ewWewer-es");
    assert!(!workshop.is_unsaved());
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(3)]));
}

#[test]
fn who_else_has_the_file_is_told() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let taken = EditSession::open(&land.path).unwrap();
    stroke(&mut workshop, 1);
    let News::NotOpened(error) = wait(&mut workshop) else { panic!() };
    assert!(error.to_string().contains("another program is writing"), "{error}");
    drop(taken);
    stroke(&mut workshop, 2);
    assert!(matches!(wait(&mut workshop), News::Edited(_)));
    workshop.close().1.unwrap();
    let mut other = EditSession::open(&land.path).unwrap();
    other.apply(&[crater(3)]).unwrap();
    other.commit("elsewhere").unwrap();
    drop(other);
    stroke(&mut workshop, 4);
    let News::NotOpened(error) = wait(&mut workshop) else { panic!() };
    assert!(error.to_string().contains("another program has edited it"), "{error}");
}

/// A file that was rewritten begins its generations anew, in another scale.
#[test]
fn a_file_that_another_rewrote_is_not_edited() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let on_show = land.open().header().generation;
    let room = HeightRoom { lowest_m: -9000.0, highest_m: 9000.0 };
    let header = widen(&SystemDisk, &land.path, room, 512, &Silent).unwrap();
    assert_eq!(header.generation, on_show);
    stroke(&mut workshop, 1);
    let News::NotOpened(error) = wait(&mut workshop) else { panic!() };
    assert!(error.to_string().contains("another program has edited it"), "{error}");
}
