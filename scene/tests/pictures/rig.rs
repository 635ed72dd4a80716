//! Real terrain, a scene of it, and pictures of that.

use glam::DVec3;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use terrasoar::ground::{Ground, PictureEngine, StreamOptions};
use terrasoar::refine::Culling;
use terrasoar::view::{ErrorMetric, View, Viewport};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{Gpu, Look, Offscreen, read_depth_m};
use terrasoar_scene::scene::{Scene, SceneOptions};

/// Puget Sound: 1,025 x 1,025 samples 160 m apart.
pub fn puget_sound() -> &'static Terrain {
    &built().1
}

/// The same, not mapped.
pub fn puget_sound_unmapped() -> Arc<Terrain> {
    Arc::new(Terrain::open_unmapped(built().1.path()).unwrap())
}

fn built() -> &'static (tempfile::TempDir, Terrain) {
    static TERRAIN: OnceLock<(tempfile::TempDir, Terrain)> = OnceLock::new();
    let made = || {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("puget.iqt");
        let dem = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/puget_sound_1025.png");
        let options = BuildOptions::default().spacing_m([160.0; 2]).z_scale(0.1);
        build(&*terrasoar_import::open(&[dem]).unwrap(), &file, &options, &Silent).unwrap();
        let terrain = Terrain::open(&file).unwrap();
        (folder, terrain)
    };
    TERRAIN.get_or_init(made)
}

/// A scene on a device, with a picture to draw to.
pub struct Rig<'a> {
    gpu: &'a Gpu,
    pub ground: Ground<'static>,
    pub scene: Scene,
    offscreen: Offscreen,
}

impl<'a> Rig<'a> {
    /// Over the mapped file.
    pub fn new(gpu: &'a Gpu, engine: PictureEngine, culling: Culling, size_px: [u32; 2]) -> Self {
        Self::over(gpu, Ground::mapped(puget_sound(), engine, culling).unwrap(), size_px)
    }

    /// The kinetic engine over the mapped file.
    pub fn plain(gpu: &'a Gpu, size_px: [u32; 2]) -> Self {
        Self::new(gpu, PictureEngine::Kinetic, Culling::Vertices, size_px)
    }

    pub fn over(gpu: &'a Gpu, ground: Ground<'static>, size_px: [u32; 2]) -> Self {
        let scene = Scene::new(&ground, gpu, SceneOptions::default()).unwrap();
        Self { gpu, ground, scene, offscreen: Offscreen::new(&gpu.device, size_px).unwrap() }
    }

    /// Over pages that are read into `cache_bytes`.
    pub fn streamed(gpu: &'a Gpu, size_px: [u32; 2], cache_bytes: u64) -> Self {
        let options = StreamOptions::default().cache_bytes(cache_bytes);
        Self::over(gpu, Ground::streamed(puget_sound_unmapped(), &options).unwrap(), size_px)
    }

    /// Refines for a view and draws it until all that it needs has come.
    pub fn shoot_settled(&mut self, view: &View, look: &Look) -> Vec<u8> {
        let begun = Instant::now();
        loop {
            let refined = self.ground.update(view);
            let picture = self.draw(view, look);
            if refined.work.late == 0 && self.scene.tile_stats().missing == 0 && !self.ground.is_waiting() {
                return picture;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "what is missing does not come");
        }
    }

    /// Refines for a view and draws it; four bytes a pixel.
    pub fn shoot(&mut self, view: &View, look: &Look) -> Vec<u8> {
        self.ground.update(view);
        self.draw(view, look)
    }

    /// Draws the mesh as it is.
    pub fn draw(&mut self, view: &View, look: &Look) -> Vec<u8> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.scene.sync(&mut self.ground, &mut encoder, view, look).unwrap();
        self.scene.draw(&mut encoder, self.offscreen.target(), view, look, None).unwrap();
        self.gpu.queue.submit([encoder.finish()]);
        let rgba = self.offscreen.read_rgba(&self.gpu.device, &self.gpu.queue).unwrap();
        self.gpu.watch.check().unwrap();
        rgba
    }

    /// Metres along the line of sight in the last picture, infinite where there is sky.
    pub fn depth_m(&self) -> Vec<f32> {
        read_depth_m(self.scene.renderer(), &self.gpu.device, &self.gpu.queue).unwrap()
    }

    /// Goes on with a device of its own.
    pub fn move_to(&mut self, gpu: &'a Gpu, size_px: [u32; 2]) {
        self.gpu = gpu;
        self.offscreen = Offscreen::new(&gpu.device, size_px).unwrap();
        self.scene.recover(gpu).unwrap();
    }
}

/// A view from a place in kilometres, with angles in degrees, at a pixel's tolerance.
pub fn view(
    eye_km: [f64; 3],
    [yaw_deg, pitch_deg, roll_deg]: [f64; 3],
    fov_deg: f64,
    size_px: [u32; 2],
) -> View {
    View {
        eye_m: 1000.0 * DVec3::from_array(eye_km),
        yaw_rad: yaw_deg.to_radians(),
        pitch_rad: pitch_deg.to_radians(),
        roll_rad: roll_deg.to_radians(),
        vertical_fov_rad: fov_deg.to_radians(),
        viewport: Viewport { width_px: size_px[0], height_px: size_px[1] },
        tolerance_px: 1.0,
        vertical_exaggeration: 1.0,
        metric: ErrorMetric::default(),
    }
}
