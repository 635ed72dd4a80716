//! What images say about themselves, and how their texels arrive: rows from north to south, as red, green, blue, alpha.
//!
//! Formats are stored in that order, or in tiles that are. So a reader holds a few rows, or one row of tiles. The one
//! exception is JPEG, which is held as a whole; its reader says so.

use crate::dem::Georeference;
use crate::error::LayoutError;
use std::path::Path;

/// What an image says about itself.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageInfo {
    /// Texels from west to east and from north to south.
    pub texels: [u32; 2],
    /// Where it lies; its map goes from the centres of texels.
    pub georeference: Georeference,
    /// Name of the format in words.
    pub format: String,
    /// What is lost in reading it, in words.
    pub notes: Vec<String>,
    /// Memory that reading takes, in bytes.
    pub memory_bytes: u64,
}

/// An image that can be read row by row.
pub trait ImageSource: Sync {
    /// Name for messages.
    fn path(&self) -> &Path;

    /// What it says about itself.
    fn info(&self) -> &ImageInfo;

    /// Begins to read it from the north.
    ///
    /// # Errors
    /// I/O, or damage before the first row.
    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError>;
}

/// Rows of an image, from north to south.
pub trait RowReader: Send {
    /// Fills `rgba` with the next rows, as many as fit: 4 bytes a texel. May work on the current rayon pool.
    ///
    /// # Errors
    /// Damage in the data, naming the place; I/O.
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError>;
}

/// An image held in memory: tests, pictures made elsewhere in a program.
#[derive(Debug, Clone)]
pub struct MemoryImage {
    info: ImageInfo,
    rgba: Vec<u8>,
}

impl MemoryImage {
    /// An image of `texels` (wide, high) whose texel at column x east and row y south of the north-west corner is `texel(x, y)`.
    pub fn from_fn(texels: [u32; 2], mut texel: impl FnMut(u32, u32) -> [u8; 4]) -> Self {
        let places = (0..texels[1]).flat_map(|y| (0..texels[0]).map(move |x| (x, y)));
        let info = ImageInfo {
            texels,
            georeference: Georeference::default(),
            format: "memory".into(),
            notes: Vec::new(),
            memory_bytes: 0,
        };
        Self { info, rgba: places.flat_map(|(x, y)| texel(x, y)).collect() }
    }

    /// What the image says about itself, to be changed. Its size must stay as it is.
    pub fn info_mut(&mut self) -> &mut ImageInfo {
        &mut self.info
    }
}

impl ImageSource for MemoryImage {
    fn path(&self) -> &Path {
        Path::new("memory")
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        Ok(Box::new(MemoryRows(&self.rgba)))
    }
}

struct MemoryRows<'i>(&'i [u8]);

impl RowReader for MemoryRows<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let (rows, rest) = self.0.split_at(rgba.len().min(self.0.len()));
        rgba[..rows.len()].copy_from_slice(rows);
        self.0 = rest;
        Ok(())
    }
}
