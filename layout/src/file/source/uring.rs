//! The terrain file through io_uring: many reads under way at once from one thread. It is for storage with long delays and a high rate.
//!
//! The kernel reads into buffers that the ring owns, and what was read is copied out of them. They live until no read is under way, whatever happens to the caller's buffers. Where
//! the ring fails, reads go on one by one.
//!
//! Cost: a system call a batch, a copy of what is read.

use super::{PreadSource, ReadJob, Source};
use crate::error::LayoutError;
use io_uring::{IoUring, opcode, types};
use std::io::ErrorKind;
use std::mem::ManuallyDrop;
use std::os::fd::AsRawFd;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Reads under way at most.
const DEPTH: usize = 32;
/// Longest read; longer ones are made by themselves.
const BUFFER_BYTES: usize = 64 << 10;

/// A terrain file behind an io_uring.
pub struct UringSource {
    file: PreadSource,
    ring: Mutex<Option<Ring>>,
}

/// A ring and its buffers. They are given up only together, and only when no read is under way.
struct Ring {
    ring: ManuallyDrop<IoUring>,
    buffers: ManuallyDrop<Vec<Vec<u8>>>,
    under_way: usize,
}

impl Drop for Ring {
    fn drop(&mut self) {
        if self.under_way > 0 {
            // The kernel may still write to the buffers: they are left to it.
            return;
        }
        drop(std::mem::take(&mut *self.buffers));
        #[expect(unsafe_code, reason = "a ManuallyDrop is dropped by hand")]
        // SAFETY: dropped once, here, and not used afterwards, for self is being dropped.
        unsafe {
            ManuallyDrop::drop(&mut self.ring);
        }
    }
}

impl std::fmt::Debug for UringSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("UringSource").field("file", &self.file).finish_non_exhaustive()
    }
}

impl UringSource {
    /// Opens the file at `path`.
    ///
    /// # Errors
    /// As [`PreadSource::open`]; [`LayoutError::Io`] where the kernel gives no ring: some forbid it, and then plain reads do.
    pub fn open(path: &Path) -> Result<Self, LayoutError> {
        let file = PreadSource::open(path)?;
        let ring = IoUring::new(DEPTH as u32).map_err(|e| {
            LayoutError::io(path, "cannot get an io_uring from the kernel (read the file without it)", e)
        })?;
        let ring = Ring {
            ring: ManuallyDrop::new(ring),
            buffers: ManuallyDrop::new(vec![vec![0; BUFFER_BYTES]; DEPTH]),
            under_way: 0,
        };
        Ok(Self { file, ring: Mutex::new(Some(ring)) })
    }

    /// Makes up to [`DEPTH`] reads of at most [`BUFFER_BYTES`]. `false` if the ring is of no more use; then some outcomes are unknown.
    fn batch(&self, ring: &mut Ring, jobs: &mut [&mut ReadJob<'_>]) -> bool {
        let descriptor = types::Fd(self.file.file().as_raw_fd());
        for (i, (job, buffer)) in jobs.iter().zip(ring.buffers.iter_mut()).enumerate() {
            let read = opcode::Read::new(descriptor, buffer.as_mut_ptr(), job.buffer.len() as u32)
                .offset(job.offset)
                .build();
            #[expect(unsafe_code, reason = "the kernel writes to a buffer behind the borrow checker's back")]
            // SAFETY: the descriptor is open as long as self.file. The buffer is BUFFER_BYTES long, no shorter than the read, and is neither touched nor freed
            // until its completion has been seen: Ring counts those under way and keeps its buffers for ever if one is left.
            let pushed = unsafe { ring.ring.submission().push(&read.user_data(i as u64)) };
            if pushed.is_err() {
                // There is room for DEPTH.
                return false;
            }
            ring.under_way += 1;
        }
        while ring.under_way > 0 {
            match ring.ring.submit_and_wait(1) {
                Ok(_) => {}
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(_) => return false,
            }
            while let Some(done) = ring.ring.completion().next() {
                ring.under_way -= 1;
                let i = done.user_data() as usize;
                let (Some(job), Some(buffer)) = (jobs.get_mut(i), ring.buffers.get(i)) else { continue };
                if done.result() == job.buffer.len() as i32 {
                    job.buffer.copy_from_slice(&buffer[..job.buffer.len()]);
                    job.outcome = Ok(());
                } else {
                    // Short, interrupted or failed: a plain read finishes it, or says what is wrong.
                    job.outcome = self.file.read_at(job.offset, job.buffer);
                }
            }
        }
        true
    }
}

impl Source for UringSource {
    fn path(&self) -> &Path {
        self.file.path()
    }

    fn byte_count(&self) -> u64 {
        self.file.byte_count()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        self.file.read_at(offset, buffer)
    }

    fn read_many(&self, jobs: &mut [ReadJob<'_>]) {
        let mut held = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut short, long): (Vec<_>, Vec<_>) =
            jobs.iter_mut().partition(|job| job.buffer.len() <= BUFFER_BYTES);
        let one_by_one = |jobs: &mut [&mut ReadJob<'_>]| {
            jobs.iter_mut().for_each(|job| job.outcome = self.file.read_at(job.offset, job.buffer));
        };
        for batch in short.chunks_mut(DEPTH) {
            if !held.as_mut().is_some_and(|ring| self.batch(ring, batch)) {
                *held = None;
                one_by_one(batch);
            }
        }
        drop(held);
        one_by_one(&mut { long });
    }

    fn depth(&self) -> usize {
        DEPTH
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn many_reads_are_the_files_own() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        let bytes: Vec<u8> = (0..1_000_003u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        file.write_all(&bytes).unwrap();
        let source = match UringSource::open(file.path()) {
            Ok(source) => source,
            Err(error) => {
                println!("not tried: {error}");
                return;
            }
        };
        let places: Vec<(u64, usize)> =
            (0..150u64).map(|i| (i * 6_720, 1 + (i as usize * 977) % 9_000)).collect();
        let mut buffers: Vec<Vec<u8>> = places.iter().map(|(_, length)| vec![0; *length]).collect();
        buffers[3] = vec![0; 200_000];
        let mut jobs: Vec<ReadJob<'_>> = places
            .iter()
            .zip(&mut buffers)
            .map(|((offset, _), buffer)| ReadJob::new(*offset, buffer))
            .collect();
        source.read_many(&mut jobs);
        let mut past_the_end = 0;
        for job in &jobs {
            let end = job.offset as usize + job.buffer.len();
            if end <= bytes.len() {
                assert!(job.outcome.is_ok());
                assert!(job.buffer[..] == bytes[job.offset as usize..end]);
            } else {
                past_the_end += 1;
                assert!(job.outcome.as_ref().unwrap_err().to_string().contains("shorter than it was"));
            }
        }
        assert!(past_the_end > 0 && past_the_end < 20);
    }
}
