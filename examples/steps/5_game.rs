//! A walk: keys move over the ground, a click throws a crater where the mouse points, and the ground has textures of the program's own.
//!
//! W and S walk, A and D turn, the left button of the mouse shoots. The terrain file is left as it is.
//!
//!     cargo run --release -p terrasoar-scene --example step_5_game -- land.iqt [FRAMES]

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;
use terrasoar::refine::Culling;
use terrasoar::{Crater, Edit, Ground, StreamOptions, Terrain, View};
use terrasoar_render::{Gpu, Layer, Layers, Look, Material, PassFormat, RenderError, wgpu};
use terrasoar_scene::scene::{Scene, SceneOptions, TileService};
use winit::application::ApplicationHandler;
use winit::event::{ElementState, MouseButton, WindowEvent};
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Window, WindowId};

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1);
    let path = words.next().unwrap_or("land.iqt".into());
    let frames = words.next().map_or(Ok(u32::MAX), |word| word.parse())?;
    // Refined all around: who walks sees the ground between two samples of which one is behind the eye.
    let options = StreamOptions::default().cache_mib(64).culling(Culling::Clusters);
    let ground = Terrain::open(&path)?.stream(options)?;
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

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let Some(ground) = self.ground.take() else { return };
        let window = events.create_window(Window::default_attributes().with_title("Ground"));
        match window.map_err(Failure::from).and_then(|window| Shown::new(Arc::new(window), ground)) {
            Ok(shown) => self.shown = Some(shown),
            Err(failure) => self.end(events, Some(failure)),
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
            WindowEvent::KeyboardInput { event, .. } => {
                if let PhysicalKey::Code(key) = event.physical_key {
                    shown.walker.key(key, event.state.is_pressed());
                }
            }
            WindowEvent::CursorMoved { position, .. } => shown.mouse_px = [position.x, position.y],
            WindowEvent::MouseInput { state: ElementState::Pressed, button: MouseButton::Left, .. } => {
                shown.shoot();
            }
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

/// All that needs a window.
struct Shown {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    depth: wgpu::TextureView,
    gpu: Gpu,
    ground: Ground<'static>,
    scene: Scene,
    walker: Walker,
    mouse_px: [f64; 2],
    frame: u32,
}

impl Shown {
    fn new(window: Arc<Window>, ground: Ground<'static>) -> Result<Self, Failure> {
        let instance = wgpu::Instance::default();
        let surface = instance.create_surface(Arc::clone(&window))?;
        let for_window =
            wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&for_window))?;
        let gpu = pollster::block_on(Gpu::on(adapter))?;
        let size = window.inner_size();
        let config = surface
            .get_default_config(&gpu.adapter, size.width.max(1), size.height.max(1))
            .ok_or("the adapter cannot draw to this window")?;
        surface.configure(&gpu.device, &config);
        // A few tiles of light a frame: no frame waits.
        let mut scene = Scene::new(&ground, &gpu, SceneOptions::default().tiles(TileService::AFrame(3)))?;
        scene.set_material(Some(textures()?))?;
        let walker = Walker::new(&ground)?;
        let depth = depth_of(&gpu, &config);
        window.request_redraw();
        Ok(Self { window, surface, config, depth, gpu, ground, scene, walker, mouse_px: [0.0; 2], frame: 0 })
    }

    fn resize(&mut self, [width, height]: [u32; 2]) {
        (self.config.width, self.config.height) = (width.max(1), height.max(1));
        self.surface.configure(&self.gpu.device, &self.config);
        self.depth = depth_of(&self.gpu, &self.config);
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
        self.walker.walk(&mut self.ground);
        let view = self.view();
        self.ground.update(&view);
        while let Some(error) = self.ground.take_error() {
            eprintln!("{error}");
        }
        let format = PassFormat::new(self.config.format);
        let frame = self.scene.frame(&mut self.ground, &view, &Look::default(), &format)?;

        let target = picture.texture.create_view(&Default::default());
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut pass = begin(&mut encoder, &target, &self.depth, &format);
        // Things of your own are drawn here, with `frame.clip_from_local`.
        frame.draw_with_sky(&mut pass)?;
        drop(pass);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.queue.present(picture);
        self.gpu.watch.check()?;
        Ok(())
    }

    fn view(&self) -> View {
        View::new(self.walker.eye_m, self.walker.heading_deg, -8.0)
            .viewport([self.config.width, self.config.height])
    }

    // begin: shoot
    /// A crater where the mouse points.
    fn shoot(&mut self) {
        let view = self.view();
        let [right, up, forward] = view.axes();
        let [across, along] = view.half_tangents();
        let x = 2.0 * self.mouse_px[0] / f64::from(self.config.width) - 1.0;
        let y = 1.0 - 2.0 * self.mouse_px[1] / f64::from(self.config.height);
        let direction = forward + right * (x * across) + up * (y * along);
        let Some(hit) = self.ground.ray_hit(view.eye_m.to_array(), direction.to_array(), 20_000.0) else {
            return; // Into the sky.
        };
        let [east_m, north_m, _] = hit.place_m;
        let crater = Crater {
            centre_m: [east_m, north_m],
            direction_deg: self.walker.heading_deg,
            radius_m: 25.0,
            depth_m: 6.0,
        };
        // The next update shows it, or a later one if the file has to be rewritten for it. An error says why the ground cannot be changed there.
        if let Err(error) = self.ground.edit(&[Edit::Crater(crater)]) {
            eprintln!("{error}");
        }
    }
    // end: shoot
}

