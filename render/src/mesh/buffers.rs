//! The two buffers of the mesh, and the scatter that writes patches into them.
//!
//! A patch goes to the device as one block of (slot, content) entries, and a compute shader puts each in its place:
//! one upload and two dispatches, however scattered the slots are. One copy for each run of slots would be thousands of copies.
//! Buffers grow by half, within the device, and never shrink. Cost on the processor: sorting and copying the patch.

use wgpu::util::DeviceExt;

use super::draws::DrawList;
use super::patch::{PatchPacker, TRIANGLE_WORDS, VERTEX_WORDS};
use super::{MeshPatch, UploadStats};
use crate::error::{RenderError, Result};
use crate::shaders;

const VERTEX_BYTES: u64 = 32;
const TRIANGLE_BYTES: u64 = 12;
const FIRST_SLOTS: u64 = 4096;
/// Entries a workgroup scatters; the shader says the same.
const WORKGROUP: u32 = 64;

/// Vertices, triangles and the ranges to draw.
#[derive(Debug)]
pub(crate) struct MeshBuffers {
    pub vertices: wgpu::Buffer,
    pub indices: wgpu::Buffer,
    pub draws: DrawList,
    /// Vertex slots that may be in use.
    pub vertex_slots: u32,
    /// Triangle slots that a draw may name.
    triangle_slots: u32,
    /// Counts growth, so that bind groups know when they are stale.
    pub generation: u64,
    limit_bytes: u64,
    /// Workgroups one dispatch may have along x.
    limit_groups: u32,
    packer: PatchPacker,
    scatter_vertices: wgpu::ComputePipeline,
    scatter_triangles: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl MeshBuffers {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        let limits = device.limits();
        let module = shaders::module(device, shaders::Program::Scatter);
        let entry = |binding, read_only| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("scatter"),
            entries: &[entry(0, true), entry(1, false), entry(2, false)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("scatter"),
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
            vertices: create(device, Kind::Vertices, FIRST_SLOTS * VERTEX_BYTES),
            indices: create(device, Kind::Triangles, FIRST_SLOTS * TRIANGLE_BYTES),
            draws: DrawList::default(),
            vertex_slots: 0,
            triangle_slots: 0,
            generation: 0,
            limit_bytes: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
            limit_groups: limits.max_compute_workgroups_per_dimension,
            packer: PatchPacker::default(),
            scatter_vertices: pipeline("scatter_vertices"),
            scatter_triangles: pipeline("scatter_triangles"),
            layout,
        }
    }

    /// Forgets all vertices and triangles.
    pub(crate) fn clear(&mut self, device: &wgpu::Device) {
        self.vertices = create(device, Kind::Vertices, FIRST_SLOTS * VERTEX_BYTES);
        self.indices = create(device, Kind::Triangles, FIRST_SLOTS * TRIANGLE_BYTES);
        self.draws.clear();
        (self.vertex_slots, self.triangle_slots) = (0, 0);
        self.generation += 1;
    }

    /// Records the patch into `encoder`. Nothing is changed when it returns an error.
    pub(crate) fn apply(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        patch: &MeshPatch<'_>,
    ) -> Result<UploadStats> {
        let ([vertices, triangles], [vertex_end, triangle_end]) =
            self.packer.pack(patch.vertices, patch.triangles);
        let vertex_capacity =
            self.capacity("the mesh's vertices", self.vertices.size(), vertex_end * VERTEX_BYTES)?;
        let index_capacity =
            self.capacity("the mesh's triangles", self.indices.size(), triangle_end * TRIANGLE_BYTES)?;
        let bytes = 4 * self.packer.words.len() as u64;
        let slots = self.triangle_slots.max(u32::try_from(triangle_end).unwrap_or(u32::MAX));
        self.draws.set(patch.draws, slots)?;
        self.triangle_slots = slots;
        self.vertex_slots = self.vertex_slots.max(u32::try_from(vertex_end).unwrap_or(u32::MAX));

        let mut stats = UploadStats { vertices, triangles, bytes, grown_bytes: 0 };
        if let Some(capacity) = vertex_capacity {
            stats.grown_bytes += self.vertices.size();
            self.vertices = grow(device, encoder, Kind::Vertices, &self.vertices, capacity);
            self.generation += 1;
        }
        if let Some(capacity) = index_capacity {
            stats.grown_bytes += self.indices.size();
            self.indices = grow(device, encoder, Kind::Triangles, &self.indices, capacity);
            self.generation += 1;
        }
        if bytes > 0 {
            self.scatter(device, encoder, vertices, triangles);
        }
        Ok(stats)
    }

