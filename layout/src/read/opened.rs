//! A file as what it reads as: a terrain file by itself, a packed one as the terrain file that it holds. Whoever appends to files, or lays one over another, need not know which it is.

use crate::error::LayoutError;
use crate::file::source::{MapSource, PreadSource, Source};
use crate::packed::source::PackedSource;
use crate::read::opening::starts_packed;

/// An opened file.
pub(crate) enum Opened {
    Plain(PreadSource),
    Packed(Box<PackedSource>),
}

impl Opened {
    pub(crate) fn of(file: PreadSource) -> Result<Self, LayoutError> {
        if starts_packed(&file)? {
            return Ok(Self::Packed(Box::new(PackedSource::open(Box::new(file))?)));
        }
        Ok(Self::Plain(file))
    }

    /// To be looked at, and measured again.
    pub(crate) fn source_mut(&mut self) -> &mut dyn Source {
        match self {
            Self::Plain(file) => file,
            Self::Packed(packed) => &mut **packed,
        }
    }

    /// To be read.
    pub(crate) fn into_source(self) -> Box<dyn Source> {
        match self {
            Self::Plain(file) => Box::new(file),
            Self::Packed(packed) => packed,
        }
    }

    /// With its bytes in memory: mapped, or unpacked when they are first asked for.
    pub(crate) fn into_lender(self) -> Result<Box<dyn Source>, LayoutError> {
        Ok(match self {
            Self::Plain(file) => Box::new(MapSource::map(file)?),
            Self::Packed(packed) => Box::new(packed.lending_whole()),
        })
    }
}
