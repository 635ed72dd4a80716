//! What is drawn, and that it is drawn as it was. These tests need a graphics adapter (tests/support/adapter.rs).

#![expect(clippy::single_range_in_vec_init, reason = "a list of one range is meant: what is drawn")]

#[path = "../../../tests/support/adapter.rs"]
mod adapter;
mod cover;
mod device;
mod imagery;
mod lines;
mod materials;
mod patches;
mod places;
mod shading;
mod snapshots;
#[path = "../support/mod.rs"]
mod support;

use adapter::{Drawn, Outcome, ensure};
use std::process::ExitCode;
use terrasoar_render::Gpu;

type Test = fn(&Gpu) -> Outcome;

/// What reads depth back, which not every device can.
const READ_DEPTH: [&str; 4] = ["cover::", "imagery::no_image", "places::depth", "places::morph"];

fn main() -> ExitCode {
    let tests = [
        cover::tests(),
        device::tests(),
        imagery::tests(),
        lines::tests(),
        materials::tests(),
        patches::tests(),
        places::tests(),
        shading::tests(),
    ]
    .concat();
    let tests = tests.into_iter().map(|(name, test): (&str, Test)| Drawn {
        name: name.into(),
        lacks,
        test: Box::new(test),
    });
    let snapshots = snapshots::names().map(|name| Drawn {
        name: format!("snapshots::{name}"),
        lacks,
        test: Box::new(move |gpu| snapshots::check(gpu, &name)),
    });
    adapter::run(tests.chain(snapshots))
}

/// What a test needs and the device has not.
fn lacks(gpu: &Gpu, name: &str) -> Option<&'static str> {
    let can = &gpu.capabilities;
    if !can.depth_copies && READ_DEPTH.iter().any(|prefix| name.starts_with(prefix)) {
        return Some("depth cannot be read on this device");
    }
    let blocks = name.starts_with("imagery::blocks") && !can.texture_compression_bc;
    blocks.then_some("this device takes no BC textures")
}
