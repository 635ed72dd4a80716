//! Limits that the system sets: one on the size of files (`ulimit -f`) is an error like that of a full disk, and not the end of the program
//! by a signal, without a word.

/// From here on a write past the limit fails, and whoever writes says so.
pub(super) fn heed_file_size_limit() {
    #[cfg(unix)]
    {
        // Whatever hears the signal will do; nobody asks the flag. Where it cannot be heard all is as before.
        let heard = std::sync::Arc::default();
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, heard);
    }
}
