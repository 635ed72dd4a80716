//! The material on the ground: set, taken off, and what the device has of it.

use super::Renderer;
use crate::error::Result;
use crate::material::Material;
use crate::pipelines::Compiled;
use std::sync::atomic::{AtomicU64, Ordering};

/// A material as the device has it.
#[derive(Debug)]
pub(super) struct OnDevice {
    /// Which material of this process it is; never 0.
    pub number: u64,
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
    /// What it binds, if anything.
    pub group: Option<wgpu::BindGroup>,
}

impl OnDevice {
    pub(super) fn compiled(&self) -> Compiled<'_> {
        Compiled { module: &self.module, layout: &self.layout }
    }
}

impl Renderer {
    /// Gives the ground a material in place of one before, or takes it off again. It shows where a look says so ([`crate::Look::material`]), which looks do by default. The next frame of each
    /// target format compiles the ground's programs anew. After the loss of a device set it on the next renderer.
    ///
    /// # Errors
    ///
    /// [`crate::RenderError::Material`] for a material that declares bindings and was given nothing to bind. The material before stays then.
    pub fn set_material(&mut self, material: Option<&Material>) -> Result<()> {
        static NUMBERS: AtomicU64 = AtomicU64::new(1);
        let on_device = match material {
            None => None,
            Some(material) => {
                let own = material.bind(&self.device, &self.queue)?;
                let layouts = [Some(&self.layout), own.as_ref().map(|(layout, _)| layout)];
                let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: Some("frame and material"),
                    bind_group_layouts: &layouts[..if own.is_some() { 2 } else { 1 }],
                    immediate_size: 0,
                });
                Some(OnDevice {
                    number: NUMBERS.fetch_add(1, Ordering::Relaxed),
                    module: material.module(&self.device),
                    layout,
                    group: own.map(|(_, group)| group),
                })
            }
        };
        self.material = on_device;
        self.pipelines.retain(|variant, _| variant.material == 0);
        Ok(())
    }
}
