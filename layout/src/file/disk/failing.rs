//! A disk for tests: passes on calls to the system and counts them, until the n-th fails in the way asked for.

use super::{Disk, SystemDisk};
use std::fs::File;
use std::io::{Error, ErrorKind, Result};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// How a [`FailingDisk`] fails. Of a write that fails some quarters of the bytes may still arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// One call fails, later ones succeed: a bad sector.
    Once,
    /// That call and all later ones that need room fail for want of it.
    Full {
        /// 0 to 4.
        quarters: usize,
    },
    /// Nothing succeeds any more: as if the process had been killed.
    Killed {
        /// 0 to 4.
        quarters: usize,
    },
}

/// Fails the `n`-th call, counted from 0, and perhaps later ones.
#[derive(Debug)]
pub struct FailingDisk {
    n: u64,
    failure: Failure,
    calls: AtomicU64,
    failed: AtomicU64,
}

impl FailingDisk {
    /// A disk that fails from the `n`-th call.
    pub fn new(n: u64, failure: Failure) -> Self {
        Self { n, failure, calls: AtomicU64::new(0), failed: AtomicU64::new(0) }
    }

    /// Calls so far, those that failed among them.
    pub fn calls(&self) -> u64 {
        self.calls.load(Ordering::Relaxed)
    }

    /// Calls that failed so far.
    pub fn failed(&self) -> u64 {
        self.failed.load(Ordering::Relaxed)
    }

    /// The error of the call that is being made, if it is to fail.
    fn error(&self, needs_room: bool) -> Option<Error> {
        let call = self.calls.fetch_add(1, Ordering::Relaxed);
        let fails = match self.failure {
            Failure::Once => call == self.n,
            Failure::Full { .. } => call >= self.n && needs_room,
            Failure::Killed { .. } => call >= self.n,
        };
        fails.then(|| {
            self.failed.fetch_add(1, Ordering::Relaxed);
            match self.failure {
                Failure::Once | Failure::Killed { .. } => Error::other("injected failure"),
                Failure::Full { .. } => ErrorKind::StorageFull.into(),
            }
        })
    }
}

impl Disk for FailingDisk {
    fn write_at(&self, file: &File, bytes: &[u8], offset: u64) -> Result<()> {
        let Some(error) = self.error(true) else { return SystemDisk.write_at(file, bytes, offset) };
        if let Failure::Full { quarters } | Failure::Killed { quarters } = self.failure
            && self.failed() == 1
        {
            SystemDisk.write_at(file, &bytes[..bytes.len() * quarters / 4], offset)?;
        }
        Err(error)
    }

    fn read_at(&self, file: &File, bytes: &mut [u8], offset: u64) -> Result<()> {
        self.error(false).map_or_else(|| SystemDisk.read_at(file, bytes, offset), Err)
    }

    fn set_len(&self, file: &File, length: u64) -> Result<()> {
        let grows = file.metadata()?.len() < length;
        self.error(grows).map_or_else(|| SystemDisk.set_len(file, length), Err)
    }

    fn sync(&self, file: &File) -> Result<()> {
        self.error(true).map_or_else(|| SystemDisk.sync(file), Err)
    }

    fn link(&self, file: &File, to: &Path) -> Result<()> {
        self.error(true).map_or_else(|| SystemDisk.link(file, to), Err)
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        self.error(true).map_or_else(|| SystemDisk.rename(from, to), Err)
    }

    fn sync_folder(&self, folder: &Path) -> Result<()> {
        self.error(true).map_or_else(|| SystemDisk.sync_folder(folder), Err)
    }
}
