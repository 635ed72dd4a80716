//! Ground as one thing: a copy of its mesh never falls behind unnoticed, and edits are seen at once, saved in the background and never lost in silence.

mod common;

use common::rugged;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use terrasoar::ground::{MeshChange, MeshStep, PictureEngine};
use terrasoar::refine::Culling;
use terrasoar::refine::kinetic::Patch;
use terrasoar::{Crater, Edit, Error, Ground, MappedTerrain, StreamOptions, Terrain, View};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::EditSession;
use terrasoar_layout::mix::Random;
use terrasoar_layout::progress::Silent;

const SPACING_M: f64 = 10.0;
const SIDE: u32 = 257;

fn land() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("land.iqt");
    let dem = MemoryDem::from_fn([SIDE; 2], SampleType::I16, |x, y| rugged(3, x, y));
    build(&dem, &path, &BuildOptions::default().spacing_m([SPACING_M; 2]), &Silent).unwrap();
    (folder, path)
}

fn streamed(path: &Path) -> Ground<'static> {
    Terrain::open(path).unwrap().stream(StreamOptions::default().cache_mib(4)).unwrap()
}

fn view(step: u32) -> View {
    let t = f64::from(step);
    View::new([1280.0 + 15.0 * t, 400.0 + 25.0 * t, 900.0 - 3.0 * t], 7.0 * t, -25.0).tolerance_px(2.0)
}

/// Updates until nothing is late.
fn settle(ground: &mut Ground<'_>, view: &View) {
    let begun = std::time::Instant::now();
    while ground.update(view).work.late > 0 || ground.is_waiting() {
        assert!(begun.elapsed().as_secs() < 30, "pages do not come");
        std::thread::yield_now();
    }
}

/// A copy of a mesh, as a device would have it.
#[derive(Default)]
struct Copy {
    seen: Option<MeshStep>,
    vertices: BTreeMap<u32, [u32; 3]>,
    triangles: BTreeMap<u32, [u32; 3]>,
    draws: Vec<std::ops::Range<u32>>,
    wholes: u32,
    patches: u32,
}

impl Copy {
    fn follow(&mut self, ground: &Ground<'_>) {
        match ground.change_since(self.seen) {
            MeshChange::Same => {}
            MeshChange::Patch(patch) => {
                self.patches += 1;
                self.apply(patch);
            }
            MeshChange::Whole(patch) => {
                self.wholes += 1;
                (self.vertices, self.triangles) = Default::default();
                self.apply(&patch);
            }
        }
        self.seen = Some(ground.step());
    }

    fn apply(&mut self, patch: &Patch) {
        self.vertices
            .extend(patch.vertices.iter().map(|(slot, v)| (*slot, [v.x, v.y, v.height_m.to_bits()])));
        self.triangles.extend(patch.triangles.iter().copied());
        self.draws.clone_from(&patch.draws);
    }

    /// The triangles that are drawn, by their corners in a fixed turn.
    fn drawn(&self) -> BTreeSet<[[u32; 3]; 3]> {
        let slots = self.draws.iter().flat_map(|range| self.triangles.range(range.clone()));
        let corners = slots.filter(|(_, [a, b, _])| a != b).map(|(_, c)| c.map(|slot| self.vertices[&slot]));
        corners.map(turned).collect()
    }
}

