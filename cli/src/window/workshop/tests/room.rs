//! Files without room for an edit: rewritten while the window goes on, with every edit in its place.

use super::*;
use terrasoar_layout::edit::{history, room_for, widen};
use terrasoar_layout::file::disk::{FailingDisk, Failure};

/// Land whose records hold its own heights and a few metres more.
fn tight() -> Land {
    Land::between([250.0, 400.0], false)
}

/// Deeper than any record of [`tight`] holds.
fn deep(depth_m: f64) -> Edit {
    Edit::Crater(Crater { centre_m: [900.0; 2], direction_deg: 0.0, radius_m: 300.0, depth_m })
}

/// What these batches come to where somebody rewrites the file by hand before one that needs it. Each is a commit.
fn by_hand(batches: &[&[Edit]]) -> Land {
    let land = tight();
    let mut session = EditSession::open(&land.path).unwrap();
    for batch in batches {
        while let Err(error) = session.apply(batch) {
            let LayoutError::OutOfRange { heights_m, .. } = error else { panic!("{error}") };
            let room = room_for(session.header(), heights_m);
            drop(session);
            widen(&SystemDisk, &land.path, room, 512, &Silent).unwrap();
            session = EditSession::open(&land.path).unwrap();
        }
        session.commit("by hand").unwrap();
    }
    land
}

#[test]
fn the_window_goes_on_while_room_is_made_and_edits_follow_in_their_order() {
    let land = tight();
    let mood = Arc::new(Mood::default());
    let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
    stroke(&mut workshop, 1);
    workshop.commit("first");
    let mut heard = wait_for(&mut workshop, is_saved);
    // Half of a stroke, then what there is no room for.
    workshop.apply(2, vec![crater(2)], Vec::new()).unwrap();
    mood.slow_ms.store(40, Ordering::Relaxed);
    workshop.apply(2, vec![deep(900.0)], Vec::new()).unwrap();
    heard.extend(wait_for(&mut workshop, |news| matches!(news, News::Widening { .. })));
    let Some(News::Widening { words, meter }) = heard.last() else { unreachable!() };
    assert!(words.contains("land.iqt") && words.contains("can no longer be undone"), "{words}");
    let (meter, begun) = (Arc::clone(meter), Instant::now());
    let mut stages = Vec::new();
    while begun.elapsed() < Duration::from_millis(400) {
        stages.push(meter.read());
        assert!(workshop.take().is_none(), "under way");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(stages.iter().any(|(stage, part)| !stage.is_empty() && *part <= 1.0), "{stages:?}");
    let begun = Instant::now();
    workshop.apply(2, vec![crater(3)], Vec::new()).unwrap();
    workshop.commit("second");
    stroke(&mut workshop, 4);
    workshop.commit("third");
    workshop.turn(true).unwrap();
    assert!(begun.elapsed() < AT_ONCE && workshop.is_unsaved() && workshop.in_flight() == 4);
    mood.slow_ms.store(0, Ordering::Relaxed);
    heard.extend(wait_for(&mut workshop, |news| matches!(news, News::Turned { .. })));
    let told = letters(&heard).replace('s', "");
    assert_eq!(told, "eewWeeeet");
    let widened = heard.iter().find_map(|news| match news {
        News::Widened(terrain) => Some(terrain),
        _ => None,
    });
    let widened = widened.unwrap();
    assert!(widened.header().history.is_none() && widened.path() == land.path);
    // What comes after it is of the file as it is then.
    for news in heard.iter().skip_while(|news| !matches!(news, News::Widened(_))) {
        let News::Edited(seen) = news else { continue };
        assert!(seen.trouble.is_none() && !seen.ground.pages.is_empty());
    }
    workshop.close().1.unwrap();
    let second = [crater(2), deep(900.0), crater(3)];
    assert!(land.pages() == by_hand(&[&[crater(1)], &second]).pages());
    // The stroke is one step of undo, whatever was made of the file in the middle of it.
    let labels: Vec<_> = history(&land.open()).unwrap().into_iter().map(|e| (e.label, e.edits)).collect();
    assert_eq!(labels, [("second".to_owned(), 3), ("third".to_owned(), 1)]);
    workshop.turn(false).unwrap();
    wait_for(&mut workshop, |news| matches!(news, News::Turned { back: false, .. }));
    for _ in 0..2 {
        workshop.turn(true).unwrap();
        wait_for(&mut workshop, |news| matches!(news, News::Turned { back: true, .. }));
    }
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[]));
    let widened_by_hand = by_hand(&[&[crater(1)], &second]);
    assert!(land.pages() == widened_by_hand.pages_after(&[]));
}

#[test]
fn whoever_quits_meanwhile_has_everything_on_the_disk() {
    let land = tight();
    let mood = Arc::new(Mood::default());
    mood.slow_ms.store(20, Ordering::Relaxed);
    let mut workshop = land.workshop_on(Arc::new(TestDisk(mood)));
    workshop.apply(1, vec![deep(900.0)], Vec::new()).unwrap();
    stroke(&mut workshop, 2);
    let (news, closed) = workshop.close();
    closed.unwrap();
    assert_eq!(letters(&news).replace('s', ""), "wWee");
    assert!(land.pages() == by_hand(&[&[deep(900.0)], &[crater(2)]]).pages());
}

