//! How figures are made, for reports: by which program, on which machine, when, by which command. **The one place that reads the calendar for them.**

use super::cap::GROUP_FLAG;
use std::ffi::OsString;
use std::path::Path;
use std::sync::LazyLock;
use terrasoar::flyover::Quality;
use terrasoar_lab::made::Made;
use terrasoar_lab::report::ReportTitle;

/// The commit that the program was built from, where the build was told.
const COMMIT: Option<&str> = option_env!("TERRASOAR_COMMIT");

/// The version, and the commit in a line of its own.
pub(super) static LONG_VERSION: LazyLock<String> = LazyLock::new(|| {
    let commit = COMMIT.map(|commit| format!("\ncommit {commit}")).unwrap_or_default();
    format!("{}{commit}", env!("CARGO_PKG_VERSION"))
});

/// The words that were typed: a copy of the program under a cap has a flag more.
fn typed(words: impl Iterator<Item = OsString>) -> Vec<String> {
    let mut words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    if words.len() > 2 && words[words.len() - 2] == GROUP_FLAG {
        words.truncate(words.len() - 2);
    }
    words
}

/// How the figures of this run come about.
pub(super) fn made() -> Made {
    let words = typed(std::env::args_os());
    let program = concat!("terrasoar ", env!("CARGO_PKG_VERSION"));
    // To the second.
    let now = jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string();
    Made::new(program, machine(), now).commit(COMMIT.map(str::to_owned)).command(&words)
}

/// What was flown, and how the figures come about.
pub(super) fn title(terrain: &Path, flight: &Path, quality: Quality) -> ReportTitle {
    ReportTitle {
        terrain: name(terrain),
        flight: name(flight),
        tolerance_px: quality.tolerance_px,
        metric: quality.metric,
        viewport: quality.viewport,
        exaggeration: quality.vertical_exaggeration,
        culling: quality.culling,
        cache_mib: quality.cache_bytes.map(|bytes| bytes >> 20),
        made: Some(made()),
    }
}

/// A file's name without its folders.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// The machine in words: "linux x86_64, Intel(R) Xeon(R), 2 cores".
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
    let processor = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| model(&text));
    let processor = processor.map(|name| format!(", {name}")).unwrap_or_default();
    format!("{system}{processor}, {cores} {}", if cores == 1 { "core" } else { "cores" })
}

/// The processor's name in what Linux says of it.
fn model(text: &str) -> Option<String> {
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    line.split_once(':').map(|(_, name)| name.trim().to_owned()).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_is_what_was_typed() {
        let words = |line: &str| typed(line.split(' ').map(OsString::from)).join(" ");
        assert_eq!(words("t iobench a --cap 64 --cap-group /sys/x"), "t iobench a --cap 64");
        assert_eq!(words("t iobench a --cap 64"), "t iobench a --cap 64");
        assert!(LONG_VERSION.starts_with(env!("CARGO_PKG_VERSION")));
    }

    #[test]
    fn a_processor_is_named_where_the_system_names_it() {
        assert_eq!(model("processor\t: 0\nmodel name\t: Fast 3000\n").as_deref(), Some("Fast 3000"));
        assert_eq!(model("processor : 0\n"), None);
        assert!(machine().contains(std::env::consts::ARCH));
        let date = made().date;
        assert!(date.len() == 20 && date.ends_with('Z') && date.starts_with("20"), "{date}");
    }
}
