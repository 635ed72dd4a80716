//! Sources for tests: one counts what is read, one fails the n-th read.

use super::Source;
use crate::error::LayoutError;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts reads and bytes on their way to another source.
#[derive(Debug)]
pub struct CountingSource<S> {
    inner: S,
    reads: AtomicU64,
    bytes: AtomicU64,
}

impl<S: Source> CountingSource<S> {
    /// Counts what is read from `inner`.
    pub fn new(inner: S) -> Self {
        Self { inner, reads: AtomicU64::new(0), bytes: AtomicU64::new(0) }
    }

    /// Reads and bytes read so far.
    pub fn counts(&self) -> (u64, u64) {
        (self.reads.load(Ordering::Relaxed), self.bytes.load(Ordering::Relaxed))
    }
}

impl<S: Source> Source for CountingSource<S> {
    fn path(&self) -> &Path {
        self.inner.path()
    }

    fn byte_count(&self) -> u64 {
        self.inner.byte_count()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        self.reads.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(buffer.len() as u64, Ordering::Relaxed);
        self.inner.read_at(offset, buffer)
    }
}

/// Fails one read, the `n`-th from 0, and passes on all others.
#[derive(Debug)]
pub struct FailingSource<S> {
    inner: S,
    countdown: AtomicU64,
}

impl<S: Source> FailingSource<S> {
    /// Fails the `n`-th read of `inner`.
    pub fn new(inner: S, n: u64) -> Self {
        Self { inner, countdown: AtomicU64::new(n) }
    }
}

impl<S: Source> Source for FailingSource<S> {
    fn path(&self) -> &Path {
        self.inner.path()
    }

    fn byte_count(&self) -> u64 {
        self.inner.byte_count()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        if self.countdown.fetch_sub(1, Ordering::Relaxed) == 0 {
            let error = std::io::Error::other("injected failure");
            return Err(LayoutError::io(self.path(), "cannot read the file", error));
        }
        self.inner.read_at(offset, buffer)
    }
}