#[test]
fn what_cannot_be_rewritten_is_as_before_and_goes_on() {
    // The calls before the rewriting are those of no commit: nothing is saved yet.
    for call in [0, 3, 7] {
        let land = tight();
        let before = std::fs::read(&land.path).unwrap();
        let mut workshop = land.workshop_on(Arc::new(FailingDisk::new(call, Failure::Once)));
        stroke(&mut workshop, 1);
        workshop.apply(2, vec![deep(900.0)], Vec::new()).unwrap();
        let heard = wait_for(&mut workshop, |news| matches!(news, News::Refused(_)));
        assert_eq!(letters(&heard), "ewer", "call {call}");
        assert!(std::fs::read(&land.path).unwrap() == before, "call {call}");
        assert!(workshop.is_unsaved());
        stroke(&mut workshop, 3);
        workshop.commit("others");
        wait_for(&mut workshop, is_saved);
        workshop.close().1.unwrap();
        assert!(land.pages() == land.pages_after(&[crater(1), crater(3)]), "call {call}");
    }
}

/// Edits kept apart from a file refer to it as it is.
#[test]
fn nothing_is_rewritten_under_overlays() {
    let land = tight();
    let overlay = land.path.with_extension("iqo");
    drop(EditSession::open_overlay(&land.path, &overlay).unwrap());
    let before = std::fs::read(&land.path).unwrap();
    let on_show = Terrain::open_with_overlay_unmapped(&land.path, &overlay).unwrap();
    let mut over = Workshop::new(&on_show, || {});
    let mut under = land.workshop_on(Arc::new(SystemDisk));
    for workshop in [&mut over, &mut under] {
        stroke(workshop, 1);
        workshop.apply(2, vec![deep(900.0)], Vec::new()).unwrap();
        let heard = wait_for(workshop, |news| matches!(news, News::Refused(_)));
        let Some(News::Refused(error)) = heard.last() else { unreachable!() };
        let words = error.to_string();
        assert!(words.contains("land.iqo") && words.contains("terrasoar compact"), "{words}");
    }
    assert!(std::fs::read(&land.path).unwrap() == before);
    over.close().1.unwrap();
    under.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1)]));
}

/// Ground that is too steep.
#[test]
fn slopes_have_room_made_too() {
    let land = tight();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let pit = |radius_m| {
        Edit::Crater(Crater { centre_m: [900.0; 2], direction_deg: 0.0, radius_m, depth_m: 140.0 })
    };
    let pits = [pit(300.0), pit(20.0)];
    for (number, pit) in (1_u64..).zip(pits.clone()) {
        workshop.apply(number, vec![pit], Vec::new()).unwrap();
        workshop.commit("a pit");
    }
    let (news, closed) = workshop.close();
    closed.unwrap();
    assert!(!letters(&news).contains('r') && letters(&news).contains('W'));
    assert!(land.pages() == by_hand(&[&pits[..1], &pits[1..]]).pages());
}

/// Heights that no file holds.
#[test]
fn what_fits_nowhere_is_refused_and_what_was_made_before_stays() {
    let land = tight();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let abyss = vec![deep(1e7); 60];
    for number in [1, 2] {
        workshop.apply(number, abyss.clone(), Vec::new()).unwrap();
    }
    stroke(&mut workshop, 3);
    workshop.commit("an abyss");
    let (news, closed) = workshop.close();
    closed.unwrap();
    assert_eq!(letters(&news), "wWeweres");
    assert!(land.pages() == by_hand(&[&[&abyss[..], &[crater(3)]].concat()]).pages());
}

/// Another program takes the right to edit while the file is being rewritten: what was in memory is gone, and that is told, with the edits that wait.
#[test]
fn edits_that_are_lost_with_the_session_are_told() {
    let land = tight();
    let (path, opened) = (land.path.clone(), AtomicU64::new(0));
    let open = move || match opened.fetch_add(1, Ordering::Relaxed) {
        0 => EditSession::open(&path),
        _ => Err(LayoutError::Usage(format!("{}: another program edits it", path.display()))),
    };
    let mut workshop = Workshop::with(&land.open(), Arc::new(open), Arc::new(|| {}), spawn);
    stroke(&mut workshop, 1);
    workshop.apply(2, vec![deep(900.0)], Vec::new()).unwrap();
    stroke(&mut workshop, 3);
    let heard = wait_for(&mut workshop, |news| matches!(news, News::Broken(_)));
    let Some(News::Broken(words)) = heard.last() else { unreachable!() };
    assert!(
        words.ends_with("another program edits it; 3 edits were not told as saved and may be gone"),
        "{words}"
    );
    assert!(workshop.apply(4, vec![crater(4)], Vec::new()).unwrap_err().contains("open the terrain again"));
    assert!(!workshop.is_unsaved() && workshop.take().is_none());
    // The file is the new one, without them.
    assert!(land.pages() == land.pages_after(&[]));
}
