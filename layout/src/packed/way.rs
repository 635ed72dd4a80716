//! The way through tiles, of whichever kind of records a terrain has.

use super::coder::Coder;
use super::exact::{self, Form};
use super::rules::Rules;
use super::shape::TileShape;
use super::tile::{INERT, TileRecords};
use super::walk;
use super::wide::Width;
use crate::file::header::Header;

/// What is the same for all tiles of a file.
#[derive(Debug)]
pub(crate) enum Way {
    Compact(Rules),
    Exact(exact::Rules),
}

/// What a thread keeps from tile to tile.
#[derive(Debug)]
pub(crate) enum Scratch {
    Compact(Box<walk::Scratch>),
    Exact(Box<exact::Scratch>),
}

impl Way {
    pub(crate) fn of(header: &Header) -> Self {
        match Form::of(header.record_kind) {
            None => Self::Compact(Rules::new(&header.grid, &header.scale)),
            Some(form) => Self::Exact(exact::Rules::new(form, &header.grid, &header.scale)),
        }
    }

    pub(crate) fn scratch(&self) -> Scratch {
        match self {
            Self::Compact(_) => Scratch::Compact(Box::default()),
            Self::Exact(_) => Scratch::Exact(Box::default()),
        }
    }

    /// Words of 4 bytes a record.
    pub(crate) fn words(&self) -> usize {
        match self {
            Self::Compact(_) => 1,
            Self::Exact(rules) => rules.form().words(),
        }
    }

    /// The words of an inert record.
    pub(crate) fn inert(&self) -> &'static [u32] {
        match self {
            Self::Compact(_) => &[INERT],
            Self::Exact(rules) => rules.form().inert_words(),
        }
    }

    /// Takes a tile's values through `segments`: writing gives the records, reading makes them. Whether reading used all of the segments is for the decoders to say.
    pub(crate) fn walk<C: Coder>(
        &self,
        width: Width,
        shape: &TileShape,
        scratch: &mut Scratch,
        mut segments: &mut [C],
        truth: Option<&TileRecords>,
    ) -> TileRecords {
        match (self, scratch) {
            (Self::Compact(rules), Scratch::Compact(scratch)) => {
                walk::walk(width, shape, rules, scratch, &mut segments, truth)
            }
            (Self::Exact(rules), Scratch::Exact(scratch)) => {
                exact::walk(shape, rules, scratch, &mut segments, truth)
            }
            // One of another file.
            (_, scratch) => {
                *scratch = self.scratch();
                self.walk(width, shape, scratch, segments, truth)
            }
        }
    }
}
