//! A cube of one metre that stands on the origin: what is drawn beside the ground stands for anything.

use glam::Mat4;
use terrasoar_render::{Gpu, PassFormat, wgpu};

const SHADER: &str = "
@group(0) @binding(0) var<uniform> clip_from_cube: mat4x4<f32>;
struct Point { @builtin(position) at: vec4<f32>, @location(0) shade: f32 }

@vertex fn corner(@builtin(vertex_index) i: u32) -> Point {
    // Two triangles a side; a side is an axis and a sign.
    var uv = array(vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(0.0, 1.0), vec2(0.0, 1.0), vec2(1.0, 0.0), vec2(1.0, 1.0));
    let side = i / 6u;
    let p = vec3(f32(side & 1u), uv[i % 6u]);
    let axis = side / 2u;
    let turned = select(select(p.xyz, p.zxy, axis == 1u), p.yzx, axis == 2u);
    return Point(clip_from_cube * vec4(turned - vec3(0.5, 0.5, 0.0), 1.0), 0.4 + 0.1 * f32(side));
}

@fragment fn paint(p: Point) -> @location(0) vec4<f32> { return vec4(p.shade, 0.25 * p.shade, 0.1 * p.shade, 1.0); }
";

pub struct Cube {
    pipeline: wgpu::RenderPipeline,
    place: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Cube {
    /// A cube for passes like `format`.
    pub fn new(gpu: &Gpu, format: &PassFormat) -> Self {
        let source = wgpu::ShaderSource::Wgsl(SHADER.into());
        let module =
            gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("cube"), source });
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("cube"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: None,
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: format.depth,
                depth_write_enabled: Some(true),
                depth_compare: Some(format.depth_range.compare()),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: wgpu::MultisampleState { count: format.samples, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: None,
                compilation_options: Default::default(),
                targets: &[Some(format.colour.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let place = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("place of the cube"),
            size: 64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("cube"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: place.as_entire_binding() }],
        });
        Self { pipeline, place, group }
    }

    /// Says where it is in the next frame.
    pub fn place(&self, gpu: &Gpu, clip_from_cube: Mat4) {
        let bytes: Vec<u8> = clip_from_cube.to_cols_array().iter().flat_map(|v| v.to_le_bytes()).collect();
        gpu.queue.write_buffer(&self.place, 0, &bytes);
    }

    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..36, 0..1);
    }
}
