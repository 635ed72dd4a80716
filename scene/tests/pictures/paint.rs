//! Paint of an editing session on a draped picture, as a window's scene shows it: in the very next frame, and gone in the next after it is taken back.

use super::rig::view;
use super::{Outcome, Test, ensure};
use std::sync::Arc;
use std::time::{Duration, Instant};
use terrasoar::ground::{Ground, StreamOptions};
use terrasoar::view::View;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Crater, Edit, EditSession};
use terrasoar_layout::imagery::{DrapeOptions, ImageSource, MemoryImage, Paint, Scorch, TileFormat, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{Gpu, Look, Offscreen};
use terrasoar_scene::repaint::PictureWatch;
use terrasoar_scene::scene::{Scene, SceneOptions, TileService};

pub const TESTS: &[Test] = &[
    ("paint::shows_in_the_next_frame_and_goes_in_the_next", in_the_next_frame),
    ("paint::reads_from_before_a_commit_are_thrown_away", reads_from_before),
    ("paint::craters_scorch_only_pictures_that_can_be_painted", scorches),
];

pub const SIZE_PX: [u32; 2] = [320, 240];

/// Level ground of 4 km, with a picture of 2 m a texel, or none.
pub fn land(folder: &tempfile::TempDir, format: Option<TileFormat>) -> Result<std::path::PathBuf, String> {
    let path = folder.path().join("land.iqt");
    let dem = MemoryDem::from_fn([257, 257], SampleType::I16, |x, y| f64::from(x * y % 3));
    let options = BuildOptions::default().spacing_m([16.0; 2]);
    build(&dem, &path, &options, &Silent).map_err(|e| e.to_string())?;
    if let Some(format) = format {
        let picture = MemoryImage::from_fn([2048, 2048], |x, y| {
            let grain = (x * 7 + y * 13) % 32;
            [120 + grain as u8, 140 + (x / 64 % 2 * 40) as u8, 90 + (y / 64 % 2 * 60) as u8, 255]
        });
        let pictures: Vec<Box<dyn ImageSource>> = vec![Box::new(picture)];
        drape(&path, &pictures, &DrapeOptions::default().format(format), &Silent)
            .map_err(|e| e.to_string())?;
    }
    Ok(path)
}

/// A window's scene, and a picture to draw to.
pub struct Window<'a> {
    gpu: &'a Gpu,
    ground: Ground<'static>,
    pub scene: Scene,
    offscreen: Offscreen,
    look: Look,
    watch: PictureWatch,
}

impl<'a> Window<'a> {
    pub fn open(gpu: &'a Gpu, path: &std::path::Path) -> Result<Self, String> {
        let terrain = Arc::new(Terrain::open_unmapped(path).map_err(|e| e.to_string())?);
        let options = SceneOptions::default().tiles(TileService::AFrame(8));
        let ground = Ground::streamed(terrain, &StreamOptions::default()).map_err(|e| e.to_string())?;
        let scene = Scene::new(&ground, gpu, options).map_err(|e| e.to_string())?;
        let offscreen = Offscreen::new(&gpu.device, SIZE_PX).map_err(|e| e.to_string())?;
        Ok(Self {
            gpu,
            ground,
            scene,
            offscreen,
            look: Look::default().imagery(1.0),
            watch: PictureWatch::default(),
        })
    }

    /// Goes on with another device.
    pub fn move_to(&mut self, gpu: &'a Gpu) -> Outcome {
        self.gpu = gpu;
        self.offscreen = Offscreen::new(&gpu.device, SIZE_PX).map_err(|e| e.to_string())?;
        self.scene.recover(gpu).map_err(|e| e.to_string())
    }

    /// Has the scene follow what became of the picture.
    pub fn repainted(&mut self, session: &mut EditSession) -> Outcome {
        match self.watch.look(session).map_err(|e| e.to_string())? {
            Some(repaint) => self.scene.repainted(repaint).map_err(|e| e.to_string()),
            None => Ok(()),
        }
    }

    pub fn frame(&mut self, view: &View) -> Vec<u8> {
        self.ground.update(view);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.scene.sync(&mut self.ground, &mut encoder, view, &self.look).unwrap();
        self.scene.draw(&mut encoder, self.offscreen.target(), view, &self.look, None).unwrap();
        self.gpu.queue.submit([encoder.finish()]);
        self.offscreen.read_rgba(&self.gpu.device, &self.gpu.queue).unwrap()
    }

    pub fn settled(&mut self, view: &View) -> Result<Vec<u8>, String> {
        let begun = Instant::now();
        loop {
            let picture = self.frame(view);
            let is_complete = self.scene.renderer().imagery_stats().missing == 0
                && self.scene.tile_stats().missing == 0
                && !self.ground.is_waiting()
                && !self.scene.is_waiting();
            if is_complete && self.frame(view) == picture {
                return Ok(picture);
            }
            ensure(begun.elapsed() < Duration::from_secs(60), || "what is missing does not come".into())?;
        }
    }
}

