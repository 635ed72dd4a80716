//! A mark behind the end of a file that grows: how far the commit came that was written last (FORMAT.md, section 8.5).
//!
//! A header that is damaged can no longer say that it was there. The mark can: it is begun before the header is written, and says that the commit is saved once the header is on the disk. It is the file's last
//! bytes, behind all that counts, and the next commit writes over it. Files without one read as ever.

use super::bytes::{checksum, get_u32};
#[cfg(feature = "files")]
use super::header::Header;
#[cfg(feature = "files")]
use super::source::Source;
#[cfg(feature = "files")]
use crate::error::LayoutError;

/// Bytes of a mark.
pub(crate) const MARK_BYTES: usize = 64;
const MAGIC: [u8; 8] = *b"IQTSAVED";
const GENERATION: usize = 0x08;
const STAGE: usize = 0x0c;
const CHECKSUM: usize = 0x3c;

/// How far a commit came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Mark {
    /// Generation of its header.
    pub(crate) generation: u32,
    /// Whether that header is on the disk.
    pub(crate) is_saved: bool,
}

impl Mark {
    #[cfg(any(test, feature = "files"))]
    pub(crate) fn to_bytes(self) -> [u8; MARK_BYTES] {
        use super::bytes::put_u32;
        let mut bytes = [0; MARK_BYTES];
        bytes[..8].copy_from_slice(&MAGIC);
        put_u32(&mut bytes, GENERATION, self.generation);
        put_u32(&mut bytes, STAGE, 1 + u32::from(self.is_saved));
        let sum = checksum(&bytes[..CHECKSUM]);
        put_u32(&mut bytes, CHECKSUM, sum);
        bytes
    }

    /// The mark that a file ends with, if it says of this header that it is saved: what a copy in another form is to end with, too.
    ///
    /// # Errors
    /// I/O.
    #[cfg(feature = "files")]
    pub(crate) fn to_carry(
        source: &dyn Source,
        header: &Header,
    ) -> Result<Option<[u8; MARK_BYTES]>, LayoutError> {
        let mut end = [0; MARK_BYTES];
        let saved = Self { generation: header.generation, is_saved: true };
        let is_there = source.read_end(&mut end)? && Self::parse(&end) == Some(saved);
        Ok(is_there.then_some(end))
    }

    /// `None` if these are no mark.
    pub(crate) fn parse(bytes: &[u8; MARK_BYTES]) -> Option<Self> {
        let is_mark = bytes.starts_with(&MAGIC) && get_u32(bytes, CHECKSUM) == checksum(&bytes[..CHECKSUM]);
        let is_saved = match get_u32(bytes, STAGE) {
            1 => false,
            2 => true,
            _ => return None,
        };
        is_mark.then(|| Self { generation: get_u32(bytes, GENERATION), is_saved })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_read_back_and_nothing_else_is_one() {
        for (generation, is_saved) in [(2, false), (2, true), (u32::MAX, true)] {
            let mark = Mark { generation, is_saved };
            let bytes = mark.to_bytes();
            assert_eq!(Mark::parse(&bytes), Some(mark));
            for bit in 0..8 * MARK_BYTES {
                let mut other = bytes;
                other[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(Mark::parse(&other), None, "bit {bit}");
            }
        }
        assert_eq!(Mark::parse(&[0; MARK_BYTES]), None);
    }
}
