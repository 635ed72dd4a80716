//! A finished terrain file gets its name, if it opens.
//!
//! Whatever was written is read back from the file as whoever opens it would: header, directory, inert page, the imagery's directory. What would be refused then is refused now, and
//! whatever had the name stays.

use super::atomic::AtomicFile;
use super::lock::WriteLock;
use crate::disk::Disk;
use crate::error::LayoutError;
use crate::header::Header;
use crate::imagery::Imagery;
use crate::source::PreadSource;
use crate::terrain::Terrain;

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
    let again =
        file.file().try_clone().map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
    let terrain = Terrain::from_source(Box::new(PreadSource::over(path, again)?))?;
    Imagery::open(&terrain)?;
    Ok(terrain.header().clone())
}
