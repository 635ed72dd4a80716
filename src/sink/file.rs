//! A file that appears when it is complete, or a stream by its name.
//!
//! Links are followed: what they lead to decides. A descriptor of the process (`/dev/stdout`, `/dev/fd/3`) is written to directly, also where it leads to a file, because the program that
//! opened it goes on using it. Invariant: a descriptor, pipe or device is never replaced by a file.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::atomic::AtomicFile;

/// Links that are followed before it is given up.
const MOST_LINKS: usize = 40;

/// Takes what goes to a path.
#[derive(Debug)]
pub struct FileSink {
    out: BufWriter<To>,
    /// What is given its name at the end; nothing for a stream.
    file: Option<AtomicFile>,
    path: PathBuf,
}

#[derive(Debug)]
enum To {
    File(File),
    Stdout,
    Stderr,
}

/// What a path leads to.
#[derive(Debug, PartialEq, Eq)]
enum Way {
    /// A file, or nothing yet.
    File,
    /// A descriptor of this process, by its number.
    Descriptor(u32),
    /// A pipe or a device.
    Device,
}

/// Whether what is written to `path` goes to a stream (a pipe, a device, a descriptor of the process) instead of a file.
pub fn is_stream(path: &Path) -> bool {
    way(path) != Way::File
}

impl FileSink {
    /// Opens the stream that `path` leads to, or begins a file that will have this name. Opening a named pipe waits for its reader.
    ///
    /// # Errors
    /// Those of [`AtomicFile::create`]; [`LayoutError::Io`].
    pub fn create(path: &Path) -> Result<Self, LayoutError> {
        let opened = |to| Ok((to, None));
        let failed = |source| LayoutError::io(path, "cannot write to it", source);
        let (to, file) = match way(path) {
            Way::Descriptor(1) => opened(To::Stdout),
            Way::Descriptor(2) => opened(To::Stderr),
            // Whoever opened the descriptor may have written to it.
            Way::Descriptor(_) => File::options()
                .append(true)
                .open(path)
                .map_err(failed)
                .and_then(|file| opened(To::File(file))),
            Way::Device => {
                File::options().write(true).open(path).map_err(failed).and_then(|file| opened(To::File(file)))
            }
            Way::File => {
                let file = AtomicFile::create(path)?;
                let to = To::File(file.file().try_clone().map_err(failed)?);
                Ok((to, Some(file)))
            }
        }?;
        Ok(Self { out: BufWriter::with_capacity(1 << 16, to), file, path: path.to_owned() })
    }

    /// Writes what is left, and gives a file its name.
    ///
    /// # Errors
    /// [`LayoutError::Io`]; a file is not there then, or is the one that was there before.
    pub fn publish(mut self) -> Result<(), LayoutError> {
        self.out.flush().map_err(|source| LayoutError::io(&self.path, "cannot write to it", source))?;
        self.file.map_or(Ok(()), AtomicFile::publish)
    }
}

impl Write for FileSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Write for To {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Stdout => io::stdout().write(bytes),
            Self::Stderr => io::stderr().write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Stdout => io::stdout().flush(),
            Self::Stderr => io::stderr().flush(),
        }
    }
}

fn way(path: &Path) -> Way {
    if let Some(number) = descriptor(path) {
        return Way::Descriptor(number);
    }
    match std::fs::metadata(path) {
        Ok(meta) if !meta.is_file() && !meta.is_dir() => Way::Device,
        _ => Way::File,
    }
}

/// The number of the descriptor that `path` is a name of, whatever that leads to.
fn descriptor(path: &Path) -> Option<u32> {
    if cfg!(not(unix)) {
        return None;
    }
    let mut at = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let folder = std::fs::canonicalize(at.parent()?).ok()?;
        let own = Path::new("/proc").join(std::process::id().to_string()).join("fd");
        if folder == own || folder == Path::new("/dev/fd") {
            return at.file_name()?.to_str()?.parse().ok();
        }
        // A relative link starts at the folder it lies in.
        at = folder.join(std::fs::read_link(folder.join(at.file_name()?)).ok()?);
    }
    None
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::symlink;

    fn put(path: &Path, text: &str) {
        let mut sink = FileSink::create(path).unwrap();
        sink.write_all(text.as_bytes()).unwrap();
        sink.publish().unwrap();
    }

    #[test]
    fn a_file_is_replaced_when_the_new_one_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        put(&path, "one");
        let mut sink = FileSink::create(&path).unwrap();
        sink.write_all(&[b'x'; 1 << 18]).unwrap();
        drop(sink);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "one");
        put(&path, "two");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "two");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn streams_are_written_to_and_stay() {
        let folder = tempfile::tempdir().unwrap();
        for device in ["/dev/null", "/dev/stdout", "/dev/stderr"] {
            assert!(is_stream(Path::new(device)), "{device}");
        }
        put(Path::new("/dev/null"), "gone");
        let null = folder.path().join("null");
        symlink("/dev/null", &null).unwrap();
        put(&null, "gone");
        assert!(std::fs::symlink_metadata(&null).unwrap().is_symlink());
        assert_eq!(descriptor(Path::new("/dev/stdout")), Some(1));
        assert!(!is_stream(&folder.path().join("none")) && !is_stream(folder.path()));
    }

    /// What the shell had written to the file before stays, and what it writes afterwards follows.
    #[test]
    fn a_descriptor_that_leads_to_a_file_is_appended_to() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        let mut log = File::options().append(true).create(true).open(&path).unwrap();
        log.write_all(b"before ").unwrap();
        let link = folder.path().join("link");
        symlink(format!("/dev/fd/{}", log.as_raw_fd()), &link).unwrap();
        for name in [&link, Path::new(&format!("/proc/self/fd/{}", log.as_raw_fd()))] {
            assert!(is_stream(name));
            put(name, "ours ");
        }
        log.write_all(b"after").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "before ours ours after");
        assert!(!is_stream(&path), "by its own name it is a file");
    }

    #[test]
    fn a_pipe_is_written_to() {
        let (mut reader, writer) = io::pipe().unwrap();
        put(Path::new(&format!("/dev/fd/{}", writer.as_raw_fd())), "through");
        drop(writer);
        let mut text = String::new();
        reader.read_to_string(&mut text).unwrap();
        assert_eq!(text, "through");
    }
}
