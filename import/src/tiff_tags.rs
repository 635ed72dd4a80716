//! Tags of a TIFF being written, as the bytes of a directory: classic or BigTIFF, little-endian.
//!
//! A directory is its entries in the order of their numbers, the place of the next directory, and the values that do not fit into an entry, each from a multiple of 8 bytes on. Its length
//! depends on neither its place nor the numbers in it, so that places may be filled in last.

/// A text, with the zero that ends it.
const ASCII: u16 = 2;
/// 16 bits.
pub(crate) const SHORT: u16 = 3;
/// 32 bits.
pub(crate) const LONG: u16 = 4;
const DOUBLE: u16 = 12;
/// 64 bits, in BigTIFF alone.
pub(crate) const LONG8: u16 = 16;

/// Largest classic TIFF, with room for the header.
pub(crate) const CLASSIC_BYTES: u64 = (1 << 32) - (1 << 24);

#[derive(Debug, Clone)]
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    values: Vec<u8>,
}

/// Tags of one directory.
#[derive(Debug, Clone)]
pub(crate) struct Tags {
    big: bool,
    /// By their numbers.
    entries: Vec<Entry>,
}

impl Tags {
    /// No tags yet, of a BigTIFF or not.
    pub(crate) fn new(big: bool) -> Self {
        Self { big, entries: Vec::new() }
    }

    pub(crate) fn is_big(&self) -> bool {
        self.big
    }

    /// Sets a tag, in place of what it was.
    fn put(&mut self, entry: Entry) {
        match self.entries.binary_search_by_key(&entry.tag, |entry| entry.tag) {
            Ok(at) => self.entries[at] = entry,
            Err(at) => self.entries.insert(at, entry),
        }
    }

    pub(crate) fn numbers(&mut self, tag: u16, kind: u16, numbers: &[u64]) {
        let bytes = match kind {
            SHORT => 2,
            LONG => 4,
            _ => 8,
        };
        let values = numbers.iter().flat_map(|number| number.to_le_bytes().into_iter().take(bytes)).collect();
        self.put(Entry { tag, kind, count: numbers.len() as u64, values });
    }

    pub(crate) fn reals(&mut self, tag: u16, reals: &[f64]) {
        let values = reals.iter().flat_map(|real| real.to_le_bytes()).collect();
        self.put(Entry { tag, kind: DOUBLE, count: reals.len() as u64, values });
    }

    pub(crate) fn text(&mut self, tag: u16, text: &str) {
        let values: Vec<u8> = text.bytes().chain([0]).collect();
        self.put(Entry { tag, kind: ASCII, count: values.len() as u64, values });
    }

    /// Bytes of the header, of the count of entries, of an entry, and of a place in the file.
    fn sizes(&self) -> (usize, usize, usize, usize) {
        if self.big { (16, 8, 20, 8) } else { (8, 2, 12, 4) }
    }

    /// The header of a file whose first directory lies at `first`.
    pub(crate) fn header(&self, first: u64) -> Vec<u8> {
        let mut bytes: Vec<u8> = if self.big { b"II+\0\x08\0\0\0".to_vec() } else { b"II*\0".to_vec() };
        bytes.extend(first.to_le_bytes().into_iter().take(self.sizes().3));
        bytes
    }

    /// The directory at `at`, a multiple of 8, with the values outside it; the next one lies at `next`, or there is none and it is 0.
    pub(crate) fn directory(&self, at: u64, next: u64) -> Vec<u8> {
        let (_, count, entry, word) = self.sizes();
        let number = |value: u64| value.to_le_bytes().into_iter().take(word);
        let mut bytes = Vec::new();
        bytes.extend((self.entries.len() as u64).to_le_bytes().into_iter().take(count));
        let outside = at + (count + self.entries.len() * entry + word) as u64;
        let mut values: Vec<u8> = Vec::new();
        for entry in &self.entries {
            bytes.extend(entry.tag.to_le_bytes());
            bytes.extend(entry.kind.to_le_bytes());
            bytes.extend(number(entry.count));
            if entry.values.len() <= word {
                let mut value = entry.values.clone();
                value.resize(word, 0);
                bytes.extend(value);
            } else {
                bytes.extend(number(outside + values.len() as u64));
                values.extend(&entry.values);
                values.resize(values.len().next_multiple_of(8), 0);
            }
        }
        bytes.extend(number(next));
        bytes.extend(values);
        bytes
    }

    /// Header and directory of a file that has this one alone.
    pub(crate) fn file(&self) -> Vec<u8> {
        let first = self.sizes().0 as u64;
        let mut bytes = self.header(first);
        bytes.extend(self.directory(first, 0));
        bytes
    }
}