fn turned([a, b, c]: [[u32; 3]; 3]) -> [[u32; 3]; 3] {
    let least = a.min(b).min(c);
    if a == least {
        [a, b, c]
    } else if b == least {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

fn whole(ground: &Ground<'_>) -> BTreeSet<[[u32; 3]; 3]> {
    let mut copy = Copy::default();
    copy.follow(ground);
    copy.drawn()
}

#[test]
fn a_copy_that_misses_updates_gets_the_whole_mesh() {
    let (_folder, path) = land();
    let mapped = MappedTerrain::open(&path).unwrap();
    let grounds = [
        streamed(&path),
        mapped.ground(PictureEngine::Kinetic, Culling::Clusters).unwrap(),
        mapped.ground(PictureEngine::Soar, Culling::Vertices).unwrap(),
    ];
    for mut ground in grounds {
        let (mut copy, mut random) = (Copy::default(), Random::new(5));
        for step in 0..40 {
            ground.update(&view(step));
            if random.below(3) > 0 {
                copy.follow(&ground);
                assert!(copy.drawn() == whole(&ground), "step {step}");
                copy.follow(&ground);
            }
            if step == 20 {
                // Where it can be changed, all that was known of slots is void.
                ground.set_culling(Culling::Vertices);
            }
        }
        assert!(copy.wholes > 3 && copy.patches > 5, "{} wholes, {} patches", copy.wholes, copy.patches);
    }
}

#[test]
fn rays_meet_the_ground_where_small_steps_along_them_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("holes.iqt");
    let dem = MemoryDem::from_fn([101, 81], SampleType::F32, |x, y| {
        let is_void = (40..47).contains(&x) && (30..36).contains(&y);
        if is_void { f64::NAN } else { 3.0 * rugged(5, x, y) }
    });
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0, 8.0]), &Silent).unwrap();
    let mapped = MappedTerrain::open(&path).unwrap();
    let ground = mapped.ground(PictureEngine::Soar, Culling::Vertices).unwrap();
    let [low, high] = ground.height_range_m();
    let mut random = Random::new(17);
    let mut part =
        |from: f64, to: f64| from + (to - from) * random.below(1 << 20) as f64 / f64::from(1 << 20);
    let (mut hits, mut misses) = (0, 0);
    for round in 0..400 {
        let from = [part(-100.0, 1100.0), part(-100.0, 750.0), part(low - 20.0, high + 300.0)];
        let mut direction = [part(-1.0, 1.0), part(-1.0, 1.0), part(-1.5, 0.1)];
        if round % 10 == 0 {
            // Straight down, and along lines of samples.
            direction = [[0.0, 0.0, -2.0], [1.0, 0.0, -0.05], [0.0, -1.0, -0.1]][round / 10 % 3];
        }
        let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        let at = |t: f64| [0, 1, 2].map(|axis| from[axis] + t * direction[axis] / length);
        let above = |t: f64| {
            let [x, y, z] = at(t);
            ground.height_at(x, y).height_m.map(|height| z - height)
        };
        let found = ground.ray_hit(from, direction, 2500.0);
        // The oracle: steps of 5 cm, then halves.
        let mut wanted = None;
        let mut before = above(0.0);
        for step in 1..=50_000 {
            let t = f64::from(step) * 0.05;
            let now = above(t);
            if let (Some(a), Some(b)) = (before, now)
                && (a > 0.0) != (b > 0.0)
            {
                let (mut from, mut to) = (t - 0.05, t);
                for _ in 0..40 {
                    let middle = 0.5 * (from + to);
                    if above(middle).is_some_and(|v| (v > 0.0) == (a > 0.0)) {
                        from = middle
                    } else {
                        to = middle
                    }
                }
                wanted = Some(to);
                break;
            }
            before = now;
        }
        match (found, wanted) {
            (Some(hit), Some(t)) => {
                hits += 1;
                assert!(
                    hit.is_exact && (hit.distance_m - t).abs() < 0.06,
                    "{from:?} {direction:?}: {hit:?}, {t}"
                );
                let ground_m = ground.height_at(hit.place_m[0], hit.place_m[1]).height_m.unwrap();
                assert!((ground_m - hit.place_m[2]).abs() < 1e-6, "{hit:?}: {ground_m}");
            }
            (None, None) => misses += 1,
            // Steps of the oracle may pass over a ridge that a ray cuts, and over the rim of the terrain.
            (Some(hit), None) => assert!(
                above(hit.distance_m).is_none_or(|v| v.abs() < 1e-6),
                "{from:?} {direction:?}: {hit:?}"
            ),
            (None, Some(t)) => panic!("{from:?} {direction:?}: nothing, and {t}"),
        }
    }
    assert!(hits > 60 && misses > 50, "{hits} hits, {misses} misses");
    let eye = [500.0, 400.0, high + 100.0];
    assert!(
        ground.ray_hit(eye, [0.0, 0.0, 1.0], 1e9).is_none() && ground.ray_hit(eye, [0.0; 3], 1e9).is_none()
    );
    assert!(ground.ray_hit(eye, [0.0, 0.0, -1.0], 1.0).is_none(), "too far");
}

