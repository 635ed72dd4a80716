//! Power cuts at every moment between two calls of the disk: what was not synced is lost, or arrives in part and out of order. What was told as durable is there, and what is there is one of
//! the states that were meant.

mod common;

use common::MemoryDem;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, HeightRoom, build_on};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect, compact, widen};
use terrasoar_layout::file::disk::{Disk, ForgetfulDisk, PowerCut, SystemDisk};
use terrasoar_layout::imagery::{DrapeOptions, Imagery, MemoryImage, Paint, Scorch, drape_on};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// Seeds of what arrives: nothing, everything, and some of it in several ways.
const SEEDS: u64 = 8;

fn build_at(disk: &dyn Disk, path: &Path, tilt: u32) {
    let dem = MemoryDem::from_fn([110, 70], SampleType::I16, |x, y| {
        f64::from((x * 7 + y * 13) % 100 + tilt * x / 3 + y / 2)
    });
    let options = BuildOptions::default().spacing_m([10.0; 2]);
    build_on(disk, &dem, path, &options, &Silent).unwrap();
}

fn build_packed_at(path: &Path) {
    let dem = MemoryDem::from_fn([110, 70], SampleType::I16, |x, y| {
        f64::from((x * 7 + y * 13) % 100 + x / 3 + y / 2)
    });
    let options = BuildOptions::default().spacing_m([10.0; 2]).packed(true);
    build_on(&SystemDisk, &dem, path, &options, &Silent).unwrap();
}

/// Makes a terrain to begin with.
fn prepare(is_packed: bool) -> impl Fn(&Path) {
    move |path| if is_packed { build_packed_at(path) } else { build_at(&SystemDisk, path, 1) }
}

const FORMS: [bool; 2] = [false, true];

fn image(seed: u32) -> MemoryImage {
    MemoryImage::from_fn([300, 200], move |x, y| [x as u8, y as u8, (x / 16 + seed) as u8, 255])
}

fn set(i: u32) -> Edit {
    let (west, south) = (i * 37 % 90, i * 53 % 60);
    let rect = SampleRect { west, south, east: west + 9, north: south + 7 };
    Edit::Set { area: Area::Rect(rect), height_m: f64::from(20 + i % 60) }
}

fn open(base: &Path, overlay: Option<&Path>) -> Result<Terrain, LayoutError> {
    match overlay {
        Some(overlay) => Terrain::open_with_overlay_unmapped(base, overlay),
        None => Terrain::open_unmapped(base),
    }
}

/// Everything that a reader sees: heights, errors and the picture; `None` if the file is not there.
fn seen(base: &Path, overlay: Option<&Path>) -> Option<Vec<u8>> {
    if !overlay.unwrap_or(base).exists() {
        return None;
    }
    let terrain = open(base, overlay).unwrap();
    let report = verify(&terrain, &|_| {}).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems);
    // The file itself says that a header which was torn was never told as durable.
    assert!(report.lost_header.is_none_or(|lost| lost.was_saved == Some(false)), "{:?}", report.lost_header);
    let pages = terrain.header().record_pages();
    let mut seen: Vec<u8> =
        (0..pages).flat_map(|page| terrain.checked_page(page).unwrap().to_vec()).collect();
    if let Some(imagery) = Imagery::open(&terrain).unwrap() {
        for id in imagery.shape().ids() {
            let mut tile = Vec::new();
            imagery.read_tile(&terrain, id, &mut tile).unwrap();
            seen.extend(tile);
        }
    }
    Some(seen)
}

/// Damages each header of what a power cut left in turn. How often one was lost that had been told as durable, at `generation`; the file says so each time.
fn lose_headers(base: &Path, overlay: Option<&Path>, generation: u32) -> usize {
    let Ok(terrain) = open(base, overlay) else { return 0 };
    let newest = terrain.header().generation;
    let file = overlay.unwrap_or(base);
    let whole = std::fs::read(file).unwrap();
    let mut times = 0;
    for slot in 0..2 {
        let mut bytes = whole.clone();
        bytes[slot * 4096 + 0x20] ^= 1;
        std::fs::write(file, bytes).unwrap();
        // Where no header is left, nothing is shown.
        let Ok(terrain) = open(base, overlay) else { continue };
        if newest == generation && terrain.header().generation < newest {
            let lost = terrain.lost_header().unwrap();
            assert!(lost.is_some_and(|lost| lost.may_have_been_saved()), "{lost:?} of {generation}");
            times += 1;
        }
    }
    times
}

/// What happens, and what is seen after each step of it.
struct Story {
    folder: tempfile::TempDir,
    disk: Arc<ForgetfulDisk>,
    overlay: Option<&'static str>,
    states: Vec<Option<Vec<u8>>>,
    /// Of the header that leads to a state.
    generations: Vec<u32>,
}

impl Story {
    fn begin(prepare: impl FnOnce(&Path), overlay: Option<&'static str>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        prepare(&folder.path().join("t.iqt"));
        let disk = Arc::new(ForgetfulDisk::watching(folder.path()).unwrap());
        let mut story = Self { folder, disk, overlay, states: Vec::new(), generations: Vec::new() };
        story.note();
        story
    }

    fn terrain(&self) -> PathBuf {
        self.folder.path().join("t.iqt")
    }

    fn disk(&self) -> Arc<dyn Disk + Send> {
        Arc::clone(&self.disk) as _
    }

