//! Signals that would end the program without a word.
//!
//! A mapped file that others cut short, or whose disk fails, raises SIGBUS where it is read: that ends the program as any failure does, with a line that says what happened and what to do,
//! and exit code 1. Verbs that read instead of mapping (`view`, `iobench` over a pool) never get there. A limit on the size of files (`ulimit -f`) raises SIGXFSZ: heard, it leaves
//! the write an error like that of a full disk, and whoever writes says so.

use signal_hook::consts::{SIGBUS, SIGXFSZ};
use signal_hook::{flag, low_level};

/// What is said of SIGBUS; made beforehand, for nothing may be allocated when it is needed.
const WORDS: &[u8] =
    b"error: a mapped file cannot be read any more: it was cut short while it was open, or its disk fails. \
Restore a copy or build it again, and let nobody write to it in place\n";

/// Sees to both for the rest of the program's life. Where a signal cannot be heard all is as the system does it.
pub(super) fn heed() {
    // Whatever hears the signal will do; nobody asks the flag.
    let _ = flag::register(SIGXFSZ, std::sync::Arc::default());
    #[expect(unsafe_code, reason = "what may be done when a signal comes is up to whoever registers")]
    // SAFETY: the handler makes two system calls, write and _exit, which POSIX lists as safe in signal handlers; it allocates nothing, locks nothing and does
    // not return. rustix's write is the bare call on the descriptor.
    let _ = unsafe {
        low_level::register(SIGBUS, || {
            // If nobody hears it the exit code still says so.
            let _ = rustix::io::write(rustix::stdio::stderr(), WORDS);
            low_level::exit(1)
        })
    };
}