#[test]
fn triangles_in_metres_cover_the_terrain_once() {
    let (_folder, path) = land();
    let mut ground = streamed(&path);
    settle(&mut ground, &view(0));
    let (mut area, mut count) = (0.0, 0_u64);
    ground.for_each_triangle(&mut |[a, b, c]| {
        let twice = (b - a).truncate().perp_dot((c - a).truncate());
        assert!(twice > 0.0, "counter-clockwise");
        assert!([a, b, c].iter().all(|p| ground.height_at(p.x, p.y).height_m.unwrap() - p.z < 1e-3));
        area += 0.5 * twice;
        count += 1;
    });
    let side_m = SPACING_M * f64::from(SIDE - 1);
    assert!((area - side_m * side_m).abs() < 1e-3, "{area}");
    assert_eq!(count, ground.update(&view(0)).triangles);
}

/// A game may fold its window away, or divide by nothing. The ground stays as it was, and is right again with the next view.
#[test]
fn views_of_nonsense_change_nothing() {
    let (_folder, path) = land();
    let mapped = MappedTerrain::open(&path).unwrap();
    let good = view(3);
    let mut nonsense = vec![good.fov_deg(180.0), good.viewport([0, 600]), good.viewport([800, 0])];
    for n in [f64::NAN, f64::NEG_INFINITY] {
        nonsense.extend([View::new([n, 0.0, 0.0], 0.0, 0.0), View::new([0.0; 3], n, 0.0)]);
        nonsense.extend([View::new([0.0; 3], 0.0, n), good.roll_deg(n)]);
    }
    for n in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        nonsense.extend([good.fov_deg(n), good.tolerance_px(n), good.exaggeration(n)]);
    }
    let all_engines = [PictureEngine::Kinetic, PictureEngine::Soar];
    let mapped = all_engines
        .into_iter()
        .flat_map(|engine| Culling::ALL.map(|culling| mapped.ground(engine, culling).unwrap()));
    for mut ground in mapped.chain([streamed(&path)]) {
        for bad in &nonsense {
            assert!(!bad.is_sound(), "{bad:?}");
            assert_eq!(ground.update(bad).triangles, 0, "{bad:?}");
            assert_eq!(ground.view(), None);
        }
        assert!(good.is_sound());
        settle(&mut ground, &good);
        let triangles = whole(&ground);
        let count = ground.update(&good).triangles;
        assert!(triangles.len() > 100);
        for bad in &nonsense {
            ground.update(bad);
            assert!(whole(&ground) == triangles, "{bad:?}");
            assert_eq!(ground.view(), Some(&good));
        }
        settle(&mut ground, &view(5));
        settle(&mut ground, &good);
        // Which clusters triangles lie in, and so which are drawn, may differ by now.
        assert_eq!(ground.update(&good).triangles, count);
    }
}

fn crater(x: f64, y: f64) -> Edit {
    Edit::Crater(Crater { centre_m: [x, y], direction_deg: 0.0, radius_m: 60.0, depth_m: 20.0 })
}

/// Heights that a file has now.
fn heights_in(path: &Path) -> Vec<Option<f64>> {
    let terrain = Terrain::open(path).unwrap();
    (0..SIDE).map(|i| terrain.height_m(f64::from(i) * SPACING_M, 1200.0).unwrap()).collect()
}

