//! A TIFF taken apart byte by byte, without the project's reader.

use std::io::Read;

/// A directory: where it lies, and its tags.
pub struct Directory {
    pub at: u64,
    pub tags: Vec<(u16, u16, Vec<u8>)>,
}

impl Directory {
    /// The numbers of a tag; none without it.
    pub fn numbers(&self, tag: u16) -> Vec<u64> {
        let Some((_, kind, bytes)) = self.tags.iter().find(|entry| entry.0 == tag) else { return Vec::new() };
        let size = size_of_kind(*kind);
        bytes.chunks_exact(size).map(|bytes| number(bytes)).collect()
    }

    pub fn number(&self, tag: u16) -> u64 {
        self.numbers(tag)[0]
    }
}

fn size_of_kind(kind: u16) -> usize {
    match kind {
        2 => 1,
        3 => 2,
        4 => 4,
        12 | 16 => 8,
        other => panic!("a tag of kind {other}"),
    }
}

fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// The directories in their order. Entries must be in the order of their tags.
pub fn directories(file: &[u8]) -> Vec<Directory> {
    let big = file.starts_with(b"II+\0\x08\0\0\0");
    assert!(big || file.starts_with(b"II*\0"));
    let (word, count_bytes) = if big { (8, 8) } else { (4, 2) };
    let mut at = number(if big { &file[8..16] } else { &file[4..8] }) as usize;
    let mut found = Vec::new();
    while at != 0 {
        assert!(at % 2 == 0, "directories begin at even places");
        let count = number(&file[at..at + count_bytes]) as usize;
        let mut tags: Vec<(u16, u16, Vec<u8>)> = Vec::new();
        let entry_bytes = 4 + 2 * word;
        for entry in file[at + count_bytes..].chunks_exact(entry_bytes).take(count) {
            let (tag, kind) = (number(&entry[..2]) as u16, number(&entry[2..4]) as u16);
            assert!(tags.last().is_none_or(|last| last.0 < tag), "tags are in their order");
            let bytes = number(&entry[4..4 + word]) as usize * size_of_kind(kind);
            let inline = &entry[4 + word..];
            let values = if bytes <= word {
                inline[..bytes].to_vec()
            } else {
                let place = number(inline) as usize;
                file[place..place + bytes].to_vec()
            };
            tags.push((tag, kind, values));
        }
        let next = at + count_bytes + count * entry_bytes;
        found.push(Directory { at: at as u64, tags });
        at = number(&file[next..next + word]) as usize;
    }
    found
}

/// All numbers of a directory's image, rows from the north; what stands for none is NaN. Integers of 16 bits and reals, DEFLATE, with their predictors.
pub fn image(file: &[u8], directory: &Directory) -> Vec<f64> {
    let [wide, high, side] = [256, 257, 322].map(|tag| directory.number(tag) as usize);
    assert_eq!((directory.number(259), directory.number(323)), (8, side as u64));
    let bytes = directory.number(258) as usize / 8;
    let across = wide.div_ceil(side);
    let mut image = vec![f64::INFINITY; wide * high];
    let places = directory.numbers(324).into_iter().zip(directory.numbers(325));
    for (i, (offset, length)) in places.enumerate() {
        let packed = &file[offset as usize..(offset + length) as usize];
        let mut tile = Vec::new();
        flate2::read::ZlibDecoder::new(packed).read_to_end(&mut tile).unwrap();
        assert_eq!(tile.len(), side * side * bytes);
        for (row, bytes_of_row) in tile.chunks_exact(side * bytes).enumerate() {
            let values = row_of(bytes_of_row, bytes, directory);
            let (y, x) = (i / across * side + row, i % across * side);
            if y < high {
                let count = side.min(wide - x);
                image[y * wide + x..][..count].copy_from_slice(&values[..count]);
            }
        }
    }
    image
}

fn row_of(packed: &[u8], bytes: usize, directory: &Directory) -> Vec<f64> {
    let side = packed.len() / bytes;
    match (directory.number(339), directory.number(317)) {
        (2, 2) => {
            let mut last = 0u16;
            let mut value = |pair: &[u8]| {
                last = last.wrapping_add(number(pair) as u16);
                if last == 0x8000 { f64::NAN } else { f64::from(last.cast_signed()) }
            };
            packed.chunks_exact(2).map(&mut value).collect()
        }
        (3, 3) => {
            let mut plain = packed.to_vec();
            for i in 1..plain.len() {
                plain[i] = plain[i].wrapping_add(plain[i - 1]);
            }
            let bits =
                |i: usize| (0..bytes).fold(0, |bits, plane| bits << 8 | u64::from(plain[plane * side + i]));
            let value = |i: usize| match bytes {
                4 => f64::from(f32::from_bits(bits(i) as u32)),
                _ => f64::from_bits(bits(i)),
            };
            (0..side).map(value).collect()
        }
        other => panic!("format and predictor {other:?}"),
    }
}
