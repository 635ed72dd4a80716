//! What is seen of real data: no cracks, the same picture from both engines, the right depth.
//!
//! These need a graphics adapter; a software one does. Where there is none they count as ignored and say why; with TERRASOAR_NEED_ADAPTER=1, as
//! continuous integration sets it, that is a failure.

mod cracks;
mod depth;
mod engines;
mod loss;
mod own_pass;
mod paint;
mod rig;

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::process::ExitCode;
use terrasoar_render::Gpu;

/// A test's outcome: what is wrong, in words.
type Outcome = Result<(), String>;
type Test = (&'static str, fn(&Gpu) -> Outcome);

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
    let reads_depth =
        |name: &str| ["cracks::", "depth::", "own_pass::things"].iter().any(|part| name.starts_with(part));
    let trials = [cracks::TESTS, depth::TESTS, engines::TESTS, loss::TESTS, own_pass::TESTS, paint::TESTS]
        .concat()
        .into_iter()
        .map(|(name, test): Test| {
            Trial::ignorable_test(name, move || match gpu {
                None => Ok(Completion::ignored_with("no adapter")),
                Some(gpu) if reads_depth(name) && !gpu.capabilities.depth_copies => {
                    Ok(Completion::ignored_with("depth cannot be read on this device"))
                }
                Some(gpu) => test(gpu).map(|()| Completion::Completed).map_err(Failed::from),
            })
        });
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}

/// Fails with words unless something holds.
fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}
