//! The border between formats and everything else: what a file says ([`Declared`]) and its samples in the order of the file ([`Reader`]).
//!
//! A reader knows one format and nothing else. It passes on what is written in the file, as it is written there: rows in their order, raw numbers,
//! the reference system as text or code, units, scale, offset and "no data", each with the place where it was found. Everything else is done once for all formats, outside of readers: turning rows north-up,
//! finding out what a system or a unit is, comparing voids, scaling, and asking the person who typed the command.

mod declared;
mod picture;

pub(crate) use declared::{Corrects, CrsSaid, Declared, HorizontalSize, Said, ValueSaid, VerticalUnit};
pub(crate) use picture::{NumberRows, Numbers, Orientation, Picture, bits_of, upper_eight};

use terrasoar_layout::dem::{SampleSink, Warning};
use terrasoar_layout::error::LayoutError;

/// A data set of one format.
pub(crate) trait Reader: Send + Sync {
    /// What the file says.
    fn declared(&self) -> &Declared;

    /// A mask of the same columns and rows, of which 0 means that the sample is void.
    fn mask(&self) -> Option<&dyn Reader> {
        None
    }

    /// Memory in bytes that [`stream`](Reader::stream) takes beyond a megabyte or two a thread.
    fn memory_bytes(&self) -> u64 {
        0
    }

    /// What was seen while streaming that may make the ground wrong: parts that could not be read.
    fn warnings(&self) -> Vec<Warning> {
        Vec::new()
    }

    /// Pushes every sample exactly once into `sink`, as raw numbers, in windows counted in the rows and columns *of the file*: row 0 is the first row of the
    /// file, whatever side of the ground it lies on. NaN stands for what is void by the format itself: masked, left out, NaN. Values that
    /// [`ValueSaid::nodata`] names are pushed as they are. Decodes on the current rayon pool where the format allows it, holds a few windows at a time.
    ///
    /// # Errors
    /// Damage in the data, naming the file and the place; or the sink's own error.
    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError>;
}
