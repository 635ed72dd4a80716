//! The verbs that draw, by the real program.
//!
//! These need a graphics adapter (tests/support/adapter.rs).

#[path = "../../../tests/support/adapter.rs"]
mod adapter;
#[cfg(unix)]
#[path = "../program/killed.rs"]
#[allow(dead_code, reason = "shared with the tests of the other verbs")]
mod killed;
mod looks;
mod maps;
mod outputs;
mod program;
#[path = "../program/support.rs"]
#[allow(dead_code, reason = "shared with the tests of the other verbs")]
mod support;

use adapter::{Drawn, Outcome, ensure};
use std::process::ExitCode;
use terrasoar_render::Gpu;

type Test = (&'static str, fn(&Gpu) -> Outcome);

fn main() -> ExitCode {
    let tests = [looks::TESTS, maps::TESTS, outputs::TESTS, program::TESTS].concat().into_iter();
    adapter::run(tests.map(|(name, test): Test| Drawn {
        name: name.into(),
        lacks: |_, _| None,
        test: Box::new(test),
    }))
}