    fn session(&self) -> EditSession {
        match self.overlay {
            Some(name) => {
                EditSession::open_overlay_on(self.disk(), &self.terrain(), &self.folder.path().join(name))
            }
            None => EditSession::open_on(self.disk(), &self.terrain()),
        }
        .unwrap()
    }

    fn files_in(&self, folder: &Path) -> (PathBuf, Option<PathBuf>) {
        (folder.join("t.iqt"), self.overlay.map(|name| folder.join(name)))
    }

    fn seen_in(&self, folder: &Path) -> Option<Vec<u8>> {
        let (base, overlay) = self.files_in(folder);
        seen(&base, overlay.as_deref())
    }

    fn note(&mut self) {
        let (base, overlay) = self.files_in(self.folder.path());
        self.states.push(seen(&base, overlay.as_deref()));
        self.generations
            .push(open(&base, overlay.as_deref()).map_or(0, |terrain| terrain.header().generation));
    }

    /// A step has ended, and whoever asked for it was told that it is durable.
    fn told(&mut self) {
        self.note();
        self.disk.promise(self.states.len() - 1);
    }

    /// Cuts the power after every call; of files that are `appended` to, damages headers then, too.
    fn check(&self, is_appended: bool) {
        let (mut images, mut lost) = (0, 0);
        for after in 0..=self.disk.calls() {
            for seed in 0..SEEDS {
                let found = tempfile::tempdir().unwrap();
                let told = self.disk.lay_out(PowerCut { after, seed }, found.path()).unwrap();
                let there = self.seen_in(found.path());
                let meant = &self.states[told..(told + 2).min(self.states.len())];
                assert!(
                    meant.contains(&there),
                    "after call {after} of {}, seed {seed}: not one of the states {told} and {}",
                    self.disk.calls(),
                    told + 1
                );
                images += 1;
                if is_appended {
                    let (base, overlay) = self.files_in(found.path());
                    lost += lose_headers(&base, overlay.as_deref(), self.generations[told]);
                }
            }
        }
        assert!(images > 4 * SEEDS && (!is_appended || lost > SEEDS as usize), "{images}, {lost}");
    }
}

#[test]
fn edits_undone_and_redone() {
    for (overlay, is_packed) in [None, Some("o.iqo")].into_iter().flat_map(|o| FORMS.map(|form| (o, form))) {
        let mut story = Story::begin(prepare(is_packed), overlay);
        let mut session = story.session();
        if overlay.is_some() {
            // An overlay without edits shows what the base does; that it is there is told too.
            story.told();
        }
        for step in 0..7 {
            match step {
                2 | 3 => drop(session.undo().unwrap()),
                4 => drop(session.redo().unwrap()),
                _ => drop(session.apply(&[set(step), set(step + 20)]).unwrap()),
            }
            session.commit("step").unwrap();
            story.told();
        }
        assert!(story.states.windows(2).all(|pair| pair[0] != pair[1]) || overlay.is_some());
        story.check(true);
    }
}

#[test]
fn pictures_and_paint() {
    for is_packed in FORMS {
        let mut story = Story::begin(prepare(is_packed), None);
        let options = DrapeOptions::default();
        let drape = |story: &mut Story, seed| {
            drape_on(&*story.disk, &story.terrain(), &[Box::new(image(seed))], &options, &Silent).unwrap();
            story.told();
        };
        drape(&mut story, 1);
        let mut session = story.session();
        for step in 0..3 {
            let scorch = Paint::Scorch(Scorch {
                centre_m: [200.0 + 150.0 * f64::from(step), 300.0],
                radius_m: 60.0,
                direction_deg: 40.0,
                strength: 0.9,
            });
            session.apply_and_paint(&[set(step)], &[scorch]).unwrap();
            session.commit("scorch").unwrap();
            story.told();
        }
        session.undo().unwrap();
        story.told();
        drop(session);
        drape(&mut story, 2);
        assert!(story.states.windows(2).all(|pair| pair[0] != pair[1]));
        story.check(true);
    }
}

#[test]
fn builds_new_and_in_the_place_of_others() {
    let mut story = Story::begin(|_| {}, None);
    for tilt in 0..3 {
        build_at(&*story.disk, &story.terrain(), tilt);
        story.told();
    }
    assert!(story.states[0].is_none() && story.states.windows(2).all(|pair| pair[0] != pair[1]));
    story.check(false);
}

/// A file that is written anew and commits before and after it.
#[test]
fn files_written_anew() {
    for (is_widened, is_packed) in FORMS.into_iter().flat_map(|is| FORMS.map(|form| (is, form))) {
        let edited = |path: &Path| {
            prepare(is_packed)(path);
            let mut session = EditSession::open(path).unwrap();
            session.apply(&[set(1)]).unwrap();
            session.commit("before").unwrap();
        };
        let mut story = Story::begin(edited, None);
        let commit = |story: &mut Story, i: u32| {
            let mut session = story.session();
            session.apply(&[set(i)]).unwrap();
            session.commit("set").unwrap();
            story.told();
        };
        commit(&mut story, 2);
        let path = story.terrain();
        if is_widened {
            let room = HeightRoom { lowest_m: -900.0, highest_m: 0.0 };
            widen(&*story.disk, &path, room, 512, &Silent).unwrap();
        } else {
            compact(&*story.disk, &path, None, &path, &Silent).unwrap();
        }
        story.told();
        // What is committed now goes into the new file; if that could vanish, this would with it.
        commit(&mut story, 3);
        commit(&mut story, 4);
        story.check(false);
    }
}
