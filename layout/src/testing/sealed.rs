//! A file under trial: mutated by a recipe, sealed again, and opened in memory or written to a folder.

use super::image::Image;
use super::mutation::Mutation;
use super::parts::Parts;
use super::seal::{Counts, seal};
use crate::error::LayoutError;
use crate::file::source::MemorySource;
use crate::read::terrain::Terrain;
use std::path::{Path, PathBuf};

/// Mutations of a recipe that are carried out.
const MOST_MUTATIONS: usize = 64;

/// A terrain file in memory, and perhaps an overlay over it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sealed {
    /// The bytes of a terrain file (.iqt).
    pub terrain: Vec<u8>,
    /// The bytes of an overlay over it (.iqo).
    pub overlay: Option<Vec<u8>>,
}

impl Sealed {
    /// Mutates the overlay, or the terrain file if there is none, and seals it. A recipe is a byte, then eight bytes a [`Mutation`]: bit 0 of the first says whether
    /// [`Counts`] are settled.
    pub fn mutate(&mut self, recipe: &[u8]) {
        let Some((first, rest)) = recipe.split_first() else { return };
        let counts = if first & 1 == 0 { Counts::Settle } else { Counts::Keep };
        let mut image = match &mut self.overlay {
            Some(overlay) => Image::overlay(&self.terrain, overlay),
            None => Image::terrain(&mut self.terrain),
        };
        let parts = Parts::of(&image).list(&image);
        for bytes in rest.as_chunks::<{ Mutation::BYTES }>().0.iter().take(MOST_MUTATIONS) {
            Mutation::of(*bytes).apply(&mut image, &parts);
        }
        seal(&mut image, counts);
    }

    /// Opens the terrain file, without its overlay, in memory.
    ///
    /// # Errors
    /// As [`Terrain::open`].
    pub fn open(&self) -> Result<Terrain, LayoutError> {
        Terrain::from_source(Box::new(MemorySource::new("sealed.iqt", self.terrain.clone())))
    }

    /// Writes `t.iqt`, and `o.iqo` if there is an overlay, into `folder`.
    ///
    /// # Errors
    /// The system's.
    pub fn write(&self, folder: &Path) -> std::io::Result<(PathBuf, Option<PathBuf>)> {
        let (terrain, overlay) = (folder.join("t.iqt"), folder.join("o.iqo"));
        std::fs::write(&terrain, &self.terrain)?;
        let Some(bytes) = &self.overlay else { return Ok((terrain, None)) };
        std::fs::write(&overlay, bytes)?;
        Ok((terrain, Some(overlay)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::seeds;
    use crate::verify::verify;

    /// What changes nothing leaves a file as it was, byte for byte: the sealer finds every checksum that a writer writes.
    #[test]
    fn sealing_a_sound_file_changes_nothing() {
        for seed in seeds() {
            for first in [0, 1] {
                let mut sealed = seed.files.clone();
                sealed.mutate(&[first]);
                assert!(sealed == seed.files, "{}", seed.name);
            }
        }
    }

    /// Every record page may change: the file still opens, and no checksum is found wrong.
    #[test]
    fn what_was_changed_is_sealed() {
        for seed in seeds().into_iter().filter(|seed| seed.files.overlay.is_none()) {
            let mut sealed = seed.files.clone();
            let fill = [11, 0, 0, 0, 0, 2, 0, 0];
            sealed.mutate(&[&[0][..], &fill[..]].concat());
            assert!(sealed != seed.files);
            let report = verify(&sealed.open().unwrap(), &|_| {}).unwrap();
            assert!(!report.is_sound());
            assert!(report.problems.iter().all(|p| !p.problem.contains("checksum")), "{:?}", report.problems);
        }
    }
}
