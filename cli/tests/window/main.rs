//! The real window on a virtual display, driven by synthetic keys and mouse. It needs Xvfb, xdotool and a graphics adapter; a software one does.
//! Where one is missing the tests count as ignored and say why; with TERRASOAR_NEED_ADAPTER=1 that is a failure, unless TERRASOAR_NO_WINDOW=1 says
//! that there can be no display.
//!
//! Nothing waits for a time: the program tells what happened (`--narrate`), and the tests wait to hear it.

mod driver;
mod edits;
mod example;
#[path = "../../../tests/support/examples.rs"]
mod examples;
mod tour;
mod troubles;

use driver::Display;
use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::process::ExitCode;

/// A test's outcome: what is wrong, in words.
type Outcome = Result<(), String>;
type Test = fn(&Display) -> Outcome;

const TESTS: &[(&str, Test)] = &[
    ("tour", tour::tour),
    ("settings_are_remembered", tour::settings_are_remembered),
    ("tolerance_suits_the_adapter", tour::tolerance_suits_the_adapter),
    ("window_within_the_screen", tour::window_within_the_screen),
    ("dropped_files", tour::dropped_files),
    ("ground_changed_by_hand", edits::ground_changed_by_hand),
    ("ground_and_picture_changed_by_hand", edits::ground_and_picture_changed_by_hand),
    ("edits_of_a_file_that_is_taken", edits::edits_of_a_file_that_is_taken),
    ("edits_without_room", edits::edits_without_room),
    ("signals_save_what_is_held", edits::signals_save_what_is_held),
    ("windows_of_ones_own", example::windows_of_ones_own),
    ("broken_settings", troubles::broken_settings),
    ("lost_device", troubles::lost_device),
    ("no_adapter", troubles::no_adapter),
    ("no_display", troubles::no_display),
    ("nothing_on_standard_error", troubles::nothing_on_standard_error),
];

fn main() -> ExitCode {
    let mut arguments = Arguments::from_args();
    // Only one window has the keyboard.
    arguments.test_threads = Some(1);
    if arguments.list {
        let none = |(name, _): &(&str, Test)| Trial::test(*name, || Ok(()));
        return libtest_mimic::run(&arguments, TESTS.iter().map(none).collect()).exit_code();
    }
    let display: Result<&'static Display, String> = Display::start().map(|d| &*Box::leak(Box::new(d)));
    if let Err(why) = &display {
        println!("all tests are ignored: {why}");
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|v| v == "1");
        if is_set("TERRASOAR_NEED_ADAPTER") && !is_set("TERRASOAR_NO_WINDOW") {
            return ExitCode::FAILURE;
        }
    }
    let reached = display.as_ref().copied().ok();
    let trials = TESTS.iter().map(|(name, test)| {
        Trial::ignorable_test(*name, move || match reached {
            Some(display) => test(display).map(|()| Completion::Completed).map_err(Failed::from),
            None => Ok(Completion::ignored_with("no display, xdotool or adapter")),
        })
    });
    let conclusion = libtest_mimic::run(&arguments, trials.collect());
    if let Some(display) = reached {
        display.stop();
    }
    conclusion.exit_code()
}

/// Fails with words unless something holds.
fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}