// begin: walker
/// Height of the eye above the ground.
const EYE_M: f64 = 2.0;

/// Somebody who walks.
struct Walker {
    eye_m: [f64; 3],
    heading_deg: f64,
    ahead: f64,
    turn: f64,
    last: Instant,
}

impl Walker {
    /// On a summit: the highest of some places, read from the file.
    fn new(ground: &Ground<'_>) -> Result<Self, terrasoar::Error> {
        let [east_m, north_m] = ground.extent_m();
        let mut eye_m = [0.5 * east_m, 0.5 * north_m, f64::NEG_INFINITY];
        for place in 0..64 * 64 {
            let [x, y] = [place % 64, place / 64].map(|i| (f64::from(i) + 0.5) / 64.0);
            let height_m = ground.terrain().height_m(x * east_m, y * north_m)?;
            if let Some(height_m) = height_m.filter(|height_m| height_m + EYE_M > eye_m[2]) {
                eye_m = [x * east_m, y * north_m, height_m + EYE_M];
            }
        }
        Ok(Self { eye_m, heading_deg: 0.0, ahead: 0.0, turn: 0.0, last: Instant::now() })
    }

    fn key(&mut self, key: KeyCode, is_down: bool) {
        let by = if is_down { 1.0 } else { 0.0 };
        match key {
            KeyCode::KeyW => self.ahead = by,
            KeyCode::KeyS => self.ahead = -by,
            KeyCode::KeyD => self.turn = by,
            KeyCode::KeyA => self.turn = -by,
            _ => {}
        }
    }

    /// Goes on by the time that has passed, and stands on the ground.
    fn walk(&mut self, ground: &mut Ground<'_>) {
        let passed_s = self.last.elapsed().as_secs_f64().min(0.1);
        self.last = Instant::now();
        self.heading_deg += 60.0 * passed_s * self.turn;
        let (sin, cos) = self.heading_deg.to_radians().sin_cos();
        let way_m = 20.0 * passed_s * self.ahead;
        let next_m = [self.eye_m[0] + way_m * sin, self.eye_m[1] + way_m * cos];
        let foot = ground.height_at(next_m[0], next_m[1]);
        if !foot.is_exact {
            ground.want_height(next_m[0], next_m[1]);
        }
        // No ground there: stay.
        let Some(height_m) = foot.height_m else { return };
        let is_too_steep = height_m + EYE_M - self.eye_m[2] > 2.0 * way_m.abs().max(0.05);
        if is_too_steep && way_m != 0.0 {
            return;
        }
        self.eye_m = [next_m[0], next_m[1], height_m + EYE_M];
    }
}
// end: walker

// begin: textures
/// Grass, rock where it is steep, snow high up. A game reads its textures from files; these are made here.
fn textures() -> Result<Material, RenderError> {
    let side = 256;
    let speckled = |dark: [u8; 3], bright: [u8; 3]| -> Vec<u8> {
        let texel = |i: u32| {
            let mixed = (i ^ (i >> 7)).wrapping_mul(0x9e37_79b1);
            let share = (mixed ^ (mixed >> 15)) & 255;
            let [r, g, b] = [0, 1, 2].map(|c| {
                let (a, b) = (u32::from(dark[c]), u32::from(bright[c]));
                ((a * (255 - share) + b * share) / 255) as u8
            });
            [r, g, b, 255]
        };
        (0..side * side).flat_map(texel).collect()
    };
    // Each is so many metres wide, and lies over those before it.
    let grass = Layer::new(speckled([52, 78, 30], [96, 120, 58]), 16.0);
    let snow =
        Layer::new(speckled([214, 224, 236], [250, 252, 255]), 16.0).heights_m([400.0, f32::INFINITY], 80.0);
    let rock = Layer::new(speckled([78, 72, 66], [142, 134, 124]), 32.0).slopes_deg([35.0, 90.0], 10.0);
    Layers::new(side).over(grass).over(snow).over(rock).material()
}
// end: textures

/// A depth buffer as large as the window.
fn depth_of(gpu: &Gpu, config: &wgpu::SurfaceConfiguration) -> wgpu::TextureView {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("depth"),
        size: wgpu::Extent3d { width: config.width, height: config.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: PassFormat::new(config.format).depth,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}

/// A pass that clears colour and depth.
fn begin<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    colour: &wgpu::TextureView,
    depth: &wgpu::TextureView,
    format: &PassFormat,
) -> wgpu::RenderPass<'e> {
    let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store };
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: colour,
            depth_slice: None,
            resolve_target: None,
            ops,
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(format.depth_range.clear()),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        ..Default::default()
    })
}
