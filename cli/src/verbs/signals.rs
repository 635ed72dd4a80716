//! Signals that would otherwise end the program without a message, or leave files behind.
//!
//! A mapped file that another program shortens, or whose disk fails, raises SIGBUS when it is read. This ends the program like any failure, with a line that says what happened and what to do,
//! and exit code 1. Verbs that read instead of mapping (`view`, `iobench` over a pool) do not get this signal. A limit on the size of files (`ulimit -f`) raises SIGXFSZ. It is handled, so that
//! the write fails with an error like that of a full disk, which is reported.
//!
//! SIGINT, SIGTERM and SIGHUP end the program as usual, but first files and folders that have a name before they are complete are removed (`unfinished` in the layout package). A thread waits for these signals,
//! because a handler may do very little. A window saves its edits and closes first; a second signal ends it at once. Signals that the program was started to ignore, as by `nohup`, stay ignored. While a copy of the program does the work, the signal is passed to the copy.

use signal_hook::consts::{SIGBUS, SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::{flag, low_level};
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::process::ExitStatus;
use std::process::{Child, Command};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, AtomicUsize, Ordering};
use terrasoar_layout::unfinished;

/// What is said of SIGBUS; made beforehand, for nothing may be allocated when it is needed.
const WORDS: &[u8] =
    b"error: a mapped file cannot be read any more: it was cut short while it was open, or its disk fails. \
Restore a copy or build it again, and let nobody write to it in place\n";

/// Signals that ask the program to end.
const ENDING: [i32; 3] = [SIGINT, SIGTERM, SIGHUP];

/// The copy of this program that is waited for; 0 without one.
static COPY: AtomicI32 = AtomicI32::new(0);
/// The signal that came while it was; 0 if none did.
static CAME: AtomicI32 = AtomicI32::new(0);

/// Sees to all of them for the rest of the program's life. Where a signal cannot be heard all is as the system does it.
pub(super) fn heed() {
    // Whatever hears the signal will do; nobody asks the flag.
    let _ = flag::register(SIGXFSZ, Arc::default());
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
    let _ = hear_endings();
}

/// Starts the thread that ends the program.
fn hear_endings() -> std::io::Result<()> {
    let (mut heard, told) = UnixStream::pair()?;
    let which = Arc::new(AtomicUsize::new(0));
    let known = Arc::clone(&which);
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        let mut byte = [0];
        while heard.read_exact(&mut byte).is_ok() {
            end(known.load(Ordering::Relaxed) as i32);
        }
    })?;
    for signal in ENDING.into_iter().filter(|signal| !is_ignored(*signal)) {
        // First which one it is, then that it is there.
        flag::register_usize(signal, Arc::clone(&which), signal as usize)?;
        low_level::pipe::register(signal, told.try_clone()?)?;
    }
    Ok(())
}

/// Ends the program as `signal` would have, or passes it on to the copy.
fn end(signal: i32) {
    let copy = COPY.load(Ordering::SeqCst);
    if copy > 0 {
        CAME.store(signal, Ordering::SeqCst);
        #[expect(unsafe_code, reason = "the standard library sends SIGKILL only")]
        // SAFETY: kill touches no memory of this process. The number is that of a child that was not yet waited for, or no longer a process.
        let _ = unsafe { libc::kill(copy, signal) };
        return;
    }
    #[cfg(feature = "view")]
    if crate::asked::anybody() {
        CAME.store(signal, Ordering::SeqCst);
        return;
    }
    unfinished::remove_all();
    // It comes back only for signals that end nothing.
    let _ = low_level::emulate_default_handler(signal);
}

fn is_ignored(signal: i32) -> bool {
    let mut now = std::mem::MaybeUninit::<libc::sigaction>::uninit();
    #[expect(unsafe_code, reason = "nothing else tells what a signal is set to")]
    // SAFETY: without a new action sigaction changes nothing; where it succeeds it has filled in the old one, which is plain data.
    unsafe {
        libc::sigaction(signal, std::ptr::null(), now.as_mut_ptr()) == 0
            && now.assume_init().sa_sigaction == libc::SIG_IGN
    }
}

/// Runs a copy of this program, which hears the signals that come meanwhile. `after` is done when it has ended; then the program ends too if such a signal came.
pub(super) fn run_copy(command: &mut Command, after: impl FnOnce()) -> std::io::Result<ExitStatus> {
    let mut copy: Child = command.spawn()?;
    COPY.store(i32::try_from(copy.id()).unwrap_or(0), Ordering::SeqCst);
    let status = copy.wait();
    COPY.store(0, Ordering::SeqCst);
    after();
    end_as_asked();
    status
}

/// Ends the program as the signal would have that came meanwhile, if one did.
pub(super) fn end_as_asked() {
    let came = CAME.load(Ordering::SeqCst);
    if came != 0 {
        end(came);
    }
}
