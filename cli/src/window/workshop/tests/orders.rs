//! What becomes of orders: at once for the window, in order, and on the disk when it is told.

use super::*;
use crate::window::threads::while_frames_have_all_threads;
use terrasoar_layout::edit::history;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::imagery::{DrapeOptions, ImageSource, Imagery, MemoryImage, TileFormat, TileId, drape};
use terrasoar_scene::repaint::Picture;

#[test]
fn the_window_never_waits_for_a_slow_disk_and_edits_are_seen_before_they_are_saved() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    mood.slow_ms.store(250, Ordering::Relaxed);
    let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
    let slow_open = Arc::clone(&workshop.open);
    workshop.open = Arc::new(move || {
        std::thread::sleep(Duration::from_millis(800));
        slow_open()
    });
    let mut edits = Vec::new();
    let (mut seen, mut seen_before_saved, mut saved) = (0, 0, 0);
    for i in 1..=30 {
        let begun = Instant::now();
        edits.push(stroke(&mut workshop, i));
        workshop.commit("a stroke");
        while let Some(news) = workshop.take() {
            match news {
                News::Edited(_) => seen += 1,
                News::Saved { .. } => saved += 1,
                other => panic!("{other:?}"),
            }
        }
        let took = begun.elapsed();
        assert!(took < AT_ONCE, "stroke {i} kept the window for {took:?}");
        if saved == 0 {
            seen_before_saved = seen;
        }
        std::thread::sleep(Duration::from_millis(60));
    }
    assert!(seen_before_saved >= 3, "only {seen_before_saved} strokes were seen while the first was written");
    assert!(workshop.is_unsaved());
    let (news, closed) = workshop.close();
    closed.unwrap();
    assert!(!workshop.is_unsaved() && workshop.in_flight() == 0);
    seen += news.iter().filter(|news| matches!(news, News::Edited(_))).count();
    assert_eq!(seen, 30);
    assert!(land.pages() == land.pages_after(&edits));
    assert!(history(&land.open()).unwrap().len() >= 2, "several commits");
}

#[test]
fn what_is_told_as_saved_is_on_the_disk_where_it_says() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let opened = land.open();
    let mut last = 0;
    for i in 1..8 {
        stroke(&mut workshop, 2 * i);
        stroke(&mut workshop, 2 * i + 1);
        workshop.commit("two");
        // One that is under way while the commit is.
        stroke(&mut workshop, 100 + i);
        for news in wait_for(&mut workshop, is_saved) {
            let News::Saved { places, .. } = news else { continue };
            let terrain = land.open();
            assert!(terrain.header().generation > last && terrain.header().state() == workshop.on_show);
            last = terrain.header().generation;
            assert!(!places.is_empty());
            for (page, entry) in places {
                assert_eq!(terrain.entry(page).unwrap(), entry);
                // Whoever opened the file before can read it there.
                assert_eq!(opened.checked_page_at(page, entry).unwrap(), terrain.checked_page(page).unwrap());
            }
        }
    }
    workshop.close().1.unwrap();
}

#[test]
fn pages_that_were_edited_while_they_were_written_are_not_told_as_the_files() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    mood.slow_ms.store(100, Ordering::Relaxed);
    let mut workshop = land.workshop_on(Arc::new(TestDisk(mood)));
    stroke(&mut workshop, 1);
    workshop.commit("first");
    // The same place again, and another.
    workshop.apply(2, vec![crater(1)], Vec::new()).unwrap();
    let mut edited: Vec<Vec<u64>> = Vec::new();
    let mut told = Vec::new();
    for news in wait_for(&mut workshop, is_saved) {
        match news {
            News::Edited(seen) => {
                edited.push(seen.ground.pages.iter().map(|(page, _)| *page).collect());
                assert!(seen.ground.places.is_empty());
            }
            News::Saved { places, .. } => told = places,
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(edited.len(), 2);
    assert!(told.iter().all(|(page, _)| !edited[1].contains(page)), "{told:?} {:?}", edited[1]);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(1)]));
}

