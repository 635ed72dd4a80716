//! What is seen of real data: no cracks, the same picture from both engines, the right depth.
//!
//! These need a graphics adapter (tests/support/adapter.rs).

#[path = "../../../tests/support/adapter.rs"]
mod adapter;
mod cracks;
mod depth;
mod engines;
#[path = "../../../tests/support/examples.rs"]
mod examples;
mod loss;
mod own_pass;
mod paint;
mod rig;
mod steps;

use adapter::{Drawn, Outcome, ensure};
use std::process::ExitCode;
use terrasoar_render::Gpu;

type Test = (&'static str, fn(&Gpu) -> Outcome);

/// What reads depth back, which not every device can.
const READ_DEPTH: [&str; 3] = ["cracks::", "depth::", "own_pass::things"];

fn main() -> ExitCode {
    let tests = [
        cracks::TESTS,
        depth::TESTS,
        engines::TESTS,
        loss::TESTS,
        own_pass::TESTS,
        paint::TESTS,
        steps::TESTS,
    ]
    .concat();
    adapter::run(tests.into_iter().map(|(name, test): Test| Drawn {
        name: name.into(),
        lacks,
        test: Box::new(test),
    }))
}

/// What a test needs and the device has not.
fn lacks(gpu: &Gpu, name: &str) -> Option<&'static str> {
    let reads_depth = READ_DEPTH.iter().any(|part| name.starts_with(part));
    (reads_depth && !gpu.capabilities.depth_copies).then_some("depth cannot be read on this device")
}
