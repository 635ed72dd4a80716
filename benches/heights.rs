//! What do collision and placing cost? A height and a ray, over records at hand and over streamed pages.
//!
//! Data: generated, 1,025 x 1,025 samples 10 m apart east and 12 m north. Command: `cargo bench --bench heights`.

#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;
use terrasoar::ground::{Ground, PictureEngine, StreamOptions};
use terrasoar::refine::Culling;
use terrasoar::view::Viewport;

fn questions(criterion: &mut Criterion) {
    let terrain = Arc::new(common::rugged_terrain([1025, 1025], 1, false));
    let view = common::frame(&terrain, [0.5, 0.4], 2500.0, 10.0, -15.0).view(Viewport::default(), 1.0);
    let mapped = Ground::mapped(&terrain, PictureEngine::Kinetic, Culling::Vertices).expect("in memory");
    let streamed = Ground::streamed(Arc::clone(&terrain), &StreamOptions::default()).expect("it is sound");
    for (name, mut ground) in [("mapped", mapped), ("streamed", streamed)] {
        ground.update(&view);
        let [east_m, north_m] = ground.extent_m();
        let [_, high_m] = ground.height_range_m();
        let mut i = 0.0;
        let mut place = move || {
            i += 1.0;
            // Spread evenly (R. Kronecker's sequence of the plastic number).
            let [x, y] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step: f64| (i * step).fract());
            [x * east_m, y * north_m]
        };
        criterion.bench_function(&format!("height, {name}"), |b| {
            b.iter(|| {
                let [east_m, north_m] = place();
                black_box(ground.height_at(east_m, north_m))
            });
        });
        criterion.bench_function(&format!("ray of 1 km, {name}"), |b| {
            b.iter(|| {
                let [east_m, north_m] = place();
                black_box(ground.ray_hit([east_m, north_m, 0.9 * high_m], [0.7, 0.7, -0.02], 1000.0))
            });
        });
    }
}

criterion_group!(benches, questions);
criterion_main!(benches);
