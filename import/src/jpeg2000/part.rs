//! A box (ISO/IEC 15444-1, annex I.4): a part of a file with its kind and length. Cost: a read of 16 bytes.

use super::{Source, Trouble, damaged};

/// A box: its kind and where its content lies.
pub(super) struct Found {
    pub(super) kind: [u8; 4],
    pub(super) at: u64,
    pub(super) end: u64,
}

/// The box at `at`, of those that end at `end`.
pub(super) fn next(source: Source<'_>, at: u64, end: u64) -> Result<Found, Trouble> {
    let head: [u8; 8] = source.array(at)?;
    let kind = [head[4], head[5], head[6], head[7]];
    let length = u64::from(u32::from_be_bytes([head[0], head[1], head[2], head[3]]));
    let (content, length) = match length {
        0 => (at + 8, end - at),
        1 => (at + 16, u64::from_be_bytes(source.array(at + 8)?)),
        length => (at + 8, length),
    };
    let last = at.checked_add(length).filter(|last| content <= *last);
    let last = last.ok_or_else(|| damaged("a box of it has no end"))?;
    Ok(Found { kind, at: content, end: last.min(end) })
}
