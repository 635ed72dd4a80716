//! Opens what a name leads to without waiting for it: a pipe whose other end nobody has would keep whoever opens it for ever. What it is can be asked once it is open.

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
