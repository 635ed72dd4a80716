//! Other layouts on a real disk: the page trace of a flight, replayed against a file of the layout's size.
//!
//! The file is full of bytes that do not compress and has no holes; otherwise the disk might not be read. It is only there to be read. It lies in a folder that the
//! user chooses and has no name, so that even a killed program leaves nothing. Each replay starts cold.

use super::kernel;
use super::timed::{UpdateCost, observed};
use super::{IoBenchError, PAGE_BYTES};
use std::fs::File;
use std::hint::black_box;
use std::io::Write;
use std::path::{Path, PathBuf};
use terrasoar_layout::file::source::{MapSource, Source};

/// Room to leave on the disk.
const SPARE_BYTES: u64 = 256 << 20;

/// Bytes written at a time.
const CHUNK_BYTES: usize = 4 << 20;

/// How pages are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Touched in a map without read-ahead.
    Map,
    /// Read into a buffer, without read-ahead too.
    Pread,
}

/// A file of a layout's size.
#[derive(Debug)]
pub struct ScratchFile {
    /// By which it is opened; it has no name of its own.
    path: PathBuf,
    file: File,
}

impl ScratchFile {
    /// Makes a file of `bytes`, rounded up to whole pages, in `folder`. `done` hears the number of bytes written.
    ///
    /// # Errors
    /// [`IoBenchError::NoRoom`] if the disk has not the room or does not say; I/O.
    pub fn create(folder: &Path, bytes: u64, done: &mut dyn FnMut(u64)) -> Result<Self, IoBenchError> {
        let io = |doing| move |source| IoBenchError::Io { doing, path: folder.into(), source };
        let bytes = bytes.next_multiple_of(PAGE_BYTES);
        let free = kernel::free_bytes(folder).map_err(io("cannot ask for the room left"))?;
        if free.is_none_or(|free| free < bytes + SPARE_BYTES) {
            return Err(IoBenchError::NoRoom { folder: folder.into(), bytes, free });
        }
        let mut file = tempfile::tempfile_in(folder).map_err(io("cannot create a scratch file"))?;
        let mut state = 0x9e37_79b9_7f4a_7c15;
        let mut chunk = vec![0u8; CHUNK_BYTES];
        let mut written = 0;
        while written < bytes {
            for word in chunk.chunks_exact_mut(8) {
                word.copy_from_slice(&next_random(&mut state).to_le_bytes());
            }
            let now = (bytes - written).min(CHUNK_BYTES as u64);
            file.write_all(&chunk[..now as usize]).map_err(io("cannot write a scratch file"))?;
            written += now;
            done(written);
        }
        // Only clean pages can be forgotten.
        file.sync_all().map_err(io("cannot write a scratch file"))?;
        Ok(Self { path: path_of(&file), file })
    }

    /// Reads each frame's pages in turn, from a file that the system was asked to forget. `done` hears the number of frames finished.
    ///
    /// # Errors
    /// The file cannot be forgotten, opened or read; a page lies outside it.
    pub fn replay(
        &self,
        trace: &[Vec<u64>],
        access: Access,
        done: &mut dyn FnMut(u64),
    ) -> Result<Vec<UpdateCost>, IoBenchError> {
        kernel::forget_file(&self.path).map_err(self.io("cannot drop the scratch file from memory"))?;
        match access {
            Access::Map => self.replay_by_map(trace, done),
            Access::Pread => self.replay_by_reads(trace, done),
        }
    }

    fn io(&self, doing: &'static str) -> impl Fn(std::io::Error) -> IoBenchError {
        move |source| IoBenchError::Io { doing, path: self.path.clone(), source }
    }

    fn replay_by_map(
        &self,
        trace: &[Vec<u64>],
        done: &mut dyn FnMut(u64),
    ) -> Result<Vec<UpdateCost>, IoBenchError> {
        let source = MapSource::open(&self.path)?;
        let bytes = source.bytes().unwrap_or_default();
        let byte_of = |page: &u64| usize::try_from(page * PAGE_BYTES).ok().and_then(|at| bytes.get(at));
        let mut costs = Vec::with_capacity(trace.len());
        for pages in trace {
            let mut outside = None;
            costs.push(observed(|| {
                for page in pages {
                    match byte_of(page) {
                        Some(byte) => {
                            black_box(*byte);
                        }
                        None => outside = Some(*page),
                    }
                }
            }));
            if let Some(page) = outside {
                return Err(IoBenchError::OutsideScratch { page });
            }
            done(costs.len() as u64);
        }
        Ok(costs)
    }

    fn replay_by_reads(
        &self,
        trace: &[Vec<u64>],
        done: &mut dyn FnMut(u64),
    ) -> Result<Vec<UpdateCost>, IoBenchError> {
        kernel::expect_random_reads(&self.file).map_err(self.io("cannot do without read-ahead"))?;
        let mut buffer = vec![0; PAGE_BYTES as usize];
        let mut costs = Vec::with_capacity(trace.len());
        for pages in trace {
            let mut result = Ok(());
            costs.push(observed(|| {
                result =
                    pages.iter().try_for_each(|page| read_at(&self.file, &mut buffer, page * PAGE_BYTES));
                black_box(&buffer);
            }));
            result.map_err(self.io("cannot read the scratch file"))?;
            done(costs.len() as u64);
        }
        Ok(costs)
    }
}

/// The way to an open file that has no name. Systems without it have no answer from [`kernel::free_bytes`] either, and no scratch file.
fn path_of(file: &File) -> PathBuf {
    #[cfg(target_os = "linux")]
    return PathBuf::from(format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(file)));
    #[cfg(not(target_os = "linux"))]
    {
        let _ = file;
        PathBuf::new()
    }
}

#[cfg(unix)]
fn read_at(file: &File, buffer: &mut [u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

#[cfg(not(unix))]
fn read_at(mut file: &File, buffer: &mut [u8], offset: u64) -> std::io::Result<()> {
    use std::io::{Read, Seek};
    file.seek(std::io::SeekFrom::Start(offset))?;
    file.read_exact(buffer)
}

/// One number of xorshift64.
fn next_random(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;

    #[test]
    fn a_trace_is_read_and_nothing_stays() {
        let folder = tempfile::tempdir().unwrap();
        let mut written = 0;
        let scratch = ScratchFile::create(folder.path(), 5_000_001, &mut |b| written = b).unwrap();
        assert_eq!(written, 5_001_216);
        assert_eq!(scratch.file.metadata().unwrap().len(), written);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "it has no name");
        let trace = [vec![0, 7, 1220], vec![], vec![3]];
        for access in [Access::Map, Access::Pread] {
            let costs = scratch.replay(&trace, access, &mut |_| {}).unwrap();
            assert_eq!(costs.len(), 3);
            assert!(costs.iter().all(|c| c.ms >= 0.0 && c.faults.is_some()));
            assert!(scratch.replay(&[vec![1221]], access, &mut |_| {}).is_err());
        }
    }

    #[test]
    fn a_full_disk_is_refused_before_a_byte_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let error = ScratchFile::create(folder.path(), 1 << 60, &mut |_| panic!("it wrote")).unwrap_err();
        assert!(matches!(error, IoBenchError::NoRoom { .. }));
        assert!(error.to_string().contains("GB"), "{error}");
        assert!(ScratchFile::create(&folder.path().join("none"), 1, &mut |_| {}).is_err());
    }
}
