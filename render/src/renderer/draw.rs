//! The parts of a frame, in order: what the device must have, the frame's numbers, the pass, what is drawn in it.

use super::{INDIRECT_FROM, Renderer, UNIFORM_PLACES};
use crate::attachments::{Attachments, Key};
use crate::frame::{Frame, Target};
use crate::look::Look;
use crate::pipelines::{Pipelines, Variant};
use crate::uniforms::{Inputs, Uniforms};
use std::ops::Range;
use terrasoar::view::View;
use wgpu::util::DeviceExt;

impl Renderer {
    /// Has everything made that a frame of this kind needs on the device.
    pub(super) fn prepare(&mut self, target: Target<'_>, variant: Variant, look: &Look) {
        let key = Key { size_px: target.size_px, format: target.format, samples: variant.samples };
        self.attachments = Some(Attachments::keep_or_make(self.attachments.take(), &self.device, key));
        self.pipelines.entry(variant).or_insert_with(|| Pipelines::new(&self.device, &self.modules, variant));
        self.set_ramp(look.ramp);
        self.bind();
    }

    /// Sends a frame's numbers to the device; the byte at which they lie.
    pub(super) fn send_uniforms(&mut self, frame: &Frame<'_>, refined_for: &View) -> u64 {
        let uniforms = Uniforms::new(&Inputs {
            terrain: &self.terrain,
            pyramid: &self.tiles.pyramid,
            view: frame.view,
            refined_for,
            look: frame.look,
            imagery: self.imagery.as_ref(),
            wall_bottom_m: self.walls.as_ref().map_or(0.0, |w| w.bottom_m),
        });
        let place = self.uniform_stride * self.next_place;
        self.next_place = (self.next_place + 1) % UNIFORM_PLACES;
        self.queue.write_buffer(&self.uniforms, place, bytemuck::bytes_of(&uniforms));
        place
    }

    /// The visible ranges for the device to draw by itself, where that is worth it.
    pub(super) fn draw_arguments(&self, own_vertices: bool) -> Option<wgpu::Buffer> {
        let is_worth_it = self.multi_draw && !own_vertices && self.mesh.draws.ranges.len() >= INDIRECT_FROM;
        is_worth_it.then(|| {
            self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("draws"),
                contents: bytemuck::cast_slice(&self.mesh.draws.indirect_words()),
                usage: wgpu::BufferUsages::INDIRECT,
            })
        })
    }

    /// Draws ground, walls and sky; how many calls that took.
    pub(super) fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Pipelines,
        own_vertices: bool,
        arguments: Option<&wgpu::Buffer>,
    ) -> u32 {
        let ranges = &self.mesh.draws.ranges;
        let mut calls = 1;
        if own_vertices {
            pass.set_pipeline(&pipelines.own);
            for Range { start, end } in ranges {
                pass.draw(3 * start..3 * end, 0..1);
                calls += 1;
            }
        } else {
            pass.set_pipeline(&pipelines.shared);
            pass.set_index_buffer(self.mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            if let Some(arguments) = arguments {
                pass.multi_draw_indexed_indirect(arguments, 0, ranges.len() as u32);
                calls += 1;
            } else {
                for Range { start, end } in ranges {
                    pass.draw_indexed(3 * start..3 * end, 0, 0..1);
                    calls += 1;
                }
            }
        }
        if let Some(walls) = &self.walls {
            pass.set_pipeline(&pipelines.wall);
            pass.set_vertex_buffer(0, walls.edges.slice(..));
            pass.draw(0..6, 0..walls.count);
            calls += 1;
        }
        pass.set_pipeline(&pipelines.sky);
        pass.draw(0..3, 0..1);
        calls
    }
}

/// Begins the pass that clears the target and draws on it.
pub(super) fn begin_pass<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    attachments: &Attachments,
    target: Target<'_>,
    timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
) -> wgpu::RenderPass<'e> {
    // Of several samples a pixel only their mean is kept.
    let store = if attachments.samples.is_none() { wgpu::StoreOp::Store } else { wgpu::StoreOp::Discard };
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("terrain"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: attachments.samples.as_ref().unwrap_or(target.view),
            depth_slice: None,
            resolve_target: attachments.samples.as_ref().map(|_| target.view),
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &attachments.depth_view,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store }),
            stencil_ops: None,
        }),
        timestamp_writes: timestamps,
        occlusion_query_set: None,
        multiview_mask: None,
    })
}
