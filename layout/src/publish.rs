//! A finished terrain file gets its name only if it opens, and all of its directory reads.
//!
//! What was written is read back from the file: header, the whole directory, inert page, the imagery's directory. A file that would be refused when it is opened is not published, and
//! the file that had the name stays.

use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::disk::Disk;
use crate::file::header::Header;
use crate::file::lock::WriteLock;
use crate::file::source::PreadSource;
use crate::imagery::Imagery;
use crate::read::terrain::Terrain;

/// Publishes a terrain file in place of whatever has its name, or of the file that `over` is the lock of.
///
/// # Errors
/// As [`Terrain::open`] for a file that does not open, which is not published; as [`AtomicFile::publish`].
pub(crate) fn publish_terrain(
    disk: &dyn Disk,
    file: AtomicFile,
    over: Option<&WriteLock>,
) -> Result<Header, LayoutError> {
    let header = check_opens(&file)?;
    match over {
        Some(lock) => file.publish_over(disk, lock)?,
        None => file.publish_on(disk)?,
    }
    Ok(header)
}

fn check_opens(file: &AtomicFile) -> Result<Header, LayoutError> {
    let path = file.target();
    let again = file
        .file()
        .try_clone()
        .map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
    let terrain = Terrain::from_source(Box::new(PreadSource::over(path, again)?))?;
    terrain.check_directory()?;
    Imagery::open(&terrain)?;
    Ok(terrain.header().clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::{BuildOptions, build};
    use crate::dem::{MemoryDem, SampleType};
    use crate::file::disk::SystemDisk;
    use crate::progress::Silent;

    /// Each of a file's pages damaged in turn: what leads to it is checked, and the file that has the name stays.
    #[test]
    fn what_does_not_open_is_not_published() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.iqt");
        let dem = MemoryDem::from_fn([40, 30], SampleType::I16, |x, y| f64::from(x * 3 + y));
        let options = BuildOptions { spacing_m: Some([10.0; 2]), ..BuildOptions::default() };
        let header = build(&dem, &path, &options, &Silent).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let last = header.root_page as usize;
        for (page, opens) in [(0, false), (2, false), (last, false), (last - 1, false), (3, true)] {
            let mut damaged = bytes.clone();
            damaged[page * 4096 + 5] ^= 1;
            let file = AtomicFile::create(&path).unwrap();
            SystemDisk.write_at(file.file(), &damaged, 0).unwrap();
            let done = publish_terrain(&SystemDisk, file, None);
            assert_eq!(done.is_ok(), opens, "page {page}: {done:?}");
            let expected = if opens { &damaged } else { &bytes };
            assert!(&std::fs::read(&path).unwrap() == expected, "page {page}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
