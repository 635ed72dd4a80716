//! Whether a file is one that this module makes.
//!
//! Code that is about to replace a file asks this first. **The answer depends on content alone**: the bytes before the samples must be exactly those that would be written
//! before samples of that number at that place, and the file must be as long as they need. Samples are not looked at. Cost: the header is read once and made twice.

use super::colour::TILE;
use super::output::PNG_KEYS;
use super::tiff_header::{header, placed_colour_header};
use super::{HEIGHT_SCALE, MAX_SIZE};
use crate::{PNG_HEIGHT_SCALE_KEY, is_tiff};
use png::{BitDepth, ColorType, Decoder, Limits};
use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;
use terrasoar_layout::file::disk::read_at;

/// Longest header that is compared: that of a picture of 800 GB.
const MAX_TILES: u64 = 1 << 20;
/// Entries that a directory of ours has, at most.
const MAX_ENTRIES: u64 = 16;
/// Memory for the text of a PNG; ours has two numbers.
const PNG_BYTES: usize = 1 << 20;

/// Whether the file at `path` could have been made by [`write`](super::write) or [`write_colour`](super::write_colour).
///
/// # Errors
/// The file cannot be read.
pub fn is_synthetic(path: &Path) -> io::Result<bool> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut head = [0; 16];
    if !fill(&file, &mut head, 0)? {
        return Ok(false);
    }
    if head.starts_with(b"\x89PNG") {
        return Ok(is_png(file));
    }
    if !is_tiff(&head) {
        return Ok(false);
    }
    let Some(tags) = Tags::read(&file, &head)? else { return Ok(false) };
    Ok(is_elevation(&file, length, &tags)? || is_colour(&file, length, &tags)?)
}

/// Reads `bytes` at `offset`; whether the file has them.
fn fill(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<bool> {
    match read_at(file, bytes, offset) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// Whether the file begins with `wanted`.
fn begins_with(file: &File, wanted: &[u8]) -> io::Result<bool> {
    let mut there = vec![0; wanted.len()];
    Ok(fill(file, &mut there, 0)? && there == wanted)
}

fn is_elevation(file: &File, length: u64, tags: &Tags) -> io::Result<bool> {
    let (Some(size), Some(spacing_m)) = (tags.number(256), tags.reals(file, 33550, 3)?) else {
        return Ok(false);
    };
    let Some(size) = u32::try_from(size).ok().filter(|size| is_size(*size)) else { return Ok(false) };
    let header = header(size, spacing_m[0]);
    Ok(length == header.len() as u64 + 2 * u64::from(size).pow(2) && begins_with(file, &header)?)
}

fn is_size(size: u32) -> bool {
    (3..=MAX_SIZE).contains(&size) && (size - 1).is_power_of_two()
}

fn is_colour(file: &File, length: u64, tags: &Tags) -> io::Result<bool> {
    let (Some(wide), Some(high)) = (tags.number(256), tags.number(257)) else { return Ok(false) };
    let (Ok(wide), Ok(high)) = (u32::try_from(wide), u32::try_from(high)) else { return Ok(false) };
    let tiles = u64::from(wide.div_ceil(TILE)) * u64::from(high.div_ceil(TILE));
    if tiles == 0 || tiles > MAX_TILES || tiles * 3 * u64::from(TILE).pow(2) > length {
        return Ok(false);
    }
    let (Some(place), Some(keys)) = (tags.reals(file, 34264, 16)?, tags.shorts(file, 34735, 24)?) else {
        return Ok(false);
    };
    let header = placed_colour_header([wide, high], TILE, &place, &keys);
    Ok(length == header.len() as u64 + tiles * 3 * u64::from(TILE).pow(2) && begins_with(file, &header)?)
}

/// Heights as PNG: the only text is spacing and scale.
fn is_png(file: File) -> bool {
    let mut decoder = Decoder::new_with_limits(BufReader::new(file), Limits { bytes: PNG_BYTES });
    // What cannot be decoded was not encoded here.
    let Ok(info) = decoder.read_header_info() else { return false };
    if (info.color_type, info.bit_depth) != (ColorType::Grayscale, BitDepth::Sixteen)
        || info.width != info.height
        || !is_size(info.width)
    {
        return false;
    }
    let Ok(reader) = decoder.read_info() else { return false };
    let texts = &reader.info().uncompressed_latin1_text;
    let scale = texts.iter().find(|text| text.keyword == PNG_HEIGHT_SCALE_KEY);
    texts.iter().map(|text| text.keyword.as_str()).eq(PNG_KEYS)
        && scale.is_some_and(|text| text.text.parse() == Ok(HEIGHT_SCALE))
}

/// The directory of a little-endian TIFF, as far as it is needed.
struct Tags {
    /// Bytes of a place in the file.
    word: usize,
    entries: Vec<Entry>,
}

struct Entry {
    tag: u16,
    count: u64,
    value: [u8; 8],
}

impl Tags {
    /// The directory that follows the header at once; none if there is no such.
    fn read(file: &File, head: &[u8; 16]) -> io::Result<Option<Self>> {
        let big = head.starts_with(b"II+\0");
        let (at, count_bytes, entry_bytes, word) = if big { (16, 8, 20, 8) } else { (8, 2, 12, 4) };
        let mut count = [0; 8];
        if !head.starts_with(b"II") || !fill(file, &mut count[..count_bytes], at)? {
            return Ok(None);
        }
        let count = u64::from_le_bytes(count);
        if count > MAX_ENTRIES {
            return Ok(None);
        }
        let mut bytes = vec![0; count as usize * entry_bytes];
        if !fill(file, &mut bytes, at + count_bytes as u64)? {
            return Ok(None);
        }
        let entries = bytes.chunks_exact(entry_bytes).map(|entry| Entry {
            tag: u16::from_le_bytes([entry[0], entry[1]]),
            count: number(&entry[4..4 + word]),
            value: number(&entry[4 + word..4 + 2 * word]).to_le_bytes(),
        });
        Ok(Some(Self { word, entries: entries.collect() }))
    }

    fn entry(&self, tag: u16) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.tag == tag)
    }

    /// A tag's only value.
    fn number(&self, tag: u16) -> Option<u64> {
        self.entry(tag).filter(|entry| entry.count == 1).map(|entry| number(&entry.value[..self.word]))
    }

    /// The bytes of `count` values of `size` bytes, which lie elsewhere in the file.
    fn outside(&self, file: &File, tag: u16, count: usize, size: usize) -> io::Result<Option<Vec<u8>>> {
        let Some(entry) = self.entry(tag).filter(|entry| entry.count == count as u64) else {
            return Ok(None);
        };
        let mut bytes = vec![0; count * size];
        let is_there = fill(file, &mut bytes, u64::from_le_bytes(entry.value))?;
        Ok(is_there.then_some(bytes))
    }

    fn reals(&self, file: &File, tag: u16, count: usize) -> io::Result<Option<Vec<f64>>> {
        let bytes = self.outside(file, tag, count, 8)?;
        let real = |bytes: &[u8]| f64::from_bits(number(bytes));
        Ok(bytes.map(|bytes| bytes.chunks_exact(8).map(real).collect()))
    }

    fn shorts(&self, file: &File, tag: u16, count: usize) -> io::Result<Option<Vec<u64>>> {
        let bytes = self.outside(file, tag, count, 2)?;
        Ok(bytes.map(|bytes| bytes.chunks_exact(2).map(number).collect()))
    }
}

