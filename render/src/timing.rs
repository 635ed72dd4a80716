//! How long the device took for a frame, where it can tell.
//!
//! Results arrive some frames later and are read without waiting. Three frames may be under way; a frame beyond these
//! is not timed.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

const PLACES: usize = 3;
const BYTES: u64 = 16;

const FREE: u8 = 0;
/// Written by commands that may not have been submitted yet.
const RECORDED: u8 = 1;
const MAPPING: u8 = 2;
const MAPPED: u8 = 3;
const FAILED: u8 = 4;

#[derive(Debug)]
struct Place {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    state: Arc<AtomicU8>,
}

/// Times passes.
#[derive(Debug)]
pub(crate) struct GpuTimer {
    places: Vec<Place>,
    period_ns: f64,
    last_ms: Option<f64>,
}

impl GpuTimer {
    /// None where the device has no timestamps.
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: BYTES,
                usage,
                mapped_at_creation: false,
            })
        };
        let place = |_| Place {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("frame"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readable: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            state: Arc::new(AtomicU8::new(FREE)),
        };
        Some(Self {
            places: (0..PLACES).map(place).collect(),
            period_ns: f64::from(queue.get_timestamp_period()),
            last_ms: None,
        })
    }

    /// A free place to write into.
    pub(crate) fn begin(&self) -> Option<usize> {
        self.places.iter().position(|p| p.state.load(Ordering::Acquire) == FREE)
    }

    pub(crate) fn begins_with_compute(&self, place: usize) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.places[place].queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: None,
        }
    }

    pub(crate) fn ends_with_render(
        &self,
        place: usize,
        begins_too: bool,
    ) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.places[place].queries,
            beginning_of_pass_write_index: begins_too.then_some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    pub(crate) fn end(&self, place: usize, encoder: &mut wgpu::CommandEncoder) {
        let place = &self.places[place];
        encoder.resolve_query_set(&place.queries, 0..2, &place.resolved, 0);
        encoder.copy_buffer_to_buffer(&place.resolved, 0, &place.readable, 0, BYTES);
        place.state.store(RECORDED, Ordering::Release);
    }

    /// The newest time known, in milliseconds. To be called after frames were submitted.
    pub(crate) fn collect_ms(&mut self, device: &wgpu::Device) -> Option<f64> {
        for place in &self.places {
            if place.state.load(Ordering::Acquire) == RECORDED {
                place.state.store(MAPPING, Ordering::Release);
                let state = place.state.clone();
                place.readable.slice(..).map_async(wgpu::MapMode::Read, move |result| {
                    state.store(if result.is_ok() { MAPPED } else { FAILED }, Ordering::Release);
                });
            }
        }
        // A lost device is reported by its watch; here it only means that no time comes.
        let _ = device.poll(wgpu::PollType::Poll);
        for place in &self.places {
            match place.state.load(Ordering::Acquire) {
                MAPPED => {
                    if let Ok(bytes) = place.readable.slice(..).get_mapped_range() {
                        let ticks: &[u64] = bytemuck::cast_slice(&bytes);
                        if let [begin, end] = *ticks {
                            self.last_ms = Some(end.saturating_sub(begin) as f64 * self.period_ns * 1e-6);
                        }
                    }
                    place.readable.unmap();
                    place.state.store(FREE, Ordering::Release);
                }
                FAILED => place.state.store(FREE, Ordering::Release),
                _ => {}
            }
        }
        self.last_ms
    }
}
