//! The seam between formats of pictures and everything else: what a file says of its place, its mask and how its camera was held, and its texels.

use super::{CrsSaid, Reader};
use image::metadata::Orientation;
use terrasoar_layout::imagery::ImageSource;

/// A picture of one format, as its file has it.
pub(crate) trait Picture: ImageSource {
    /// The map from centres of texels to coordinates, and their system, as the file says them.
    fn said(&self) -> (Option<[f64; 6]>, CrsSaid) {
        (None, CrsSaid::default())
    }

    /// A mask in the file, of which 0 means that there is no picture.
    fn mask(&self) -> Option<&dyn Reader> {
        None
    }

    /// How the camera was held.
    fn orientation(&self) -> Orientation {
        Orientation::NoTransforms
    }

    /// Whether its channels are bytes in the file.
    fn has_bytes(&self) -> bool;
}
