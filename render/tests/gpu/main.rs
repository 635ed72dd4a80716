//! Tests that need a graphics adapter; a software one does. Where there is none they count as ignored and say why;
//! with TERRASOAR_NEED_ADAPTER=1, as continuous integration sets it, that is a failure.

#![expect(clippy::single_range_in_vec_init, reason = "a list of one range is meant: what is drawn")]

mod cover;
mod device;
mod imagery;
mod patches;
mod places;
mod shading;
mod snapshots;
#[path = "../support/mod.rs"]
mod support;

use std::process::ExitCode;

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use terrasoar_render::Gpu;

/// A test's outcome: what is wrong, in words.
type Outcome = Result<(), String>;
type Test = fn(&Gpu) -> Outcome;

/// What reads depth back, which not every device can.
const READ_DEPTH: [&str; 4] = ["cover::", "imagery::no_image", "places::depth", "places::morph"];

fn main() -> ExitCode {
    let mut arguments = Arguments::from_args();
    // One software device uses all cores by itself, and its errors are those of the test that runs.
    arguments.test_threads.get_or_insert(1);
    let gpu: Option<&'static Gpu> = match Gpu::headless_blocking() {
        Ok(gpu) => {
            println!("adapter: {} ({})", gpu.capabilities.adapter, gpu.capabilities.backend);
            Some(Box::leak(Box::new(gpu)))
        }
        Err(error) => {
            println!("all tests are ignored: {error}");
            if std::env::var_os("TERRASOAR_NEED_ADAPTER").is_some_and(|v| v == "1") {
                return ExitCode::FAILURE;
            }
            None
        }
    };
    let tests: Vec<(String, Test)> = [
        cover::tests(),
        device::tests(),
        imagery::tests(),
        patches::tests(),
        places::tests(),
        shading::tests(),
    ]
    .concat()
    .into_iter()
    .map(|(name, test): (&str, Test)| (name.to_owned(), test))
    .collect();
    let trial = |name: String, run: Box<dyn Fn(&Gpu) -> Outcome + Send>| {
        let lacks = gpu.and_then(|g| lacks(g, &name));
        Trial::ignorable_test(name, move || match (gpu, lacks) {
            (Some(_), Some(why)) => Ok(Completion::ignored_with(why)),
            (Some(gpu), None) => run(gpu).map(|()| Completion::Completed).map_err(Failed::from),
            (None, _) => Ok(Completion::ignored_with("no adapter")),
        })
    };
    let mut trials: Vec<_> = tests.into_iter().map(|(name, test)| trial(name, Box::new(test))).collect();
    trials.extend(
        snapshots::names().map(|name| {
            trial(format!("snapshots::{name}"), Box::new(move |gpu| snapshots::check(gpu, &name)))
        }),
    );
    libtest_mimic::run(&arguments, trials).exit_code()
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

/// Fails with words unless something holds.
fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}
