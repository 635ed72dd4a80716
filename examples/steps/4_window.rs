//! A window of one's own with ground and sky in it. The eye flies on and turns.
//!
//!     cargo run --release -p terrasoar-scene --example step_4_window -- land.iqt [FRAMES]

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
    let path = words.next().unwrap_or("land.iqt".into());
    let frames = words.next().map_or(Ok(u32::MAX), |word| word.parse())?;
    let ground = Terrain::open(&path)?.stream(StreamOptions::default().cache_mib(64))?;
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
        let scene = Scene::new(&ground, &gpu, SceneOptions::default().tiles(TileService::AFrame(3)))?;
        let depth = depth_of(&gpu, &config);
        window.request_redraw();
        Ok(Self { window, surface, config, depth, gpu, ground, scene, frame: 0 })
    }

    fn resize(&mut self, [width, height]: [u32; 2]) {
        (self.config.width, self.config.height) = (width.max(1), height.max(1));
        self.surface.configure(&self.gpu.device, &self.config);
        self.depth = depth_of(&self.gpu, &self.config);
        self.window.request_redraw();
    }

    // begin: draw
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
        let view = self.view();
        self.ground.update(&view);
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
    // end: draw

    fn view(&self) -> View {
        let [east_m, north_m] = self.ground.extent_m();
        let high_m = self.ground.height_range_m()[1] + 0.03 * east_m;
        let heading_deg = 0.2 * f64::from(self.frame);
        View::new([0.5 * east_m, 0.5 * north_m, high_m], heading_deg, -20.0)
            .viewport([self.config.width, self.config.height])
    }
}

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
