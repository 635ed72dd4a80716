//! Getting a device: which adapter, which of its features are used, and how its loss is noticed.
//!
//! Only features that the adapter has are asked for, so every adapter that can run compute shaders will do. Errors that
//! arrive outside a call (a lost device, a refused command) are kept in a [`DeviceWatch`] and returned by its `check`,
//! instead of ending the program.

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{RenderError, Result};
use crate::words;

/// What the adapter can do, as far as this crate cares.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Capabilities {
    /// The adapter's name.
    pub adapter: String,
    /// Vulkan, Metal, Dx12 or Gl.
    pub backend: String,
    /// Whether pixels are computed by the processor.
    pub software: bool,
    /// Whether textures of BC1 and BC7 are understood ([`Capabilities::imagery_formats`]).
    pub texture_compression_bc: bool,
    /// Whether passes can be timed.
    pub timestamps: bool,
    /// Whether many ranges may be drawn by one indirect call.
    pub multi_draw: bool,
    /// Whether depth can be read back ([`crate::read_depth_m`]); OpenGL cannot.
    pub depth_copies: bool,
    /// Largest storage binding in bytes: bounds vertices (32 bytes) and triangles (12 bytes).
    pub max_binding_bytes: u64,
}

impl Capabilities {
    /// Reads them off an adapter.
    pub fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        let features = adapter.features();
        let limits = adapter.limits();
        let downlevel = adapter.get_downlevel_capabilities();
        Self {
            adapter: info.name,
            backend: format!("{:?}", info.backend),
            software: info.device_type == wgpu::DeviceType::Cpu,
            texture_compression_bc: features.contains(wgpu::Features::TEXTURE_COMPRESSION_BC),
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            multi_draw: downlevel.flags.contains(wgpu::DownlevelFlags::INDIRECT_EXECUTION),
            depth_copies: downlevel.flags.contains(wgpu::DownlevelFlags::DEPTH_TEXTURE_AND_BUFFER_COPIES),
            max_binding_bytes: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
        }
    }
}

/// Remembers the first thing that went wrong with a device outside any call.
#[derive(Debug, Clone, Default)]
pub struct DeviceWatch {
    first: Arc<Mutex<Option<RenderError>>>,
}

impl DeviceWatch {
    /// Watches a device. Replaces its handlers for loss and for uncaptured errors.
    pub fn install(device: &wgpu::Device) -> Self {
        let watch = Self::default();
        let seen = watch.clone();
        device.set_device_lost_callback(move |reason, _| {
            seen.note(RenderError::DeviceLost { reason: words::of_loss(reason).into() });
        });
        let seen = watch.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            seen.note(RenderError::Device { message: words::of_error(&error) });
        }));
        watch
    }

    /// Loss outranks a refused command: whatever was refused is gone with the device.
    fn note(&self, error: RenderError) {
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        if first.is_none() || matches!(error, RenderError::DeviceLost { .. }) {
            *first = Some(error);
        }
    }

    /// Whether all went well since the last call.
    ///
    /// # Errors
    ///
    /// [`RenderError::DeviceLost`] from the moment the device is lost, at every call; [`RenderError::Device`] once
    /// for a refused command.
    pub fn check(&self) -> Result<()> {
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        match &*first {
            None => Ok(()),
            Some(lost @ RenderError::DeviceLost { .. }) => Err(lost.clone()),
            Some(_) => first.take().map_or(Ok(()), Err),
        }
    }
}

/// A device with what is known about it.
#[derive(Debug)]
pub struct Gpu {
    /// The adapter.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// What it can do.
    pub capabilities: Capabilities,
    /// Notices its loss.
    pub watch: DeviceWatch,
}

impl Gpu {
    /// A device without a window: the fastest adapter there is, else a software one. `WGPU_BACKEND` (vulkan, metal,
    /// dx12, gl) restricts the choice.
    ///
    /// # Errors
    ///
    /// [`RenderError::NoAdapter`] says what to install; [`RenderError::NoDevice`].
    pub async fn headless() -> Result<Self> {
        // OpenGL is asked only where nothing better answers: looking for it may start a display connection.
        let choices = match wgpu::Backends::from_env() {
            Some(backends) => vec![backends],
            None => vec![wgpu::Backends::PRIMARY, wgpu::Backends::SECONDARY],
        };
        let mut asked = wgpu::Backends::empty();
        for backends in choices {
            asked |= backends & wgpu::Instance::enabled_backend_features();
            let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
            descriptor.backends = backends;
            let options = wgpu::RequestAdapterOptions {
                power_preference: wgpu::PowerPreference::HighPerformance,
                ..Default::default()
            };
            if let Ok(adapter) = wgpu::Instance::new(descriptor).request_adapter(&options).await {
                return Self::on(adapter).await;
            }
        }
        Err(RenderError::NoAdapter { detail: format!("{} was asked for", words::of_backends(asked)) })
    }

    /// [`Gpu::headless`], waiting for it.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn headless_blocking() -> Result<Self> {
        pollster::block_on(Self::headless())
    }

    /// A device on an adapter the caller chose, such as one that can present to a window.
    ///
    /// # Errors
    ///
    /// [`RenderError::NoDevice`].
    pub async fn on(adapter: wgpu::Adapter) -> Result<Self> {
        let capabilities = Capabilities::of(&adapter);
        let wanted = wgpu::Features::TEXTURE_COMPRESSION_BC | wgpu::Features::TIMESTAMP_QUERY;
        let (device, queue) = adapter
            .request_device(&wgpu::DeviceDescriptor {
                label: Some("terrasoar"),
                required_features: adapter.features() & wanted,
                // Everything the adapter has: the mesh and the tile pool are bounded by these and nothing else.
                required_limits: adapter.limits(),
                memory_hints: wgpu::MemoryHints::Performance,
                ..Default::default()
            })
            .await
            .map_err(|e| RenderError::NoDevice {
                adapter: capabilities.adapter.clone(),
                detail: words::last_cause(&e.to_string()),
            })?;
        let watch = DeviceWatch::install(&device);
        Ok(Self { adapter, device, queue, capabilities, watch })
    }
}
