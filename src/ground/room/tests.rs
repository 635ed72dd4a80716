//! A disk that fails once, at every call of a rewriting: the ticket, the errors and the file say the same.

use super::super::editing::{Edited, Editing};
use super::super::ticket::CommitTicket;
use super::super::{Ground, StreamOptions};
use super::{Desk, Hand, Maker, Order, Plan};
use crate::view::View;
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Crater, Edit, EditSession};
use terrasoar_layout::file::disk::{FailingDisk, Failure};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

fn crater(x: f64, depth_m: f64) -> Edit {
    Edit::Crater(Crater { centre_m: [x, 640.0], direction_deg: 0.0, radius_m: 50.0, depth_m })
}

fn height_m(path: &Path, x: f64) -> f64 {
    Terrain::open_unmapped(path).unwrap().height_m(x, 640.0).unwrap().unwrap()
}

#[test]
fn whatever_call_fails_nothing_is_told_as_saved_that_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("land.iqt");
    let dem = MemoryDem::from_fn([129; 2], SampleType::I16, |x, y| f64::from(500 + (x * 7 + y * 3) % 90));
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0; 2]), &Silent).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let old = [400.0, 600.0, 800.0].map(|x| height_m(&path, x));
    let view = View::new([600.0, 100.0, 1500.0], 0.0, -40.0);
    let (mut refused, mut unsaved, mut fine) = (0, 0, 0);
    for call in 0..400 {
        // Past the last call nothing fails.
        if fine > 2 {
            break;
        }
        std::fs::write(&path, &whole).unwrap();
        let terrain = Arc::new(Terrain::open_unmapped(&path).unwrap());
        let mut ground = Ground::streamed(terrain, &StreamOptions::default()).unwrap();
        let session = EditSession::open_on(Arc::new(FailingDisk::new(call, Failure::Once)), &path).unwrap();
        ground.editing = Some(Editing::Here(Box::new(Hand::of(session, &path))));
        ground.update(&view);
        ground.edit(&[crater(400.0, 15.0)]).unwrap();
        assert_eq!(ground.edit(&[crater(600.0, 60_000.0)]).unwrap(), Edited::Later);
        ground.edit(&[crater(800.0, 15.0)]).unwrap();
        let outcome = ground.commit("all").unwrap().wait();
        ground.finish_edits();
        let told: Vec<String> = std::iter::from_fn(|| ground.take_error()).map(|e| e.to_string()).collect();
        let deep_is_made = match outcome {
            Ok(_) => {
                fine += 1;
                assert!(ground.is_saved(), "call {call}: {told:?}");
                true
            }
            Err(error) => {
                assert!(!told.is_empty() && error.to_string().contains("land.iqt"), "call {call}: {error}");
                if ground.is_saved() {
                    // The one that there was no room for.
                    refused += 1;
                    false
                } else {
                    unsaved += 1;
                    assert!(told.iter().any(|words| words.contains("in memory")), "call {call}: {told:?}");
                    true
                }
            }
        };
        ground.commit("the rest").unwrap().wait().unwrap();
        ground.update(&view);
        drop(ground);
        let new = [400.0, 600.0, 800.0].map(|x| height_m(&path, x));
        assert!(new[0] < old[0] - 10.0 && new[2] < old[2] - 10.0, "call {call}: {new:?}");
        assert_eq!(new[1] < old[1] - 1000.0, deep_is_made, "call {call}: {new:?}");
        assert!(verify(&Terrain::open_unmapped(&path).unwrap(), &|_| {}).unwrap().is_sound());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "call {call}");
    }
    assert!(refused > 3 && unsaved > 1 && fine > 2, "{refused} refused, {unsaved} not saved, {fine} fine");
}

/// A maker whose terrain is gone when its ground is to be shown, the orders that come meanwhile, and the terrain.
fn maker_without_ground(folder: &Path, orders: Vec<Order>) -> (Maker, Arc<Desk>, std::path::PathBuf) {
    let path = folder.join("land.iqt");
    let dem = MemoryDem::from_fn([129; 2], SampleType::I16, |x, y| f64::from(500 + (x * 7 + y * 3) % 90));
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0; 2]), &Silent).unwrap();
    let session = EditSession::open(&path).unwrap();
    let desk = Arc::new(Desk::default());
    let plan = Plan { options: StreamOptions::default(), view: None };
    let mut maker = Maker::of(Hand::of(session, &folder.join("moved-away.iqt")), plan, Arc::clone(&desk));
    maker.hand.apply(&[crater(400.0, 15.0)]).unwrap();
    desk.papers().orders.extend(orders);
    (maker, desk, path)
}

#[test]
fn edits_that_come_while_ground_is_made_ready_are_saved_where_that_fails() {
    let folder = tempfile::tempdir().unwrap();
    let (ticket, promise) = CommitTicket::promised(Path::new("land.iqt"));
    let orders = vec![
        Order::Edit(vec![crater(800.0, 15.0)]),
        Order::Commit("both".into(), promise),
        Order::Edit(vec![crater(600.0, 15.0), crater(600.0, 60_000.0)]),
        Order::Edit(vec![crater(1000.0, 15.0)]),
    ];
    let (mut maker, desk, path) = maker_without_ground(folder.path(), orders);
    let old = [400.0, 600.0, 800.0, 1000.0].map(|x| height_m(&path, x));
    let told = maker.show().err().unwrap().told().to_string();
    assert!(
        told.contains("moved-away.iqt") && told.ends_with("all edits that were made are on the disk"),
        "{told}"
    );
    assert!(ticket.wait().is_ok());
    let refused = desk.papers().errors.pop_front().unwrap().to_string();
    assert!(refused.contains("hold"), "{refused}");
    assert!(desk.papers().is_closed && desk.papers().orders.is_empty());
    drop(maker);
    let new = [400.0, 600.0, 800.0, 1000.0].map(|x| height_m(&path, x));
    let is_made = [0, 1, 2, 3].map(|i: usize| new[i] < old[i] - 10.0);
    assert_eq!(is_made, [true, false, true, true], "{old:?} {new:?}");
}

#[test]
fn all_edits_that_are_lost_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (ticket, promise) = CommitTicket::promised(Path::new("land.iqt"));
    let orders = vec![Order::Commit("none".into(), promise), Order::Edit(vec![crater(800.0, 15.0); 3])];
    let (maker, desk, path) = maker_without_ground(folder.path(), orders);
    // The file is rewritten; the one that is opened then is not there.
    let told = maker.live(vec![crater(600.0, 60_000.0); 2], [-59_500.0, 589.0]).err().unwrap().to_string();
    // One in memory, two that there was no room for, three that came meanwhile.
    assert!(told.ends_with("6 edits that were not on the disk are lost"), "{told}");
    assert_eq!(ticket.wait().unwrap_err().to_string(), told);
    assert!(desk.papers().is_closed && !desk.papers().is_saved);
    assert!(verify(&Terrain::open_unmapped(&path).unwrap(), &|_| {}).unwrap().is_sound());
}