    fn scatter(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        vertices: u32,
        triangles: u32,
    ) {
        let vertex_words = VERTEX_WORDS * vertices as usize;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("patch"),
            timestamp_writes: None,
        });
        for (count, words, entry_words, pipeline) in [
            (vertices, &self.packer.words[..vertex_words], VERTEX_WORDS, &self.scatter_vertices),
            (triangles, &self.packer.words[vertex_words..], TRIANGLE_WORDS, &self.scatter_triangles),
        ] {
            if count == 0 {
                continue;
            }
            let most = entries_a_dispatch(self.limit_groups, self.limit_bytes, entry_words);
            for part in words.chunks(most * entry_words) {
                // A buffer of its own, so that several patches may lie in one submission.
                let upload = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some("patch"),
                    contents: bytemuck::cast_slice(part),
                    usage: wgpu::BufferUsages::STORAGE,
                });
                let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("patch"),
                    layout: &self.layout,
                    entries: &[
                        wgpu::BindGroupEntry { binding: 0, resource: upload.as_entire_binding() },
                        wgpu::BindGroupEntry { binding: 1, resource: self.vertices.as_entire_binding() },
                        wgpu::BindGroupEntry { binding: 2, resource: self.indices.as_entire_binding() },
                    ],
                });
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups(((part.len() / entry_words) as u32).div_ceil(WORKGROUP), 1, 1);
            }
        }
    }

    /// The size to grow to, if at all.
    fn capacity(&self, what: &'static str, has: u64, needs: u64) -> Result<Option<u64>> {
        if needs <= has {
            return Ok(None);
        }
        if needs > self.limit_bytes {
            return Err(RenderError::TooLarge { what, needed_bytes: needs, limit_bytes: self.limit_bytes });
        }
        // Multiples of 96 hold whole vertices and whole triangles.
        Ok(Some(needs.max(has + has / 2).next_multiple_of(96).min(self.limit_bytes / 96 * 96).max(needs)))
    }

    /// Vertex slots there is room for.
    pub(crate) fn vertex_slots_held(&self) -> u64 {
        self.vertices.size() / VERTEX_BYTES
    }

    /// Bytes of device memory held.
    pub(crate) fn device_bytes(&self) -> u64 {
        self.vertices.size() + self.indices.size()
    }
}

/// Entries of a patch that one dispatch can take: it has at most so many groups along x, and what it reads is bound as one buffer. A whole mesh may take several.
fn entries_a_dispatch(limit_groups: u32, limit_bytes: u64, entry_words: usize) -> usize {
    let by_groups = u64::from(limit_groups.saturating_mul(WORKGROUP).min(1 << 24));
    by_groups.min(limit_bytes / (4 * entry_words as u64)).max(1) as usize
}

#[derive(Clone, Copy)]
enum Kind {
    Vertices,
    Triangles,
}

fn create(device: &wgpu::Device, kind: Kind, size: u64) -> wgpu::Buffer {
    let shared = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    let (label, usage) = match kind {
        Kind::Vertices => ("vertices", shared),
        Kind::Triangles => ("triangles", shared | wgpu::BufferUsages::INDEX),
    };
    // New buffers read as zero: slots never written are triangles of one corner, which draw nothing.
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: false,
    })
}

fn grow(
    device: &wgpu::Device,
    encoder: &mut wgpu::CommandEncoder,
    kind: Kind,
    old: &wgpu::Buffer,
    size: u64,
) -> wgpu::Buffer {
    let new = create(device, kind, size);
    encoder.copy_buffer_to_buffer(old, 0, &new, 0, old.size());
    new
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_part_of_a_patch_is_larger_than_what_a_device_binds() {
        for limit_bytes in [36, 1 << 16, 1 << 27, 1 << 31] {
            for entry_words in [VERTEX_WORDS, TRIANGLE_WORDS] {
                let most = entries_a_dispatch(65_535, limit_bytes, entry_words) as u64;
                assert!(most >= 1 && most * 4 * entry_words as u64 <= limit_bytes);
                assert!(most <= 65_535 * 64);
            }
        }
    }
}
