//! Heights of vertices that are moving into place. They are computed for all slots before a frame, in a few steps of one fetch each.
//!
//! A vertex shader would have to follow every vertex's ends, and the ends of these, again and again. Here each height is
//! computed once. Cost on the device: 12 bytes a vertex slot, and [`STEPS`] + 1 passes over them.

use crate::mesh::MeshBuffers;
use crate::shaders;

/// Generations of vertices that may move at once and be exact; even, so that the result is in the first buffer.
const STEPS: u32 = 4;
const WORKGROUP: u32 = 64;

/// Buffers and pipelines.
#[derive(Debug)]
pub(crate) struct Morph {
    start: wgpu::ComputePipeline,
    step: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    heights: [wgpu::Buffer; 2],
    weights: wgpu::Buffer,
    /// From the first buffer to the second, and back.
    groups: Option<[wgpu::BindGroup; 2]>,
    limit_groups: u32,
}

impl Morph {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        let module = shaders::module(device, shaders::Program::Morph);
        let entry = |binding, ty, has_dynamic_offset| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
            count: None,
        };
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("morph"),
            entries: &[
                entry(0, wgpu::BufferBindingType::Uniform, true),
                entry(1, storage(true), false),
                entry(2, storage(false), false),
                entry(3, storage(true), false),
                entry(4, storage(false), false),
            ],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("morph"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |entry_point| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        Self {
            start: pipeline("morph_start"),
            step: pipeline("morph_step"),
            layout,
            heights: [create(device, 4), create(device, 4)],
            weights: create(device, 4),
            groups: None,
            limit_groups: device.limits().max_compute_workgroups_per_dimension,
        }
    }

    /// Makes room for the mesh's slots. Whether the buffer of heights is another now.
    pub(crate) fn fit(
        &mut self,
        device: &wgpu::Device,
        mesh: &MeshBuffers,
        uniforms: wgpu::BufferBinding<'_>,
    ) {
        let bytes = 4 * mesh.vertex_slots_held();
        if self.weights.size() != bytes {
            self.heights = [create(device, bytes), create(device, bytes)];
            self.weights = create(device, bytes);
        }
        let group = |before: &wgpu::Buffer, after: &wgpu::Buffer| {
            let resources = [
                wgpu::BindingResource::Buffer(uniforms.clone()),
                mesh.vertices.as_entire_binding(),
                self.weights.as_entire_binding(),
                before.as_entire_binding(),
                after.as_entire_binding(),
            ];
            let entries: Vec<_> = (0..)
                .zip(resources)
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("morph"),
                layout: &self.layout,
                entries: &entries,
            })
        };
        let [first, second] = &self.heights;
        self.groups = Some([group(first, second), group(second, first)]);
    }

    /// Heights by vertex slot, once [`Morph::record`]ed, relative to the height origin.
    pub(crate) fn moved_heights(&self) -> &wgpu::Buffer {
        &self.heights[0]
    }

    /// Computes the heights of the first `slots` vertices.
    pub(crate) fn record(&self, pass: &mut wgpu::ComputePass<'_>, slots: u32, uniform_offset: u32) {
        let Some([forth, back]) = &self.groups else { return };
        let groups = slots.div_ceil(WORKGROUP).max(1);
        let across = groups.min(self.limit_groups);
        let mut dispatch = |pipeline, group| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[uniform_offset]);
            pass.dispatch_workgroups(across, groups.div_ceil(across), 1);
        };
        dispatch(&self.start, back);
        for step in 0..STEPS {
            dispatch(&self.step, if step % 2 == 0 { forth } else { back });
        }
    }

    /// Bytes of device memory held.
    pub(crate) fn device_bytes(&self) -> u64 {
        3 * self.weights.size()
    }
}

fn create(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("morph"),
        size,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    })
}
