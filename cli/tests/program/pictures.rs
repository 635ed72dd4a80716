//! Verbs that draw, where nothing can be drawn: what is wrong is told, and nothing is left.

use crate::support::{Bench, text};

/// Variables that hide every adapter: one kind of driver, and none of that kind.
const NO_ADAPTER: [(&str, &str); 3] =
    [("WGPU_BACKEND", "vulkan"), ("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent")];

#[test]
#[cfg(feature = "pictures")]
fn without_an_adapter_it_says_what_to_install() {
    let bench = Bench::with_flight();
    let snapshot = ["snapshot", "land.iqt", "-o", "a.png"];
    let movie = ["movie", "land.iqt", "--flight", "land.flight", "-o", "a.gif"];
    for args in [&snapshot[..], &movie] {
        let output = bench.command(args).envs(NO_ADAPTER).output().unwrap();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("mesa-vulkan-drivers"), "{message}");
    }
    assert_eq!(bench.names(), ["land.flight", "land.iqt", "land.tif"]);
}

#[test]
fn a_report_without_a_picture_is_a_report() {
    let bench = Bench::with_flight();
    let args = ["compare", "land.iqt", "--flight", "land.flight", "--no-sweeps", "-o", "r"];
    let output = bench.command(&args).envs(NO_ADAPTER).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(!bench.path("r/flight.png").exists());
    let page = std::fs::read_to_string(bench.path("r/report.html")).unwrap();
    let why = if cfg!(feature = "pictures") { "mesa-vulkan-drivers" } else { "without the feature pictures" };
    assert!(page.contains(why), "{page}");
}

#[test]
#[cfg(not(feature = "pictures"))]
fn without_the_feature_the_verbs_say_so() {
    let bench = Bench::new();
    for verb in ["snapshot", "movie"] {
        let message = bench.bad(1, &[verb, "a.iqt", "--style", "relief", "-o", "a.png"]);
        assert!(message.contains("feature pictures"), "{message}");
    }
}

#[test]
#[cfg(not(feature = "view"))]
fn without_a_window_the_verb_says_so() {
    let message = Bench::new().bad(1, &["view", "a.iqt", "--style", "relief"]);
    assert!(message.contains("without a window") && message.contains("feature view"), "{message}");
}
