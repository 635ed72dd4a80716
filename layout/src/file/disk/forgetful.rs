//! A disk for tests that loses what was not synced. Every call goes to the system and is recorded. Afterwards the folder can be laid out as a power cut at any moment may
//! have left it.
//!
//! Only what POSIX promises counts as safe. Bytes are safe when their file was synced after they were written; of other bytes any sectors may have arrived, in any order. A name is safe when its folder
//! was synced after the name was given; of later names the first few may have arrived, in their order. Syncing a file says nothing of its name.

use super::{Disk, SystemDisk};
use crate::mix::Random;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::Result;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Bytes that arrive together or not at all.
const SECTOR_BYTES: usize = 512;

/// When the power goes, and what arrives of what was not synced.
#[derive(Debug, Clone, Copy)]
pub struct PowerCut {
    /// Calls that were made before.
    pub after: usize,
    /// Decides what arrives; 0: nothing, 1: everything.
    pub seed: u64,
}

/// A disk that forgets.
#[derive(Debug)]
pub struct ForgetfulDisk {
    folder: PathBuf,
    log: Mutex<Log>,
}

#[derive(Debug, Default)]
struct Log {
    /// What was in the folder at first.
    before: BTreeMap<PathBuf, (usize, Vec<u8>)>,
    /// Files by device and inode. The handles keep inodes from being used again.
    ids: HashMap<(u64, u64), usize>,
    handles: Vec<File>,
    events: Vec<Event>,
    /// Calls before each promise, and what it was.
    promises: Vec<(usize, usize)>,
}

#[derive(Debug, Clone)]
enum Event {
    Write { file: usize, offset: u64, bytes: Vec<u8> },
    SetLen { file: usize, length: u64 },
    Sync { file: usize },
    Name { file: usize, from: Option<PathBuf>, to: PathBuf },
    SyncFolder { folder: PathBuf },
}

impl ForgetfulDisk {
    /// A disk over the files that are in `folder`, which count as safe.
    ///
    /// # Errors
    /// The system's.
    pub fn watching(folder: &Path) -> Result<Self> {
        let mut log = Log::default();
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            let file = log.id(&File::open(&path)?)?;
            log.before.insert(path.clone(), (file, std::fs::read(&path)?));
        }
        Ok(Self { folder: folder.to_owned(), log: Mutex::new(log) })
    }

    fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Somebody was promised that state `promise` is safe, or a later one.
    pub fn promise(&self, promise: usize) {
        let mut log = self.log();
        let calls = log.events.len();
        log.promises.push((calls, promise));
    }

    /// Calls so far.
    pub fn calls(&self) -> usize {
        self.log().events.len()
    }

    /// Fills the empty folder `into` with what may be found after `cut`; returns the last promise before it, 0 if there was none.
    ///
    /// # Errors
    /// The system's.
    pub fn lay_out(&self, cut: PowerCut, into: &Path) -> Result<usize> {
        let log = self.log();
        let mut files: Vec<Content> = vec![Content::default(); log.handles.len()];
        let mut names = BTreeMap::new();
        for (path, (file, bytes)) in &log.before {
            files[*file].safe.clone_from(bytes);
            names.insert(path.clone(), *file);
        }
        let mut pending_names: Vec<(usize, Option<&PathBuf>, &PathBuf)> = Vec::new();
        for event in &log.events[..cut.after] {
            match event {
                Event::Write { file, .. } | Event::SetLen { file, .. } => files[*file].pending.push(event),
                Event::Sync { file } => files[*file].arrive(|_| true),
                Event::Name { file, from, to } => pending_names.push((*file, from.as_ref(), to)),
                Event::SyncFolder { folder } => {
                    let (safe, rest): (Vec<_>, Vec<_>) =
                        pending_names.into_iter().partition(|(_, _, to)| to.parent() == Some(folder));
                    safe.into_iter().for_each(|name| give(&mut names, name));
                    pending_names = rest;
                }
            }
        }
        let mut random = Random::new(cut.seed);
        let arrived = match cut.seed {
            0 => 0,
            1 => pending_names.len(),
            _ => random.below(pending_names.len() as u64 + 1) as usize,
        };
        pending_names.into_iter().take(arrived).for_each(|name| give(&mut names, name));
        for (path, file) in names {
            let mut content = files[file].clone();
            // Of some images much arrives, of others little.
            let share = random.below(9);
            content.arrive(|_| match cut.seed {
                0 => false,
                1 => true,
                _ => random.below(8) < share,
            });
            std::fs::write(into.join(path.strip_prefix(&self.folder).unwrap_or(&path)), content.safe)?;
        }
        Ok(log
            .promises
            .iter()
            .rev()
            .find(|(calls, _)| *calls <= cut.after)
            .map_or(0, |(_, promise)| *promise))
    }
}

