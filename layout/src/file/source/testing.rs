//! Sources for tests: one counts what is read, one fails the n-th read, one does to many reads what bad storage does.

use super::Source;
use crate::error::LayoutError;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

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

/// What bad storage does to a read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// It fails.
    Fail,
    /// It says that it read all and has read the first half.
    Short,
    /// One bit is another.
    Damage,
    /// It takes long.
    Slow(Duration),
}

/// How often a [`HostileSource`] misbehaves, to be changed while it is in use.
#[derive(Debug, Default)]
pub struct Hostility {
    /// One read in so many; 0 for none.
    pub one_in: AtomicU64,
    reads: AtomicU64,
    injected: AtomicU64,
}

impl Hostility {
    /// Reads that were tampered with.
    pub fn injected(&self) -> u64 {
        self.injected.load(Ordering::Relaxed)
    }

    /// Whether the next read is to be tampered with.
    fn strikes(&self) -> bool {
        let one_in = self.one_in.load(Ordering::Relaxed);
        let strikes = one_in > 0 && self.reads.fetch_add(1, Ordering::Relaxed).is_multiple_of(one_in);
        self.injected.fetch_add(u64::from(strikes), Ordering::Relaxed);
        strikes
    }
}

/// Does to many reads what bad storage does.
#[derive(Debug)]
pub struct HostileSource<S> {
    inner: S,
    fault: Fault,
    hostility: Arc<Hostility>,
}

impl<S: Source> HostileSource<S> {
    /// Tampers with reads of `inner` as often as `hostility` says.
    pub fn new(inner: S, fault: Fault, hostility: Arc<Hostility>) -> Self {
        Self { inner, fault, hostility }
    }
}

impl<S: Source> Source for HostileSource<S> {
    fn path(&self) -> &Path {
        self.inner.path()
    }

    fn byte_count(&self) -> u64 {
        self.inner.byte_count()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        if !self.hostility.strikes() {
            return self.inner.read_at(offset, buffer);
        }
        match self.fault {
            Fault::Fail => {
                let error = std::io::Error::other("injected failure");
                return Err(LayoutError::io(self.path(), "cannot read the file", error));
            }
            Fault::Slow(time) => std::thread::sleep(time),
            Fault::Short | Fault::Damage => {}
        }
        self.inner.read_at(offset, buffer)?;
        let middle = buffer.len() / 2;
        match self.fault {
            Fault::Short => buffer[middle..].fill(0),
            Fault::Damage => buffer[middle] ^= 0x10,
            Fault::Fail | Fault::Slow(_) => {}
        }
        Ok(())
    }
}
