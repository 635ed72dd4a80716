//! Tests that draw: one graphics adapter for all of a binary, one after the other.
//!
//! A software adapter does. Where there is none the tests count as ignored and say why; with TERRASOAR_NEED_ADAPTER=1, as `./test` sets it where it finds a driver, that is a
//! failure. Cost: one device for the whole process.

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::process::ExitCode;
use terrasoar_render::Gpu;

/// A test's outcome: what is wrong, in words.
pub(crate) type Outcome = Result<(), String>;

/// Fails with words unless something holds.
pub(crate) fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}

/// A test, and whether the device has what it needs: if not, in words what it lacks.
pub(crate) struct Drawn {
    pub(crate) name: String,
    pub(crate) lacks: fn(&Gpu, &str) -> Option<&'static str>,
    pub(crate) test: Box<dyn Fn(&Gpu) -> Outcome + Send>,
}

/// Runs the tests that the command line picks.
pub(crate) fn run(tests: impl IntoIterator<Item = Drawn>) -> ExitCode {
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
    let trials = tests.into_iter().map(|Drawn { name, lacks, test }| {
        let lacking = gpu.and_then(|gpu| lacks(gpu, &name));
        Trial::ignorable_test(name, move || match (gpu, lacking) {
            (None, _) => Ok(Completion::ignored_with("no adapter")),
            (Some(_), Some(why)) => Ok(Completion::ignored_with(why)),
            (Some(gpu), None) => test(gpu).map(|()| Completion::Completed).map_err(Failed::from),
        })
    });
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}
