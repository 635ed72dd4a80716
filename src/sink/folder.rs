//! A folder of files that appear when all of them are complete.
//!
//! While they are made, they lie one behind the other in one file without a name. So nothing is left, whatever ends the program. Then a new folder is filled under a hidden name,
//! `.NAME.*.terrasoar-new`, and renamed. If the folder is there already, the files go into it one by one, each complete, in the order in which they were added. A process killed while they are
//! copied out can leave that hidden folder. Files of other names are left alone. Cost: everything is written twice, and takes twice the room for a moment.

use super::file::FileSink;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::atomic::folder_of;
use terrasoar_layout::file::disk::sync_folder;
use terrasoar_layout::unfinished;

/// Takes the files of a folder.
#[derive(Debug)]
pub struct FolderSink {
    folder: PathBuf,
    spool: BufWriter<File>,
    /// Names, and how long what they name is.
    files: Vec<(String, u64)>,
}

const CANNOT_WRITE: &str = "cannot write the file";
const CANNOT_MAKE: &str = "cannot make the folder";

impl FolderSink {
    /// Begins a folder that will be called `folder`, or files that go into it if it is there.
    ///
    /// # Errors
    /// [`LayoutError::Io`]: neither is it a folder nor can one be made there.
    pub fn create(folder: &Path) -> Result<Self, LayoutError> {
        let nearest = folder.ancestors().find(|ancestor| ancestor.exists());
        let nearest = nearest.filter(|ancestor| !ancestor.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Below a file this fails as making the folder would.
        let spool = tempfile::tempfile_in(nearest)
            .map_err(|source| LayoutError::io(folder, "cannot write there", source))?;
        Ok(Self {
            folder: folder.to_owned(),
            spool: BufWriter::with_capacity(1 << 18, spool),
            files: Vec::new(),
        })
    }

    /// Adds the file `name`, a bare name, which holds what `write` writes.
    ///
    /// # Errors
    /// [`LayoutError::Io`].
    pub fn add(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), LayoutError> {
        let mut counted = Counted { out: &mut self.spool, bytes: 0 };
        let written = write(&mut counted);
        let bytes = counted.bytes;
        written.map_err(|source| LayoutError::io(&self.folder.join(name), CANNOT_WRITE, source))?;
        self.files.push((name.to_owned(), bytes));
        Ok(())
    }

    /// Gives the files their names; returns their paths, in the order in which they were added.
    ///
    /// # Errors
    /// [`LayoutError::Io`], which names the file. A new folder is not there then; of one that was, the files before it are complete.
    pub fn publish(self) -> Result<Vec<PathBuf>, LayoutError> {
        let Self { folder, spool, files } = self;
        let failed = |source| LayoutError::io(&folder, CANNOT_WRITE, source);
        let mut spool = spool.into_inner().map_err(|error| failed(error.into_error()))?;
        spool.seek(SeekFrom::Start(0)).map_err(failed)?;
        if !folder.exists() {
            publish_new(&folder, &mut spool, &files)?;
        } else {
            for (name, bytes) in &files {
                let path = folder.join(name);
                let mut out = FileSink::create(&path)?;
                copy(&mut spool, *bytes, &mut out).map_err(|e| LayoutError::io(&path, CANNOT_WRITE, e))?;
                out.publish()?;
            }
        }
        Ok(files.iter().map(|(name, _)| folder.join(name)).collect())
    }
}

fn publish_new(folder: &Path, spool: &mut File, files: &[(String, u64)]) -> Result<(), LayoutError> {
    let failed = |source| LayoutError::io(folder, CANNOT_MAKE, source);
    // Folders above it that are missing come into being with it, by one call.
    let top = folder.ancestors().take_while(|above| !above.as_os_str().is_empty() && !above.exists()).last();
    let top = top.unwrap_or(folder);
    let parent = folder_of(top);
    let (guard, hidden) = unfinished::make(|| {
        let hidden = hidden_in(parent, top)?;
        Ok((hidden.path().to_owned(), hidden))
    })
    .map_err(failed)?;
    let inside = folder.strip_prefix(top).unwrap_or(Path::new(""));
    let filled =
        if inside.as_os_str().is_empty() { hidden.path().to_owned() } else { hidden.path().join(inside) };
    std::fs::create_dir_all(&filled).map_err(failed)?;
    for (name, bytes) in files {
        let written = File::create_new(filled.join(name)).and_then(|mut file| {
            copy(spool, *bytes, &mut file)?;
            file.sync_all()
        });
        written.map_err(|source| LayoutError::io(&folder.join(name), CANNOT_WRITE, source))?;
    }
    for synced in filled.ancestors().take_while(|above| above.starts_with(hidden.path())) {
        sync_folder(synced).map_err(failed)?;
    }
    guard.finish(|| std::fs::rename(hidden.path(), top)).map_err(failed)?;
    // What had this name has another now.
    let _ = hidden.keep();
    sync_folder(parent).map_err(failed)
}

/// A new folder in `parent`, where `folder` will be, with a name that says so.
fn hidden_in(parent: &Path, folder: &Path) -> io::Result<tempfile::TempDir> {
    // A file system takes names of 255 bytes, and something is added to this one.
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let prefix = format!(".{}.", &name[..name.floor_char_boundary(200)]);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".terrasoar-new");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    builder.tempdir_in(parent)
}