fn give(names: &mut BTreeMap<PathBuf, usize>, (file, from, to): (usize, Option<&PathBuf>, &PathBuf)) {
    if let Some(from) = from {
        names.remove(from);
    }
    names.insert(to.clone(), file);
}

/// Bytes of a file.
#[derive(Debug, Clone, Default)]
struct Content<'e> {
    safe: Vec<u8>,
    pending: Vec<&'e Event>,
}

impl Content<'_> {
    /// Whatever is pending arrives, sector by sector, as far as `arrives` says.
    fn arrive(&mut self, mut arrives: impl FnMut(usize) -> bool) {
        for event in std::mem::take(&mut self.pending) {
            match event {
                Event::SetLen { length, .. } if arrives(0) => self.safe.resize(*length as usize, 0),
                Event::Write { offset, bytes, .. } => {
                    for (i, sector) in bytes.chunks(SECTOR_BYTES).enumerate() {
                        if arrives(i) {
                            let at = *offset as usize + i * SECTOR_BYTES;
                            let end = at + sector.len();
                            self.safe.resize(self.safe.len().max(end), 0);
                            self.safe[at..end].copy_from_slice(sector);
                        }
                    }
                }
                _ => {}
            }
        }
    }
}

impl Log {
    fn id(&mut self, file: &File) -> Result<usize> {
        #[cfg(unix)]
        let key = {
            use std::os::unix::fs::MetadataExt;
            let meta = file.metadata()?;
            (meta.dev(), meta.ino())
        };
        #[cfg(not(unix))]
        let key: (u64, u64) = return Err(std::io::ErrorKind::Unsupported.into());
        if let Some(id) = self.ids.get(&key) {
            return Ok(*id);
        }
        self.handles.push(file.try_clone()?);
        self.ids.insert(key, self.handles.len() - 1);
        Ok(self.handles.len() - 1)
    }
}

impl Disk for ForgetfulDisk {
    fn write_at(&self, file: &File, bytes: &[u8], offset: u64) -> Result<()> {
        let mut log = self.log();
        SystemDisk.write_at(file, bytes, offset)?;
        let file = log.id(file)?;
        log.events.push(Event::Write { file, offset, bytes: bytes.to_vec() });
        Ok(())
    }

    fn read_at(&self, file: &File, bytes: &mut [u8], offset: u64) -> Result<()> {
        SystemDisk.read_at(file, bytes, offset)
    }

    fn set_len(&self, file: &File, length: u64) -> Result<()> {
        let mut log = self.log();
        SystemDisk.set_len(file, length)?;
        let file = log.id(file)?;
        log.events.push(Event::SetLen { file, length });
        Ok(())
    }

    fn sync(&self, file: &File) -> Result<()> {
        let mut log = self.log();
        let file = log.id(file)?;
        log.events.push(Event::Sync { file });
        Ok(())
    }

    fn link(&self, file: &File, to: &Path) -> Result<()> {
        let mut log = self.log();
        SystemDisk.link(file, to)?;
        let file = log.id(file)?;
        log.events.push(Event::Name { file, from: None, to: to.to_owned() });
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        let mut log = self.log();
        let file = log.id(&File::open(from)?)?;
        SystemDisk.rename(from, to)?;
        log.events.push(Event::Name { file, from: Some(from.to_owned()), to: to.to_owned() });
        Ok(())
    }

    fn sync_folder(&self, folder: &Path) -> Result<()> {
        self.log().events.push(Event::SyncFolder { folder: folder.to_owned() });
        Ok(())
    }
}