/// Heights of the ground, once their pages have come.
fn heights_of(ground: &mut Ground<'_>) -> Vec<Option<f64>> {
    let begun = std::time::Instant::now();
    let at = |i: u32| (f64::from(i) * SPACING_M, 1200.0);
    loop {
        let heights: Vec<_> = (0..SIDE).map(|i| ground.height_at(at(i).0, at(i).1)).collect();
        if heights.iter().all(|height| height.is_exact) {
            return heights.iter().map(|height| height.height_m).collect();
        }
        (0..SIDE).for_each(|i| ground.want_height(at(i).0, at(i).1));
        ground.update(&view(0));
        assert!(begun.elapsed().as_secs() < 30, "pages do not come");
    }
}

#[test]
fn edits_are_seen_at_once_saved_by_a_ticket_and_taken_back() {
    let (_folder, path) = land();
    let mut ground = streamed(&path);
    settle(&mut ground, &view(0));
    let before = heights_in(&path);
    ground.edit(&[crater(800.0, 1200.0), crater(1500.0, 1210.0)]).unwrap();
    assert!(!ground.is_saved());
    settle(&mut ground, &view(1));
    let after = heights_of(&mut ground);
    assert!(after != before);
    assert!(heights_in(&path) == before, "in memory so far");
    let ticket = ground.commit("two craters").unwrap();
    // Edits go on while it is written.
    ground.edit(&[crater(2000.0, 1190.0)]).unwrap();
    let saved = ticket.wait().unwrap();
    assert!(saved.pages > 0 && saved.bytes > 0 && ticket.is_done());
    assert!(heights_in(&path) == after);
    assert!(!ground.is_saved(), "the third crater is in memory");
    assert!(ground.undo().is_err(), "not while edits are in memory");
    let ticket = ground.commit("a third").unwrap();
    assert_eq!(ticket.clone().wait().unwrap(), ticket.outcome().unwrap().unwrap());
    settle(&mut ground, &view(2));
    assert!(ground.is_saved() && ground.held_pages() == 0);
    assert!(heights_in(&path) == heights_of(&mut ground));
    assert!(ground.undo().unwrap() && ground.undo().unwrap());
    assert!(!ground.undo().unwrap(), "there is no more");
    settle(&mut ground, &view(3));
    assert!(heights_of(&mut ground) == before && heights_in(&path) == before);
    assert!(ground.redo().unwrap());
    settle(&mut ground, &view(3));
    assert!(heights_of(&mut ground) == after && heights_in(&path) == after);
    let nothing = ground.commit("nothing").unwrap();
    assert_eq!(nothing.wait().unwrap().pages, 0);
    assert_eq!(ground.take_error().map(|e| e.to_string()), None);
}

#[test]
fn ground_that_goes_leaves_its_commit_on_the_disk() {
    let (_folder, path) = land();
    for round in 0..8 {
        let mut ground = streamed(&path);
        ground.update(&view(0));
        ground.edit(&[crater(300.0 + 250.0 * f64::from(round), 1200.0)]).unwrap();
        settle(&mut ground, &view(0));
        let edited = heights_of(&mut ground);
        let ticket = ground.commit("one more").unwrap();
        drop(ground);
        // Whoever dropped it has waited, and the right to edit is free.
        assert!(ticket.is_done());
        ticket.wait().unwrap();
        assert!(heights_in(&path) == edited);
    }
}

#[test]
fn one_at_a_time_edits_and_only_what_is_on_show() {
    let (_folder, path) = land();
    let (mut first, mut second) = (streamed(&path), streamed(&path));
    first.edit(&[crater(800.0, 1200.0)]).unwrap();
    let said = second.edit(&[crater(900.0, 1200.0)]).unwrap_err();
    assert!(matches!(said, Error::Usage(_)) && said.to_string().contains("land.iqt"), "{said}");
    let said = first.end_editing().unwrap_err().to_string();
    assert!(said.contains("commit"), "{said}");
    first.commit("a crater").unwrap();
    first.end_editing().unwrap();
    // The second shows the file as it was.
    let said = second.edit(&[crater(900.0, 1200.0)]).unwrap_err().to_string();
    assert!(said.contains("open it again"), "{said}");
    // The first shows it as it is, and may go on.
    first.edit(&[crater(900.0, 1200.0)]).unwrap();
    first.commit("another").unwrap().wait().unwrap();
    let mapped = MappedTerrain::open(&path).unwrap();
    let mut ground = mapped.ground(Default::default(), Default::default()).unwrap();
    let said = ground.edit(&[crater(900.0, 1200.0)]).unwrap_err().to_string();
    assert!(said.contains("stream it"), "{said}");
    assert!(ground.is_saved() && !ground.set_culling(Culling::Clusters));
}

