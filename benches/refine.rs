//! What does a frame cost? One update of each engine on a small rugged terrain, camera moving a little each time.
//!
//! Data: generated, 1,025 x 1,025 samples. Command: `cargo bench --bench refine`.

#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::Viewport;
use terrasoar_layout::with_records;

fn updates(criterion: &mut Criterion) {
    let terrain = common::rugged_terrain([1025, 1025], 1, false);
    let view = |step: u32| {
        let north = 0.1 + 0.6 * f64::from(step % 2000) / 2000.0;
        common::frame(&terrain, [0.5, north], 2500.0, 10.0, -15.0).view(Viewport::default(), 1.0)
    };
    with_records!(terrain.records().expect("in memory"), records => {
        let mut group = criterion.benchmark_group("update");
        let mut soar = Soar::new(records.clone(), Culling::Vertices);
        let mut step = 0;
        group.bench_function("soar", |b| b.iter(|| { step += 1; soar.update(&view(step), &mut Unobserved) }));
        let mut smart = Smart::new(records.clone(), Culling::Vertices);
        step = 0;
        group.bench_function("smart", |b| b.iter(|| { step += 1; smart.update(&view(step), &mut Unobserved) }));
        let mut kinetic = Kinetic::new(records.clone(), Culling::Vertices);
        step = 0;
        group.bench_function("kinetic", |b| b.iter(|| { step += 1; kinetic.update(&view(step), &mut Unobserved) }));
        group.finish();
    });
}

criterion_group!(benches, updates);
criterion_main!(benches);
