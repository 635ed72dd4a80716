//! The parts of a frame, in order: what the device must have, the frame's numbers, the pass, what is drawn in it.

use super::material::OnDevice;
use super::{INDIRECT_FROM, Renderer, UNIFORM_PLACES};
use crate::attachments::Attachments;
use crate::error::{RenderError, Result};
use crate::frame::{DepthRange, DrawStats, Frame, PassFormat, Target};
use crate::pipelines::{Pipelines, Variant};
use crate::uniforms::{Inputs, Uniforms};
use crate::view;
use std::ops::Range;
use terrasoar::view::View;
use wgpu::util::DeviceExt;

/// A frame whose numbers are on their way to the device.
#[derive(Debug)]
pub struct Prepared {
    /// The renderer that prepared it.
    renderer: u64,
    /// Where its numbers lie.
    place: u64,
    variant: Variant,
    own_vertices: bool,
    /// The bindings that it was prepared with.
    group: wgpu::BindGroup,
    /// What its material binds.
    own_group: Option<wgpu::BindGroup>,
    /// Visible ranges for the device to draw by itself.
    arguments: Option<wgpu::Buffer>,
    /// State of the mesh.
    generation: u64,
    draws: u64,
}

impl Renderer {
    /// As [`Renderer::prepare`], timed from the first command on where the device can.
    pub(super) fn prepare_timed(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        format: &PassFormat,
        frame: Frame<'_>,
        timing: Option<usize>,
    ) -> Result<Prepared> {
        let refined_for = frame.refined_for.unwrap_or(frame.view);
        view::check(frame.view)?;
        view::check(refined_for)?;
        format.check()?;
        let material = self.material.as_ref().map_or(0, |material| material.number);
        let variant = Variant::of(frame.look, self.imagery.is_some(), material, *format);
        let with_material = self.material.as_ref().filter(|_| variant.material != 0);
        self.pipelines.entry(variant).or_insert_with(|| {
            Pipelines::new(&self.device, &self.modules, with_material.map(OnDevice::compiled), variant)
        });
        let own_group = with_material.and_then(|material| material.group.clone());
        self.set_ramp(frame.look.ramp);
        self.bind();
        let Some((generation, group)) = self.bind_group.clone() else {
            return Err(RenderError::Usage("a frame was begun without its parts"));
        };
        let place = self.send_uniforms(&frame, refined_for, format.depth_range);
        let own_vertices = frame.look.needs_own_vertices();
        if frame.look.morph {
            let timed = self.timer.as_ref().zip(timing);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("morph"),
                timestamp_writes: timed.map(|(timer, place)| timer.begins_with_compute(place)),
            });
            self.morph.record(&mut pass, self.mesh.vertex_slots, place as u32);
        }
        let arguments = self.draw_arguments(own_vertices);
        Ok(Prepared {
            renderer: self.instance,
            place,
            variant,
            own_vertices,
            group,
            own_group,
            arguments,
            generation,
            draws: self.mesh.draws.number,
        })
    }

    /// As [`Renderer::draw`].
    pub(super) fn draw_prepared(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        prepared: &Prepared,
        sky: bool,
    ) -> Result<DrawStats> {
        let is_of_now = self.instance == prepared.renderer
            && self.mesh.generation == prepared.generation
            && self.mesh.draws.number == prepared.draws;
        let (true, Some(pipelines)) = (is_of_now, self.pipelines.get(&prepared.variant)) else {
            return Err(RenderError::Usage(
                "the frame was prepared before the mesh or the material changed, or by another renderer",
            ));
        };
        pass.set_bind_group(0, &prepared.group, &[prepared.place as u32]);
        if let Some(own) = &prepared.own_group {
            pass.set_bind_group(1, own, &[]);
        }
        let arguments = prepared.arguments.as_ref();
        let draw_calls = self.draw_parts(pass, pipelines, prepared.own_vertices, arguments, sky);
        Ok(DrawStats {
            triangles: self.mesh.draws.triangles(),
            ranges: self.mesh.draws.ranges.len() as u32,
            draw_calls,
            bytes: size_of::<Uniforms>() as u64 + arguments.map_or(0, wgpu::Buffer::size),
        })
    }

    /// Sends a frame's numbers to the device; the byte at which they lie.
    fn send_uniforms(&mut self, frame: &Frame<'_>, refined_for: &View, depth_range: DepthRange) -> u64 {
        let uniforms = Uniforms::new(&Inputs {
            terrain: &self.terrain,
            pyramid: &self.tiles.pyramid,
            view: frame.view,
            refined_for,
            look: frame.look,
            imagery: self.imagery.as_ref(),
            wall_bottom_m: self.walls.as_ref().map_or(0.0, |w| w.bottom_m),
            depth_range,
        });
        let place = self.uniform_stride * self.next_place;
        self.next_place = (self.next_place + 1) % UNIFORM_PLACES;
        self.queue.write_buffer(&self.uniforms, place, bytemuck::bytes_of(&uniforms));
        place
    }

    /// The visible ranges for the device to draw by itself, where that is worth it.
    fn draw_arguments(&self, own_vertices: bool) -> Option<wgpu::Buffer> {
        let is_worth_it = self.multi_draw && !own_vertices && self.mesh.draws.ranges.len() >= INDIRECT_FROM;
        is_worth_it.then(|| {
            self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("draws"),
                contents: bytemuck::cast_slice(&self.mesh.draws.indirect_words()),
                usage: wgpu::BufferUsages::INDIRECT,
            })
        })
    }

    /// Draws ground, walls and, if asked for, sky; how many calls that took.
    fn draw_parts(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Pipelines,
        own_vertices: bool,
        arguments: Option<&wgpu::Buffer>,
        sky: bool,
    ) -> u32 {
        let ranges = &self.mesh.draws.ranges;
        let mut calls = 0;
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
        if sky {
            pass.set_pipeline(&pipelines.sky);
            pass.draw(0..3, 0..1);
            calls += 1;
        }
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
