//! Which of a file's images is the terrain, and which is its mask.
//!
//! Directories follow one another in a chain; each may point at more of them (SubIFDs), which nearly always are smaller copies of its image. The terrain is the first image
//! of the chain that is neither a smaller copy nor a mask; where the chain has none, as in files that begin with a thumbnail, the first among those pointed at. A chain that
//! comes back to where it was ends there. Cost: one read a directory, until the image is found.

use super::tags::{self, Directory, MAX_TAGS, TiffFile};
use std::collections::HashSet;
use terrasoar_layout::error::LayoutError;

/// Directories looked at, at most: a full pyramid has a few dozen.
const MAX_DIRECTORIES: usize = 1024;
/// Directories that one points at, at most.
const MAX_BRANCHES: u64 = 64;

/// A smaller copy of another image, in the kind of an image.
const REDUCED: u64 = 1;
/// A mask of another image.
const MASK: u64 = 4;

impl TiffFile {
    /// The directory of the terrain.
    pub(super) fn first_full_image(&mut self) -> Result<Directory, LayoutError> {
        let found = self.find(&mut |_, _, kind| Ok(kind & (REDUCED | MASK) == 0))?;
        found.ok_or_else(|| {
            self.damaged("the file has no full-resolution image; write it again with gdal_translate")
        })
    }

    /// The directory of the mask of an image of `size`, if there is one: 0 where the image has nothing to say, of one bit or one byte a sample.
    pub(super) fn mask_of(&mut self, [width, height]: [u32; 2]) -> Result<Option<Directory>, LayoutError> {
        self.find(&mut |file, directory, kind| {
            let size = [tags::IMAGE_WIDTH, tags::IMAGE_LENGTH].map(|tag| file.number(directory, tag));
            let [wide, high] = size;
            let is_alike = (wide?, high?) == (Some(u64::from(width)), Some(u64::from(height)));
            Ok(kind & (REDUCED | MASK) == MASK && is_alike)
        })
    }

    /// The first directory that is wanted, by its kind: those of the chain before those they point at.
    fn find(
        &mut self,
        is_wanted: &mut dyn FnMut(&mut Self, &Directory, u64) -> Result<bool, LayoutError>,
    ) -> Result<Option<Directory>, LayoutError> {
        let mut at = self.first_directory()?;
        let mut seen = HashSet::new();
        let mut branches = Vec::new();
        let mut tags_left = MAX_TAGS;
        while at != 0 && seen.len() < MAX_DIRECTORIES && seen.insert(at) {
            let (directory, next) = self.directory(at, &mut tags_left)?;
            let kind = self.kind(&directory)?;
            if is_wanted(self, &directory, kind)? {
                return Ok(Some(directory));
            }
            branches.extend(self.numbers(&directory, tags::SUB_IFDS, MAX_BRANCHES)?.unwrap_or_default());
            at = next;
        }
        for at in branches {
            if at == 0 || seen.len() >= MAX_DIRECTORIES || !seen.insert(at) {
                continue;
            }
            let (directory, _) = self.directory(at, &mut tags_left)?;
            let kind = self.kind(&directory)?;
            if is_wanted(self, &directory, kind)? {
                return Ok(Some(directory));
            }
        }
        Ok(None)
    }

    /// Bits that say what an image is; files before 1992 have a number instead, of which 2 is a smaller copy.
    fn kind(&mut self, directory: &Directory) -> Result<u64, LayoutError> {
        if let Some(kind) = self.number(directory, tags::NEW_SUBFILE_TYPE)? {
            return Ok(kind);
        }
        let old = self.number(directory, tags::SUBFILE_TYPE)?;
        Ok(if old == Some(2) { REDUCED } else { 0 })
    }
}
