//! A window of one's own: ground, sky and a cube that stands on the ground, in one render pass.
//!
//!     cargo run --release -p terrasoar-scene --example window -- TERRAIN.iqt [FRAMES]
//!
//! Flies on until the window is closed, or for so many frames.

mod cube;
mod pass;

use cube::Cube;
use glam::{DVec3, Mat4, Vec3};
use std::error::Error;
use std::sync::Arc;
use terrasoar::{Ground, StreamOptions, Terrain, View};
use terrasoar_render::{Gpu, Look, PassFormat, wgpu};
use terrasoar_scene::scene::{Scene, SceneOptions, TileService};
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::window::{Window, WindowId};

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1);
    let path = words.next().ok_or("usage: window TERRAIN.iqt [FRAMES]")?;
    let frames = words.next().map_or(Ok(u32::MAX), |word| word.parse())?;
    let terrain = Terrain::open(&path)?;
    let ground = terrain.stream(StreamOptions::default().cache_mib(64))?;
    let mut app = App { ground: Some(ground), frames, shown: None, failure: None };
    EventLoop::new()?.run_app(&mut app)?;
    app.failure.map_or(Ok(()), Err)
}

struct App {
    ground: Option<Ground<'static>>,
    frames: u32,
    shown: Option<Shown>,
    failure: Option<Failure>,
}

/// All that needs a window.
struct Shown {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    depth: wgpu::TextureView,
    gpu: Gpu,
    ground: Ground<'static>,
    scene: Scene,
    cube: Cube,
    frame: u32,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if let Some(ground) = self.ground.take() {
            let attributes = Window::default_attributes().with_title("A cube on the ground");
            let shown = events.create_window(attributes).map_err(Failure::from);
            match shown.and_then(|window| Shown::new(Arc::new(window), ground)) {
                Ok(shown) => self.shown = Some(shown),
                Err(failure) => self.end(events, Some(failure)),
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = &mut self.shown else { return };
        match event {
            WindowEvent::CloseRequested => self.end(events, None),
            WindowEvent::Resized(size) => shown.resize([size.width, size.height]),
            WindowEvent::RedrawRequested => match shown.draw() {
                Ok(()) if shown.frame < self.frames => shown.window.request_redraw(),
                done => self.end(events, done.err()),
            },
            _ => {}
        }
    }
}

impl App {
    fn end(&mut self, events: &ActiveEventLoop, failure: Option<Failure>) {
        self.failure = failure;
        events.exit();
    }
}

impl Shown {
    fn new(window: Arc<Window>, ground: Ground<'static>) -> Result<Self, Failure> {
        let instance = wgpu::Instance::default();
        let surface = instance.create_surface(Arc::clone(&window))?;
        let options =
            wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&options))?;
        let gpu = pollster::block_on(Gpu::on(adapter))?;
        let size = window.inner_size();
        let config = surface
            .get_default_config(&gpu.adapter, size.width.max(1), size.height.max(1))
            .ok_or("the adapter cannot draw to this window")?;
        // A few tiles of light a frame: no frame waits.
        let options = SceneOptions::default().tiles(TileService::AFrame(3));
        let scene = Scene::new(&ground, &gpu, options)?;
        let cube = Cube::new(&gpu, &PassFormat::new(config.format));
        let depth = pass::depth_of(&gpu, &config);
        let mut shown = Self { window, surface, config, depth, gpu, ground, scene, cube, frame: 0 };
        shown.resize([size.width, size.height]);
        shown.window.request_redraw();
        Ok(shown)
    }

    fn resize(&mut self, [width, height]: [u32; 2]) {
        (self.config.width, self.config.height) = (width.max(1), height.max(1));
        self.surface.configure(&self.gpu.device, &self.config);
        self.depth = pass::depth_of(&self.gpu, &self.config);
        self.window.request_redraw();
    }

    fn draw(&mut self) -> Result<(), Failure> {
        let picture = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(picture)
            | wgpu::CurrentSurfaceTexture::Suboptimal(picture) => picture,
            wgpu::CurrentSurfaceTexture::Outdated => {
                self.surface.configure(&self.gpu.device, &self.config);
                return Ok(());
            }
            wgpu::CurrentSurfaceTexture::Lost => return Err("the window cannot be drawn on any more".into()),
            _ => {
                // Nothing to draw to at the moment: a window that is hidden takes no processor's time.
                std::thread::sleep(std::time::Duration::from_millis(20));
                return Ok(());
            }
        };
        self.frame += 1;
        let [east_m, north_m] = self.ground.extent_m();
        let side_m = 0.01 * east_m;
        // The cube stands on the ground as it is known now; the eye goes round it.
        let foot_m = self.ground.height_at(0.5 * east_m, 0.5 * north_m).height_m.unwrap_or_default();
        let foot = DVec3::new(0.5 * east_m, 0.5 * north_m, foot_m);
        let heading_deg = 0.3 * f64::from(self.frame);
        let (sin, cos) = heading_deg.to_radians().sin_cos();
        let eye = foot + DVec3::new(-6.0 * sin, -6.0 * cos, 3.0) * side_m;
        let view = View::new(eye, heading_deg, -22.0).viewport([self.config.width, self.config.height]);
        self.ground.update(&view);
        let format = PassFormat::new(self.config.format);
        let frame = self.scene.frame(&mut self.ground, &view, &Look::default(), &format)?;
        self.cube
            .place(&self.gpu, frame.clip_from_local(foot) * Mat4::from_scale(Vec3::splat(side_m as f32)));

        let target = picture.texture.create_view(&Default::default());
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut pass = pass::begin(&mut encoder, &target, &self.depth, &format);
        self.cube.draw(&mut pass);
        frame.draw_with_sky(&mut pass)?;
        drop(pass);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.queue.present(picture);
        self.gpu.watch.check()?;
        Ok(())
    }
}