/// A little-endian number of at most 8 bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::super::{ColourOptions, SynthOptions, write, write_colour};
    use super::*;
    use terrasoar_layout::build::{BuildOptions, build};
    use terrasoar_layout::progress::Silent;
    use terrasoar_layout::read::terrain::Terrain;

    #[test]
    fn what_is_made_here_is_known_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, size, spacing_m) in [("a.tif", 3, 20.0), ("b.tif", 257, 1.0 / 3.0), ("c.png", 65, 7.5)] {
            write(&SynthOptions { size, seed: 1, spacing_m }, &at(name), &|_| {}).unwrap();
            assert!(is_synthetic(&at(name)).unwrap(), "{name}");
        }
        let dem = crate::open(&[at("b.tif")]).unwrap();
        build(&*dem, &at("a.iqt"), &BuildOptions::default(), &Silent).unwrap();
        let options = ColourOptions { texels_a_sample: 5, ..ColourOptions::default() };
        write_colour(&Terrain::open(&at("a.iqt")).unwrap(), &options, &at("d.tif"), &|_| {}).unwrap();
        assert!(is_synthetic(&at("d.tif")).unwrap());
        assert!(!is_synthetic(&at("a.iqt")).unwrap());

        // Another length, another word before the samples, another kind of file.
        for (from, to) in [("b.tif", "e.tif"), ("d.tif", "f.tif")] {
            let sound = std::fs::read(at(from)).unwrap();
            let sample = sound.len() - 7;
            for (bytes, expected) in [
                (sound[..sound.len() - 1].to_vec(), false),
                ([&sound[..], b"x"].concat(), false),
                (flipped(&sound, 5), false),
                (flipped(&sound, sound.windows(9).position(|w| w == b"Terrasoar").unwrap()), false),
                (flipped(&sound, sample), true),
            ] {
                std::fs::write(at(to), bytes).unwrap();
                assert_eq!(is_synthetic(&at(to)).unwrap(), expected, "{to}");
            }
        }
        for length in 0..64 {
            std::fs::write(at("g"), &std::fs::read(at("a.tif")).unwrap()[..length]).unwrap();
            assert!(!is_synthetic(&at("g")).unwrap());
        }
        assert!(is_synthetic(&at("none")).is_err());
    }

    fn flipped(bytes: &[u8], at: usize) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        bytes[at] ^= 1;
        bytes
    }

    /// Sixteen bits of grey are not enough, and neither are the words of one who only states the spacing.
    #[test]
    fn a_height_map_of_others_is_not_ours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let made = |size: u32, texts: &[(&str, &str)]| {
            let mut encoder = png::Encoder::new(File::create(&path).unwrap(), size, size);
            encoder.set_color(ColorType::Grayscale);
            encoder.set_depth(BitDepth::Sixteen);
            for (key, value) in texts {
                encoder.add_text_chunk((*key).into(), (*value).into()).unwrap();
            }
            let samples = vec![0; size as usize * size as usize * 2];
            encoder.write_header().unwrap().write_image_data(&samples).unwrap();
            is_synthetic(&path).unwrap()
        };
        let [spacing, scale] = PNG_KEYS;
        assert!(made(33, &[(spacing, "20"), (scale, "0.1")]));
        assert!(!made(33, &[]));
        assert!(!made(33, &[(spacing, "20")]));
        assert!(!made(33, &[(spacing, "20"), (scale, "1")]));
        assert!(!made(33, &[(spacing, "20"), (scale, "0.1"), ("Author", "somebody")]));
        assert!(!made(34, &[(spacing, "20"), (scale, "0.1")]));
    }
}
