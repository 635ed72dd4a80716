//! The key directory of a GeoTIFF: numbers and texts by the number of their key (OGC 19-008r4, section 7.1).
//!
//! A key's value stands in the directory itself, or in one of two other tags at a place that it gives. A key that points elsewhere is ignored. Cost: a search of
//! some dozen entries a key.

use super::tags::{self, Directory, TiffFile};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

/// Keys looked at, and the directory's head; there are not a hundred in the standard.
const MAX_KEYS: u64 = 1024;
/// Keys count values and characters in 16 bits.
const MAX_PLACE: u64 = 1 << 16;
/// Longest name kept.
const MAX_NAME_CHARS: usize = 200;

/// The key directory: triples of a key, where its value is, and the value or its place there.
pub(super) struct Keys {
    directory: Vec<u64>,
    reals: Vec<f64>,
    texts: String,
}

impl Keys {
    pub(super) fn read(file: &mut TiffFile, directory: &Directory) -> Result<Self, LayoutError> {
        Ok(Self {
            directory: file.numbers(directory, tags::GEO_KEY_DIRECTORY, 4 * MAX_KEYS)?.unwrap_or_default(),
            reals: file.reals(directory, tags::GEO_DOUBLE_PARAMS, MAX_PLACE)?.unwrap_or_default(),
            texts: file.text(directory, tags::GEO_ASCII_PARAMS, MAX_PLACE)?.unwrap_or_default(),
        })
    }

    /// A directory of these keys, codes and numbers.
    #[cfg(test)]
    pub(super) fn of(codes: &[(u16, u16)], numbers: &[(u16, &[f64])]) -> Self {
        let mut keys = Self { directory: vec![1, 1, 0, 0], reals: Vec::new(), texts: String::new() };
        for (key, code) in codes {
            keys.directory.extend([u64::from(*key), 0, 1, u64::from(*code)]);
        }
        for (key, values) in numbers {
            let tag = u64::from(tags::GEO_DOUBLE_PARAMS);
            keys.directory.extend([u64::from(*key), tag, values.len() as u64, keys.reals.len() as u64]);
            keys.reals.extend_from_slice(values);
        }
        keys
    }

    /// Tag, count and value of a key.
    fn entry(&self, key: u16) -> Option<(u64, usize, u64)> {
        let entries = self.directory.get(4..)?.chunks_exact(4);
        let entry = entries.into_iter().find(|entry| entry[0] == u64::from(key))?;
        Some((entry[1], usize::try_from(entry[2]).ok()?, entry[3]))
    }

    pub(super) fn short(&self, key: u16) -> Option<u16> {
        self.entry(key).filter(|entry| entry.0 == 0).and_then(|entry| u16::try_from(entry.2).ok())
    }

    /// A code of EPSG; 0 and 32767 stand for undefined and user-defined.
    pub(super) fn code(&self, key: u16) -> Option<u32> {
        self.short(key).filter(|code| !matches!(code, 0 | 32767)).map(u32::from)
    }

    pub(super) fn real(&self, key: u16) -> Option<f64> {
        let (tag, _, at) = self.entry(key)?;
        let at = usize::try_from(at).ok()?;
        (tag == u64::from(tags::GEO_DOUBLE_PARAMS)).then(|| self.reals.get(at).copied()).flatten()
    }

    /// All numbers of a key.
    pub(super) fn reals(&self, key: u16) -> Option<&[f64]> {
        let (tag, count, at) = self.entry(key)?;
        let at = usize::try_from(at).ok()?;
        let is_real = tag == u64::from(tags::GEO_DOUBLE_PARAMS) && count > 0;
        is_real.then(|| self.reals.get(at..at.checked_add(count)?)).flatten()
    }

    pub(super) fn text(&self, key: u16) -> Option<String> {
        let shown = harmless(&self.whole_text(key)?, MAX_NAME_CHARS);
        (!shown.is_empty()).then_some(shown)
    }

    /// A text in full, which may hold a whole reference system.
    pub(super) fn whole_text(&self, key: u16) -> Option<String> {
        let (tag, count, at) = self.entry(key)?;
        let at = usize::try_from(at).ok()?;
        if tag != u64::from(tags::GEO_ASCII_PARAMS) {
            return None;
        }
        let bytes = self.texts.as_bytes().get(at..at.checked_add(count)?.min(self.texts.len()))?;
        let text = String::from_utf8_lossy(bytes);
        Some(text.trim_end_matches(['|', '\0']).trim().to_owned())
    }
}