#[test]
fn undo_and_redo_come_after_everything_before_and_bring_pages_and_places() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    mood.slow_ms.store(150, Ordering::Relaxed);
    let mut workshop = land.workshop_on(Arc::new(TestDisk(mood)));
    for i in 1..=3 {
        stroke(&mut workshop, i);
        workshop.commit("a stroke");
    }
    stroke(&mut workshop, 4);
    let begun = Instant::now();
    for back in [true, true, false] {
        workshop.turn(back).unwrap();
    }
    stroke(&mut workshop, 5);
    assert!(begun.elapsed() < AT_ONCE);
    let mut names = String::new();
    for _ in 0..20 {
        match wait(&mut workshop) {
            News::Edited(_) => names.push('e'),
            News::Saved { .. } => {}
            News::Turned { back, seen } => {
                names.push(if back { 'u' } else { 'r' });
                let terrain = land.open();
                let opened: Vec<(u64, Entry)> = seen
                    .ground
                    .pages
                    .iter()
                    .map(|(page, _)| (*page, terrain.entry(*page).unwrap()))
                    .collect();
                assert_eq!(seen.ground.places, opened);
                assert!(!opened.is_empty() && seen.trouble.is_none());
                for (page, bytes) in &seen.ground.pages {
                    assert!(**bytes == *terrain.checked_page(*page).unwrap());
                }
            }
            other => panic!("{other:?}"),
        }
        if names.len() == 8 {
            break;
        }
    }
    assert_eq!(names, "eeeeuure");
    let all_back = |workshop: &mut Workshop| {
        for _ in 0..9 {
            workshop.turn(true).unwrap();
        }
        wait_for(workshop, |news| matches!(news, News::NothingToTurn { back: true }));
    };
    all_back(&mut workshop);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[]));
    // Closed and opened again by the next order, on the same terrain on show.
    workshop.turn(false).unwrap();
    assert!(matches!(wait(&mut workshop), News::Turned { back: false, .. }));
    workshop.close().1.unwrap();
    assert!(land.pages() != land.pages_after(&[]));
}

/// The second thread and the encoding of tiles for it take none of the threads that frames have.
#[test]
fn paint_goes_with_the_ground_and_waits_for_no_frame() {
    let land = Land::new();
    let picture = MemoryImage::from_fn([512, 512], |x, y| [150, 160, (x / 8 * y / 8 % 90) as u8, 255]);
    let pictures: Vec<Box<dyn ImageSource>> = vec![Box::new(picture)];
    let options = DrapeOptions::default().format(TileFormat::Rgba8);
    drape(&land.path, &pictures, &options, &Silent).unwrap();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    while_frames_have_all_threads(|| {
        let Edit::Crater(crater) = crater(3) else { unreachable!() };
        workshop.apply(1, vec![Edit::Crater(crater)], vec![Paint::scorch_of(&crater)]).unwrap();
        let News::Edited(seen) = wait(&mut workshop) else { panic!() };
        let painted = seen.picture.unwrap();
        assert!(seen.trouble.is_none() && !painted.tiles.is_empty());
        assert_eq!(painted.painted.len(), painted.tiles.len(), "all in memory");
        workshop.commit("a crater");
        let News::Saved { picture, .. } = wait(&mut workshop) else { panic!() };
        let saved = picture.unwrap().unwrap();
        assert!(saved.painted.is_empty() && saved.tiles.is_empty(), "all in the file, and the same");
        let Picture::Moved(now) = saved.picture else { panic!() };
        let terrain = land.open();
        let mut tiles = [Vec::new(), Vec::new(), Vec::new()];
        let id = *painted.tiles.first().unwrap();
        painted.painted[0].1.read(&mut tiles[0]);
        now.imagery.read_tile(&now.terrain, id, &mut tiles[1]).unwrap();
        Imagery::open(&terrain).unwrap().unwrap().read_tile(&terrain, id, &mut tiles[2]).unwrap();
        assert!(!tiles[0].is_empty() && tiles[0] == tiles[1] && tiles[1] == tiles[2]);
        workshop.turn(true).unwrap();
        let News::Turned { seen, .. } = wait(&mut workshop) else { panic!() };
        let undone = seen.picture.unwrap();
        assert!(undone.painted.is_empty() && undone.tiles == painted.tiles);
        let read: Vec<TileId> = undone.read.iter().map(|(id, _)| *id).collect();
        assert!(!read.is_empty() && read.iter().all(|id| undone.tiles.contains(id)), "read on that thread");
        assert!(undone.read.iter().any(|(other, texels)| *other == id && texels.as_ref() != Some(&tiles[0])));
        workshop.close().1.unwrap();
    });
}
