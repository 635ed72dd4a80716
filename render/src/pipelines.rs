//! Pipelines, one set for each target format and each combination of what a look shows, and the one layout that all share.

use crate::frame::PassFormat;
use crate::look::{Look, Surface};
use crate::shaders;

/// What every pipeline binds.
pub(crate) fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let storage = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: true },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let texture = |view_dimension, filterable| wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable },
        view_dimension,
        multisampled: false,
    };
    let table_of_tiles = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Uint,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let (vertex, fragment) = (wgpu::ShaderStages::VERTEX, wgpu::ShaderStages::FRAGMENT);
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("frame"),
        entries: &[
            entry(
                0,
                vertex | fragment,
                wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: true,
                    min_binding_size: None,
                },
            ),
            entry(1, vertex, storage),
            entry(2, vertex, storage),
            entry(3, fragment, table_of_tiles),
            entry(4, fragment, texture(wgpu::TextureViewDimension::D2Array, true)),
            entry(5, fragment, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
            entry(6, fragment, texture(wgpu::TextureViewDimension::D2, false)),
            entry(7, vertex, storage),
            entry(8, fragment, table_of_tiles),
            entry(9, fragment, texture(wgpu::TextureViewDimension::D2Array, true)),
        ],
    })
}

/// What is fixed in a pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Variant {
    pub pass: PassFormat,
    pub surface: Surface,
    pub contours: bool,
    pub tiles: bool,
    pub image: bool,
    pub morph: bool,
    /// Number of the material that shows; 0 for none.
    pub material: u64,
}

impl Variant {
    pub(crate) fn of(look: &Look, has_image: bool, material: u64, pass: PassFormat) -> Self {
        Self {
            pass,
            surface: look.surface,
            contours: look.contours.is_some(),
            tiles: look.tile_normals,
            image: has_image && look.imagery > 0.0,
            morph: look.morph,
            material: if look.material > 0.0 { material } else { 0 },
        }
    }

    /// Values for the shaders' overrides.
    fn constants(&self) -> [(&'static str, f64); 8] {
        let surface = match self.surface {
            Surface::Tint => 0,
            Surface::Plain => 1,
            Surface::Slope => 2,
            Surface::Level => 3,
            Surface::ScreenError => 4,
        };
        [
            ("SURFACE", f64::from(surface)),
            ("CONTOURS", f64::from(u8::from(self.contours))),
            ("TILES", f64::from(u8::from(self.tiles))),
            ("IMAGE", f64::from(u8::from(self.image))),
            ("MATERIAL", f64::from(u8::from(self.material != 0))),
            ("MORPH", f64::from(u8::from(self.morph))),
            ("ENCODES", f64::from(u8::from(self.pass.colour.is_srgb()))),
            ("FARTHEST", f64::from(self.pass.depth_range.clear())),
        ]
    }
}

/// Compiled programs, whatever the target.
#[derive(Debug)]
pub(crate) struct Modules {
    terrain: wgpu::ShaderModule,
    sky: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
}

/// A compiled program and what it binds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Compiled<'a> {
    pub module: &'a wgpu::ShaderModule,
    pub layout: &'a wgpu::PipelineLayout,
}

impl Modules {
    pub(crate) fn new(device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> Self {
        Self {
            terrain: shaders::module(device, shaders::Program::Terrain),
            sky: shaders::module(device, shaders::Program::Sky),
            layout: device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("frame"),
                bind_group_layouts: &[Some(layout)],
                immediate_size: 0,
            }),
        }
    }
}

/// Pipelines of one variant; each costs its compilation when a frame first needs it.
#[derive(Debug)]
pub(crate) struct Pipelines {
    /// Terrain, indexed.
    pub shared: wgpu::RenderPipeline,
    /// Terrain, three vertices a triangle.
    pub own: wgpu::RenderPipeline,
    /// Walls, an instance an edge.
    pub wall: wgpu::RenderPipeline,
    /// The sky, last.
    pub sky: wgpu::RenderPipeline,
}

impl Pipelines {
    pub(crate) fn new(
        device: &wgpu::Device,
        modules: &Modules,
        with_material: Option<Compiled<'_>>,
        variant: Variant,
    ) -> Self {
        let plain = |module| Compiled { module, layout: &modules.layout };
        let terrain = plain(&modules.terrain);
        let ground_program = with_material.unwrap_or(terrain);
        let wall_edges = [Some(wgpu::VertexBufferLayout {
            array_stride: 8,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &wgpu::vertex_attr_array![0 => Uint32x2],
        })];
        let constants = variant.constants();
        let options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        let pipeline = |name: &str,
                        program: Compiled<'_>,
                        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
                        ground: bool| {
            let module = program.module;
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(name),
                layout: Some(program.layout),
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some(&format!("{name}_vertex")),
                    compilation_options: options.clone(),
                    buffers,
                },
                // Nothing is culled by its winding: triangles deformed at the data's edge may turn over.
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: variant.pass.depth,
                    depth_write_enabled: Some(ground),
                    // The sky is infinitely far, where only untouched pixels are.
                    depth_compare: Some(if ground {
                        variant.pass.depth_range.compare()
                    } else {
                        wgpu::CompareFunction::Equal
                    }),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: wgpu::MultisampleState { count: variant.pass.samples, ..Default::default() },
                fragment: Some(wgpu::FragmentState {
                    module,
                    entry_point: Some(&format!("{name}_fragment")),
                    compilation_options: options.clone(),
                    targets: &[Some(variant.pass.colour.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        Self {
            shared: pipeline("shared", ground_program, &[], true),
            own: pipeline("own", ground_program, &[], true),
            wall: pipeline("wall", terrain, &wall_edges, true),
            sky: pipeline("sky", plain(&modules.sky), &[], false),
        }
    }
}