#[test]
fn ground_of_a_terrain_opened_before_an_edit_is_the_ground_of_then_and_takes_no_edits() {
    let (_folder, path) = land();
    let opened = Terrain::open(&path).unwrap();
    let stream = |terrain: &Terrain| terrain.stream(StreamOptions::default().cache_mib(4)).unwrap();
    let mut first = stream(&opened);
    settle(&mut first, &view(0));
    let before = heights_of(&mut first);
    first.edit(&[crater(800.0, 1200.0)]).unwrap();
    first.commit("a crater").unwrap().wait().unwrap();
    drop(first);
    let mut second = stream(&opened);
    settle(&mut second, &view(0));
    assert!(heights_of(&mut second) == before);
    let refused = second.edit(&[crater(800.0, 1200.0)]).unwrap_err().to_string();
    assert!(refused.contains("open it again"), "{refused}");
    let mut third = streamed(&path);
    settle(&mut third, &view(0));
    assert!(heights_of(&mut third) == heights_in(&path) && heights_of(&mut third) != before);
}

#[test]
fn edits_that_are_refused_change_nothing() {
    let (_folder, path) = land();
    let options = StreamOptions::default().cache_mib(4).room_mib(0);
    let mut ground = Terrain::open(&path).unwrap().stream(options).unwrap();
    settle(&mut ground, &view(0));
    let before = heights_of(&mut ground);
    let deep =
        Edit::Crater(Crater { centre_m: [900.0, 1200.0], direction_deg: 0.0, radius_m: 60.0, depth_m: 1e6 });
    assert!(ground.edit(&[crater(800.0, 1200.0), deep]).is_err());
    settle(&mut ground, &view(1));
    assert!(heights_of(&mut ground) == before);
    assert!(ground.is_saved());
}

#[test]
fn what_is_read_while_edits_go_to_the_disk_is_never_old() {
    let (_folder, path) = land();
    // So little memory that pages come and go.
    let mut ground = Terrain::open(&path).unwrap().stream(StreamOptions::default().cache_bytes(0)).unwrap();
    let mut random = Random::new(11);
    let mut tickets = Vec::new();
    for step in 0..60 {
        ground.update(&view(step % 40));
        let [x, y] = [0, 1].map(|_| 200.0 + random.below(2100) as f64);
        ground.edit(&[crater(x, y)]).unwrap();
        if step % 7 == 3 {
            tickets.push(ground.commit("rain").unwrap());
        }
        ground.want_height(x, y);
    }
    assert!(tickets.iter().all(|ticket| ticket.wait().is_ok()));
    ground.commit("the last").unwrap().wait().unwrap();
    settle(&mut ground, &view(7));
    let file = Terrain::open(&path).unwrap();
    let session = EditSession::open(&path);
    assert!(session.is_err(), "the ground has the right to edit");
    let mut exact = 0;
    for _ in 0..400 {
        let [x, y] = [0, 1].map(|_| (random.below(2560)) as f64);
        ground.want_height(x, y);
        settle(&mut ground, &view(7));
        let height = ground.height_at(x, y);
        if height.is_exact {
            let (here, there) = (height.height_m.unwrap(), file.height_m(x, y).unwrap().unwrap());
            assert!((here - there).abs() < 1e-9, "{x}, {y}: {here} and {there}");
            exact += 1;
        }
    }
    assert!(exact > 300, "{exact}");
}
