//! TIFF files made tag by tag, the impossible ones included.

#![allow(dead_code, reason = "each test binary uses a part of this")]

/// A tag: its number, the type and number of its values, and the values or the place that the file claims for them.
#[derive(Clone)]
pub(crate) struct Tag {
    number: u16,
    kind: u16,
    count: u64,
    values: Values,
}

#[derive(Clone)]
enum Values {
    Here(Vec<u8>),
    At(u64),
}

pub(crate) fn shorts(number: u16, values: &[u16]) -> Tag {
    let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    Tag { number, kind: 3, count: values.len() as u64, values: Values::Here(bytes) }
}

pub(crate) fn longs(number: u16, values: &[u32]) -> Tag {
    let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    Tag { number, kind: 4, count: values.len() as u64, values: Values::Here(bytes) }
}

pub(crate) fn reals(number: u16, values: &[f64]) -> Tag {
    let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    Tag { number, kind: 12, count: values.len() as u64, values: Values::Here(bytes) }
}

pub(crate) fn rationals(number: u16, values: &[[u32; 2]]) -> Tag {
    let bytes = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    Tag { number, kind: 5, count: values.len() as u64, values: Values::Here(bytes) }
}

pub(crate) fn text(number: u16, text: &str) -> Tag {
    let bytes = [text.as_bytes(), b"\0"].concat();
    Tag { number, kind: 2, count: bytes.len() as u64, values: Values::Here(bytes) }
}

/// A tag that says there are `count` values at `at`.
pub(crate) fn claimed(number: u16, kind: u16, count: u64, at: u64) -> Tag {
    Tag { number, kind, count, values: Values::At(at) }
}

impl Tag {
    pub(crate) fn number(&self) -> u16 {
        self.number
    }
}

/// Where the data lie that a file is given.
pub(crate) const DATA_AT: u32 = 16;

/// A little-endian file, classic or BigTIFF, of one directory behind `data`.
pub(crate) fn tiff(is_big: bool, mut tags: Vec<Tag>, data: &[u8]) -> Vec<u8> {
    // A later tag of a number takes the place of an earlier one.
    tags.reverse();
    tags.sort_by_key(|tag| tag.number);
    tags.dedup_by_key(|tag| tag.number);
    let mut bytes = vec![0; DATA_AT as usize];
    bytes.extend_from_slice(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    let inline = if is_big { 8 } else { 4 };
    let entries = entries(&mut bytes, &tags, inline);
    let directory = bytes.len() as u64;
    if is_big {
        bytes.extend_from_slice(&(tags.len() as u64).to_le_bytes());
        bytes[..8].copy_from_slice(b"II\x2b\0\x08\0\0\0");
        bytes[8..16].copy_from_slice(&directory.to_le_bytes());
    } else {
        bytes.extend_from_slice(&(tags.len() as u16).to_le_bytes());
        bytes[..4].copy_from_slice(b"II\x2a\0");
        bytes[4..8].copy_from_slice(&(directory as u32).to_le_bytes());
    }
    bytes.extend_from_slice(&entries);
    bytes.extend_from_slice(&[0; 8][..inline]);
    bytes
}

/// The entries of a directory; values that do not fit in it are appended to `bytes`.
fn entries(bytes: &mut Vec<u8>, tags: &[Tag], inline: usize) -> Vec<u8> {
    let mut entries = Vec::new();
    for tag in tags {
        let mut value = match &tag.values {
            Values::Here(values) if values.len() <= inline => values.clone(),
            Values::Here(values) => {
                let at = bytes.len() as u64;
                bytes.extend_from_slice(values);
                bytes.resize(bytes.len().next_multiple_of(8), 0);
                at.to_le_bytes().to_vec()
            }
            Values::At(at) => at.to_le_bytes().to_vec(),
        };
        value.resize(inline, 0);
        entries.extend_from_slice(&tag.number.to_le_bytes());
        entries.extend_from_slice(&tag.kind.to_le_bytes());
        entries.extend_from_slice(&tag.count.to_le_bytes()[..inline]);
        entries.extend_from_slice(&value);
    }
    entries
}

/// Appends a directory to a little-endian classic file, with the place of the next one, and gives its own.
pub(crate) fn append(file: &mut Vec<u8>, tags: &[Tag], next: u32) -> u32 {
    let mut tags = tags.to_vec();
    tags.reverse();
    tags.sort_by_key(|tag| tag.number);
    tags.dedup_by_key(|tag| tag.number);
    let entries = entries(file, &tags, 4);
    let at = file.len() as u32;
    file.extend_from_slice(&(tags.len() as u16).to_le_bytes());
    file.extend_from_slice(&entries);
    file.extend_from_slice(&next.to_le_bytes());
    at
}

/// Compression codes.
pub(crate) const RAW: u16 = 1;
pub(crate) const LZW: u16 = 5;
pub(crate) const JPEG: u16 = 7;
pub(crate) const DEFLATE: u16 = 8;
pub(crate) const PACK_BITS: u16 = 32773;
pub(crate) const ZSTD: u16 = 50000;

/// Tags of a grid of 16-bit heights in strips of `rows` rows that lie where told, 10 m apart.
pub(crate) fn heights(
    size: [u32; 2],
    compression: u16,
    rows: u32,
    offsets: &[u32],
    lengths: &[u32],
) -> Vec<Tag> {
    vec![
        longs(256, &[size[0]]),
        longs(257, &[size[1]]),
        shorts(258, &[16]),
        shorts(259, &[compression]),
        shorts(262, &[1]),
        longs(273, offsets),
        shorts(277, &[1]),
        longs(278, &[rows]),
        longs(279, lengths),
        shorts(339, &[1]),
        reals(33550, &[10.0, 10.0, 0.0]),
        reals(33922, &[0.0; 6]),
    ]
}

/// As [`heights`], of one strip of `data`.
pub(crate) fn one_strip(size: [u32; 2], compression: u16, data: &[u8]) -> Vec<u8> {
    tiff(false, heights(size, compression, size[1], &[DATA_AT], &[data.len() as u32]), data)
}
