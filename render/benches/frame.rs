//! What a frame costs the processor in this crate, apart from the drawing itself: recording a patch by its size, recording
//! a frame by its visible ranges, finding wanted tiles of slopes and of an image. `cargo bench -p terrasoar-render`

use std::hint::black_box;
use std::ops::Range;

use criterion::{BatchSize, BenchmarkId, Criterion};
use glam::DVec3;
use terrasoar_render::{
    Frame, Gpu, ImageryShape, Look, MeshPatch, MeshVertex, Offscreen, Renderer, RendererOptions,
    TerrainShape, View,
};

const TERRAIN: TerrainShape =
    TerrainShape { spacing_m: [10.0, 10.0], samples: [16_385, 16_385], height_range_m: [0.0, 4000.0] };

fn view() -> View {
    let eye = DVec3::new(80_000.0, 80_000.0, 5000.0);
    View::look_at(eye, eye + DVec3::new(1.0, 2.0, -0.5), [1920, 1080].into())
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    match Gpu::headless_blocking() {
        Ok(gpu) => on_device(&mut criterion, &gpu),
        Err(error) => println!("without a device: {error}"),
    }
    criterion.final_summary();
}

fn on_device(criterion: &mut Criterion, gpu: &Gpu) {
    let options = RendererOptions::from(&gpu.capabilities);
    let Ok(mut renderer) = Renderer::new(&gpu.device, &gpu.queue, TERRAIN, options) else { return };
    criterion.bench_function("wanted tiles, 1920 x 1080", |b| {
        b.iter(|| renderer.want_tiles(black_box(&view()), 8).len());
    });
    let format = gpu.capabilities.imagery_formats()[0];
    let image = ImageryShape::new(format, [163_840, 163_840], [0.0; 2], [1.0; 2]);
    if renderer.set_imagery(&image, format, Renderer::IMAGERY_BYTES).is_ok() {
        let (view, mut ahead) = (view(), view());
        ahead.eye_m += DVec3::new(500.0, 1000.0, 0.0);
        let tile = vec![0; format.tile_bytes()];
        for wanted in renderer.want_imagery(&view, usize::MAX).to_vec() {
            let _ = renderer.give_imagery(wanted, &tile);
        }
        println!("{:?}", renderer.imagery_stats());
        criterion.bench_function("wanted image tiles, 1920 x 1080", |b| {
            b.iter(|| renderer.want_imagery(black_box(&view), 8).len());
        });
        criterion.bench_function("and those ahead", |b| {
            b.iter(|| renderer.want_imagery_ahead(black_box(&ahead), 8).len());
        });
    }
    renderer.clear_imagery();
    let encoder = || gpu.device.create_command_encoder(&Default::default());
    let vertex = MeshVertex {
        x: 1,
        y: 1,
        height_m: 0.0,
        error_m: 0.0,
        radius_m: 0.0,
        ends: [0; 2],
        flags: MeshVertex::NO_LEVEL,
    };
    for triangles in [100_u32, 1000, 10_000] {
        // Slots scattered as splits and merges leave them, half as many vertices as triangles.
        let slot = |i: u32| i.wrapping_mul(2_654_435_761) % 200_000;
        let vertices: Vec<_> = (0..triangles / 2).map(|i| (slot(i), vertex)).collect();
        let changed: Vec<_> = (0..triangles).map(|i| (slot(i), [slot(i); 3])).collect();
        let patch = MeshPatch { vertices: &vertices, triangles: &changed, draws: &[] };
        criterion.bench_function(&format!("patch of {triangles} triangles"), |b| {
            b.iter_batched(
                encoder,
                |mut encoder| {
                    let _ = black_box(renderer.apply(&mut encoder, &patch));
                    // Not submitted: only the recording is timed.
                    encoder.finish()
                },
                BatchSize::PerIteration,
            );
        });
        gpu.queue.submit([]);
    }
    let Ok(picture) = Offscreen::new(&gpu.device, [64, 64]) else { return };
    let (view, look) = (view(), Look::default());
    for ranges in [1_u32, 50, 500] {
        let draws: Vec<Range<u32>> = (0..ranges).map(|i| 2 * i..2 * i + 1).collect();
        let mut first = encoder();
        let _ = renderer.apply(&mut first, &MeshPatch { draws: &draws, ..Default::default() });
        gpu.queue.submit([first.finish()]);
        criterion.bench_with_input(BenchmarkId::new("frame, ranges", ranges), &ranges, |b, _| {
            b.iter_batched(
                encoder,
                |mut encoder| {
                    let frame = Frame { view: &view, refined_for: None, look: &look };
                    let _ = black_box(renderer.render(&mut encoder, picture.target(), frame));
                    encoder.finish()
                },
                BatchSize::PerIteration,
            );
        });
        gpu.queue.submit([]);
    }
}
