//! The window's surface and the device that draws on it, through resizes and losses.
//!
//! A surface that is out of date or lost is made anew at once; while there is nothing to draw on, no frame is drawn. The device's watch
//! reports a lost device, and [`Screen::renew`] makes another. What was on the old one must then be sent again.

use anyhow::{Context, Result, anyhow};
use std::sync::Arc;
use terrasoar_render::{Gpu, RenderError, wgpu};
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

/// A window that can be drawn on.
pub(crate) struct Screen {
    window: Arc<Window>,
    display: OwnedDisplayHandle,
    instance: wgpu::Instance,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    /// The device.
    pub gpu: Gpu,
}

impl Screen {
    /// Takes the best adapter that can present to the window.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] and [`RenderError::NoDevice`], which say what to do.
    pub(crate) fn new(window: Arc<Window>, display: OwnedDisplayHandle) -> Result<Self> {
        // OpenGL is asked where nothing better answers.
        let choices = match wgpu::Backends::from_env() {
            Some(backends) => vec![backends],
            None => vec![wgpu::Backends::PRIMARY, wgpu::Backends::SECONDARY],
        };
        let mut reason = None;
        for backends in choices {
            match Self::with(&window, &display, backends) {
                Ok(screen) => return Ok(screen),
                Err(error) => {
                    reason.get_or_insert(error);
                }
            }
        }
        Err(reason.unwrap_or_else(|| anyhow!("no graphics interface is built in")))
    }

    fn with(window: &Arc<Window>, display: &OwnedDisplayHandle, backends: wgpu::Backends) -> Result<Self> {
        let mut descriptor =
            wgpu::InstanceDescriptor::new_with_display_handle_from_env(Box::new(display.clone()));
        descriptor.backends = backends;
        let instance = wgpu::Instance::new(descriptor);
        let no_adapter = |e: &dyn std::fmt::Display| RenderError::NoAdapter { detail: e.to_string() };
        let surface = instance.create_surface(Arc::clone(window)).map_err(|e| no_adapter(&e))?;
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: Some(&surface),
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|e| no_adapter(&e))?;
        let size = window.inner_size();
        let mut config = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| anyhow!("the adapter cannot draw on this window"))?;
        // The overlay blends in gamma space and wants a format that leaves its values alone.
        let formats = surface.get_capabilities(&adapter).formats;
        let plain = [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm];
        config.format = plain.into_iter().find(|f| formats.contains(f)).unwrap_or(config.format);
        config.present_mode = wgpu::PresentMode::AutoVsync;
        config.desired_maximum_frame_latency = 2;
        let gpu = pollster::block_on(Gpu::on(adapter))?;
        // One that takes over from another may draw smaller pictures only.
        let most = gpu.device.limits().max_texture_dimension_2d;
        (config.width, config.height) = (config.width.min(most), config.height.min(most));
        surface.configure(&gpu.device, &config);
        Ok(Self { window: Arc::clone(window), display: display.clone(), instance, surface, config, gpu })
    }

    /// Everything anew, after the loss of the device.
    ///
    /// # Errors
    /// As [`Screen::new`].
    pub(crate) fn renew(&mut self) -> Result<()> {
        *self = Self::new(Arc::clone(&self.window), self.display.clone())?;
        Ok(())
    }

    /// Size in pixels.
    pub(crate) fn size_px(&self) -> [u32; 2] {
        [self.config.width, self.config.height]
    }

    /// Format of the pictures.
    pub(crate) fn format(&self) -> wgpu::TextureFormat {
        self.config.format
    }

    /// Follows the window's size. Windows without pixels are minimised and keep what they had.
    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        if width > 0 && height > 0 {
            (self.config.width, self.config.height) = (width.min(most), height.min(most));
            self.surface.configure(&self.gpu.device, &self.config);
        }
    }

    /// The next picture to draw; none where there is nothing to draw on just now.
    ///
    /// # Errors
    /// What the device refused, or its loss.
    pub(crate) fn acquire(&mut self) -> Result<Option<wgpu::SurfaceTexture>> {
        for _ in 0..2 {
            match self.surface.get_current_texture() {
                wgpu::CurrentSurfaceTexture::Success(texture) => return Ok(Some(texture)),
                wgpu::CurrentSurfaceTexture::Suboptimal(texture) => drop(texture),
                wgpu::CurrentSurfaceTexture::Timeout | wgpu::CurrentSurfaceTexture::Occluded => {
                    return Ok(None);
                }
                wgpu::CurrentSurfaceTexture::Outdated => {}
                wgpu::CurrentSurfaceTexture::Lost => {
                    self.surface = self
                        .instance
                        .create_surface(Arc::clone(&self.window))
                        .context("the window cannot be drawn on any more")?;
                }
                wgpu::CurrentSurfaceTexture::Validation => {
                    self.gpu.watch.check()?;
                    return Ok(None);
                }
            }
            let size = self.window.inner_size();
            if size.width == 0 || size.height == 0 {
                return Ok(None);
            }
            self.resize(size.width, size.height);
        }
        Ok(None)
    }
}
