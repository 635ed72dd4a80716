//! Little-endian fields at fixed offsets of a page: the one place that turns header and directory bytes into numbers.
//!
//! Offsets are constants of FORMAT.md inside one page; an offset outside it is a programming error and panics.

use crate::error::LayoutError;

/// Bytes a page.
pub const PAGE_BYTES: usize = 4096;

/// One page of bytes.
pub type Page = [u8; PAGE_BYTES];

macro_rules! accessors {
    ($($get:ident $put:ident $type:ty),*) => { $(
        /// The number at `offset`.
        #[inline]
        pub(crate) fn $get(bytes: &[u8], offset: usize) -> $type {
            let mut raw = [0; size_of::<$type>()];
            raw.copy_from_slice(&bytes[offset..offset + size_of::<$type>()]);
            <$type>::from_le_bytes(raw)
        }

        /// Stores a number at `offset`.
        #[inline]
        pub(crate) fn $put(bytes: &mut [u8], offset: usize, value: $type) {
            bytes[offset..offset + size_of::<$type>()].copy_from_slice(&value.to_le_bytes());
        }
    )* };
}

accessors!(get_u16 put_u16 u16, get_u32 put_u32 u32, get_u64 put_u64 u64, get_f64 put_f64 f64);

/// The text at `offset`: a 16-bit length and UTF-8 of at most 254 bytes. `None` if it is neither.
pub(crate) fn get_text(bytes: &[u8], offset: usize) -> Option<String> {
    let length = usize::from(get_u16(bytes, offset));
    if length > 254 {
        return None;
    }
    std::str::from_utf8(&bytes[offset + 2..offset + 2 + length]).ok().map(str::to_owned)
}

/// Stores a text at `offset`, cut to 254 bytes at a character's border.
pub(crate) fn put_text(bytes: &mut [u8], offset: usize, text: &str) {
    let mut length = text.len().min(254);
    while !text.is_char_boundary(length) {
        length -= 1;
    }
    put_u16(bytes, offset, length as u16);
    bytes[offset + 2..offset + 2 + length].copy_from_slice(&text.as_bytes()[..length]);
}

/// CRC-32 as in PNG.
pub(crate) fn checksum(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

/// A count of pages or bytes as an index of memory on this machine.
pub(crate) fn to_usize(value: u64) -> Result<usize, LayoutError> {
    usize::try_from(value)
        .map_err(|_| LayoutError::Usage(format!("{value} bytes do not fit this machine's address space")))
}