/// Copies the next `bytes` of `spool`, all of them.
fn copy(spool: &mut File, bytes: u64, to: &mut impl Write) -> io::Result<()> {
    match io::copy(&mut spool.take(bytes), to)? {
        all if all == bytes => Ok(()),
        _ => Err(io::ErrorKind::UnexpectedEof.into()),
    }
}

/// Counts what goes through.
struct Counted<'w> {
    out: &'w mut BufWriter<File>,
    bytes: u64,
}

impl Write for Counted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn filled(folder: &Path, files: &[(&str, &str)]) -> FolderSink {
        let mut sink = FolderSink::create(folder).unwrap();
        for (name, text) in files {
            sink.add(name, |out| out.write_all(text.as_bytes())).unwrap();
        }
        sink
    }

    #[test]
    fn nothing_is_there_before_the_end_and_everything_then() {
        let outside = tempfile::tempdir().unwrap();
        let folder = outside.path().join("x/y/report");
        let sink = filled(&folder, &[("a", "one"), ("b", ""), ("c", "three")]);
        assert!(names(outside.path()).is_empty());
        drop(sink);
        assert!(names(outside.path()).is_empty());
        let paths = filled(&folder, &[("a", "one"), ("b", ""), ("c", "three")]).publish().unwrap();
        assert_eq!(paths, ["a", "b", "c"].map(|name| folder.join(name)));
        assert_eq!(
            (names(&folder).len(), names(&outside.path().join("x/y"))),
            (3, vec!["report".to_owned()])
        );
        assert_eq!(std::fs::read_to_string(folder.join("c")).unwrap(), "three");

        // What else lies in a folder stays.
        std::fs::write(folder.join("mine"), "text").unwrap();
        filled(&folder, &[("c", "3"), ("d", "4")]).publish().unwrap();
        assert_eq!(names(&folder), ["a", "b", "c", "d", "mine"]);
        assert_eq!(std::fs::read_to_string(folder.join("c")).unwrap(), "3");
        assert_eq!(names(&outside.path().join("x/y")), ["report"]);
        assert_eq!(names(outside.path()), ["x"]);
    }

    #[test]
    fn a_failure_leaves_nothing() {
        let outside = tempfile::tempdir().unwrap();
        let file = outside.path().join("file");
        std::fs::write(&file, "x").unwrap();
        assert!(FolderSink::create(&file.join("below")).unwrap_err().to_string().contains("below"));
        let folder = outside.path().join("new");
        let mut sink = filled(&folder, &[("a", "one")]);
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        let error = sink.add("b", |_| Err(full())).unwrap_err().to_string();
        assert!(error.contains("new") && error.contains("b: cannot write"), "{error}");
        drop(sink);
        // A name that cannot be made.
        filled(&folder, &[("a", "one"), ("no/such", "two")]).publish().unwrap_err();
        assert_eq!(names(outside.path()), ["file"]);
    }
}