pub fn from_above() -> View {
    view([2.0, 2.0, 1.2], [0.0, -90.0, 0.0], 50.0, SIZE_PX)
}

pub fn burn(centre_m: [f64; 2], radius_m: f64) -> Paint {
    Paint::Scorch(Scorch { centre_m, radius_m, direction_deg: 20.0, strength: 0.9 })
}

/// Pixels that differ.
fn differing(a: &[u8], b: &[u8]) -> usize {
    a.chunks_exact(4).zip(b.chunks_exact(4)).filter(|(a, b)| a != b).count()
}

fn in_the_next_frame(gpu: &Gpu) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = land(&folder, Some(TileFormat::Bc1))?;
    let mut session = EditSession::open(&path).map_err(|e| e.to_string())?;
    let mut window = Window::open(gpu, &path)?;
    let view = from_above();
    let before = window.settled(&view)?;

    // Over a corner of four tiles.
    session.paint(&[burn([2016.0, 2080.0], 150.0)]).map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    let burnt = window.frame(&view);
    let seen = differing(&before, &burnt);
    ensure((1000..20_000).contains(&seen), || format!("{seen} pixels differ"))?;
    ensure(window.settled(&view)? == burnt, || "some of it comes late".into())?;
    session.commit("burnt").map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    ensure(window.settled(&view)? == burnt, || "a commit changes the picture".into())?;

    session.undo().map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    ensure(window.frame(&view) == before, || "an undo does not bring the picture back at once".into())?;
    session.redo().map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    ensure(window.frame(&view) == burnt, || "a redo does not bring the paint back at once".into())?;

    session.paint(&[burn([1800.0, 2000.0], 60.0)]).map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    ensure(window.frame(&view) != burnt, || "a second scorch is not seen".into())?;
    // A scene made anew shows what is not in the file too.
    let twice = window.settled(&view)?;
    let mut another = Window::open(gpu, &path)?;
    another.repainted(&mut session)?;
    ensure(another.settled(&view)? == twice, || "a scene made anew shows another picture".into())?;
    session.discard();
    window.repainted(&mut session)?;
    ensure(window.frame(&view) == burnt, || "what is taken back stays".into())?;

    // Another device has nothing of it and shows the same.
    window.scene.recover(gpu).map_err(|e| e.to_string())?;
    ensure(window.settled(&view)? == burnt, || "another device shows another picture".into())
}

/// Reads are under way while paint comes, is committed and goes again; what is seen in the end is what counts.
fn reads_from_before(gpu: &Gpu) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = land(&folder, Some(TileFormat::Bc1))?;
    let view = from_above();
    let before = Window::open(gpu, &path)?.settled(&view)?;
    let mut session = EditSession::open(&path).map_err(|e| e.to_string())?;
    let mut pictures = Vec::new();
    for frames in 0..8 {
        let mut window = Window::open(gpu, &path)?;
        for _ in 0..frames {
            window.frame(&view);
        }
        session.paint(&[burn([2016.0, 2080.0], 150.0)]).map_err(|e| e.to_string())?;
        window.repainted(&mut session)?;
        window.frame(&view);
        session.commit("burnt").map_err(|e| e.to_string())?;
        window.repainted(&mut session)?;
        if frames % 2 == 0 {
            window.frame(&view);
        }
        pictures.push(window.settled(&view)?);
        session.undo().map_err(|e| e.to_string())?;
        window.repainted(&mut session)?;
        let after = window.settled(&view)?;
        ensure(after == before, || format!("after {frames} frames {} differ", differing(&after, &before)))?;
    }
    ensure(pictures[0] != before, || "no paint is seen".into())?;
    ensure(pictures.iter().all(|p| *p == pictures[0]), || "the paint depends on when it comes".into())
}

fn scorches(gpu: &Gpu) -> Outcome {
    let crater =
        |radius_m| Edit::Crater(Crater { centre_m: [2000.0; 2], direction_deg: 0.0, radius_m, depth_m: 5.0 });
    let raise = Edit::Restore(terrasoar_layout::edit::Area::Disc { centre_m: [9.0; 2], radius_m: 5.0 });
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = land(&folder, None)?;
    let window = Window::open(gpu, &path)?;
    ensure(window.scene.scorches_of(&[crater(40.0)]).is_empty(), || "there is nothing to scorch".into())?;
    let path = land(&folder, Some(TileFormat::Bc1))?;
    let window = Window::open(gpu, &path)?;
    let paints = window.scene.scorches_of(&[crater(40.0), raise, crater(2000.0)]);
    ensure(matches!(paints[..], [Paint::Scorch(Scorch { radius_m: 60.0, .. })]), || format!("{paints:?}"))
}
