//! A mapped file that others cut short, or whose disk fails, raises SIGBUS where it is read. Here that ends the program as any failure does: a line that says what happened and what to
//! do, and exit code 1, instead of a dead process. Verbs that read instead of mapping (`view`, `iobench`) never get there.

use signal_hook::consts::SIGBUS;
use signal_hook::low_level::{exit, register};

/// What is said; made beforehand, for nothing may be allocated when it is needed.
const WORDS: &[u8] =
    b"error: a mapped file cannot be read any more: it was cut short while it was open, or its disk fails. \
Restore a copy or build it again, and let nobody write to it in place\n";

/// Sees to it for the rest of the program's life.
pub(super) fn watch() {
    #[expect(unsafe_code, reason = "what may be done when a signal comes is up to whoever registers")]
    // SAFETY: the handler makes two system calls, write and _exit, which POSIX lists as safe in signal handlers; it allocates nothing, locks nothing and does
    // not return. rustix's write is the bare call on the descriptor.
    let registered = unsafe {
        register(SIGBUS, || {
            // If nobody hears it the exit code still says so.
            let _ = rustix::io::write(rustix::stdio::stderr(), WORDS);
            exit(1)
        })
    };
    // Without a handler the system's own word has to do.
    let _ = registered;
}
