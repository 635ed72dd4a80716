//! Opens what a name leads to without waiting. Opening a pipe whose other end is not open would otherwise wait for ever. What kind of file it is can be asked once it is open.

use std::fs::OpenOptions;

/// `options` for a file that may be a pipe. Regular files are opened as ever.
pub fn without_waiting(options: &mut OpenOptions) -> &mut OpenOptions {
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32);
    }
    options
}
