//! The WGSL programs, put together from parts; each can be checked without a device.

use std::borrow::Cow;

/// Mesh and walls, but for the function `material`.
macro_rules! ground_parts {
    () => {
        concat!(
            include_str!("shaders/frame.wgsl"),
            include_str!("shaders/atmosphere.wgsl"),
            include_str!("shaders/mesh.wgsl"),
            include_str!("shaders/tiles.wgsl"),
            include_str!("shaders/imagery.wgsl"),
            include_str!("shaders/material.wgsl"),
            include_str!("shaders/surface.wgsl"),
            include_str!("shaders/terrain.wgsl"),
        )
    };
}

/// A program for the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// Mesh and walls.
    Terrain,
    /// The sky.
    Sky,
    /// Patches into slots.
    Scatter,
    /// Heights of moving vertices.
    Morph,
}

impl Program {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Terrain, Self::Sky, Self::Scatter, Self::Morph];

    /// Its text.
    pub fn source(self) -> &'static str {
        match self {
            Self::Terrain => concat!(ground_parts!(), include_str!("shaders/no_material.wgsl")),
            Self::Sky => concat!(
                include_str!("shaders/frame.wgsl"),
                include_str!("shaders/atmosphere.wgsl"),
                include_str!("shaders/sky.wgsl"),
            ),
            Self::Morph => concat!(
                include_str!("shaders/frame.wgsl"),
                include_str!("shaders/mesh.wgsl"),
                include_str!("shaders/morph.wgsl"),
            ),
            Self::Scatter => include_str!("shaders/scatter.wgsl"),
        }
    }
}

/// Mesh and walls without the function `material`, which a material's text brings.
pub(crate) const GROUND: &str = ground_parts!();

pub(crate) fn module(device: &wgpu::Device, program: Program) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(match program {
            Program::Terrain => "terrain",
            Program::Sky => "sky",
            Program::Scatter => "scatter",
            Program::Morph => "morph",
        }),
        source: wgpu::ShaderSource::Wgsl(Cow::Borrowed(program.source())),
    })
}
