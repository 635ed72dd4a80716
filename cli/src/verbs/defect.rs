//! The message when the program itself is at fault.
//!
//! A panic is always a defect. It ends the program with exit code 1 and one line that says so and where to report it. The place in the source and the panic's own words are shown
//! only if RUST_BACKTRACE is set.

use super::output::complain;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::process::ExitCode;
use std::sync::Once;
use terrasoar_import::is_guarded;

/// Does `work`; a panic in it ends in a line on standard error and exit code 1.
pub(super) fn guarded(work: impl FnOnce() -> ExitCode) -> ExitCode {
    let usual = take_hook();
    set_hook(Box::new(move |info| tell(&*usual, info)));
    // Nothing of what the work left half-done is used again.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(ExitCode::FAILURE)
}

/// Says it once, however many threads are hit; nothing where a decoder gives up on a damaged file, for that is told as damage.
fn tell(usual: &(dyn Fn(&PanicHookInfo<'_>) + Sync + Send), info: &PanicHookInfo<'_>) {
    static TOLD: Once = Once::new();
    if is_guarded() {
        return;
    }
    if std::env::var_os("RUST_BACKTRACE").is_some_and(|value| !value.is_empty() && value != "0") {
        usual(info);
    }
    TOLD.call_once(|| {
        complain(concat!(
            "error: terrasoar met a defect of its own and cannot go on; please report it at ",
            env!("CARGO_PKG_REPOSITORY"),
            "/issues, with the command line and, if you can, the files; with RUST_BACKTRACE=1 in the environment it says where it was"
        ));
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Output};

    /// Set where the process is there to meet a defect.
    const ASKED: &str = "TERRASOAR_TEST_DEFECT";

    fn fails<T>() -> T {
        std::hint::black_box(Err::<T, _>("inner words")).unwrap()
    }

    /// What the test below is about; it runs in a process of its own, for it ends it.
    #[test]
    #[ignore = "run by the other test"]
    fn a_defect_is_met() {
        if std::env::var_os(ASKED).is_none() {
            return;
        }
        let code = guarded(|| {
            let threads = [0, 1].map(|_| std::thread::spawn(fails::<()>));
            let _ = threads.map(|thread| thread.join().unwrap_err());
            fails()
        });
        let is_failure = format!("{code:?}") == format!("{:?}", ExitCode::FAILURE);
        std::process::exit(if is_failure { 1 } else { 0 });
    }

    fn met(backtrace: &str) -> Output {
        let (_, module) = module_path!().split_once("::").unwrap();
        let name = format!("{module}::a_defect_is_met");
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", &name, "--ignored", "--nocapture", "--test-threads", "1"]);
        command.env(ASKED, "1").env("RUST_BACKTRACE", backtrace).output().unwrap()
    }

    #[test]
    fn a_panic_ends_in_plain_words_and_exit_code_1() {
        let output = met("0");
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(said.starts_with("error: terrasoar met a defect"), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(
            said.contains("/issues") && !said.contains("../src") && !said.contains("inner words"),
            "{said}"
        );
        let said = String::from_utf8(met("1").stderr).unwrap();
        assert!(said.contains("defect.rs") && said.contains("inner words"), "{said}");
    }
}
