//! A terrain file held in memory: tests, embedded assets, small terrains.

use super::Source;
use crate::error::LayoutError;
use std::path::{Path, PathBuf};

/// The bytes of a terrain file in memory.
#[derive(Debug, Clone)]
pub struct MemorySource {
    name: PathBuf,
    bytes: Vec<u8>,
}

impl MemorySource {
    /// A source over `bytes`, called `name` in messages.
    pub fn new(name: &str, bytes: Vec<u8>) -> Self {
        Self { name: name.into(), bytes }
    }
}

impl Source for MemorySource {
    fn path(&self) -> &Path {
        &self.name
    }

    fn byte_count(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        let bytes = usize::try_from(offset)
            .ok()
            .and_then(|start| self.bytes.get(start..start.checked_add(buffer.len())?))
            .ok_or_else(|| {
                LayoutError::damaged(&self.name, format!("byte {offset}"), "the data ends before it")
            })?;
        buffer.copy_from_slice(bytes);
        Ok(())
    }

    fn bytes(&self) -> Option<&[u8]> {
        Some(&self.bytes)
    }
}
