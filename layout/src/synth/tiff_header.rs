//! Header and tag directory of an uncompressed GeoTIFF whose rows follow without a gap.
//!
//! Nothing depends on the samples, so the header can be written first and the rows streamed after it.
//! Files beyond 4 GiB are BigTIFF. Layout: header, directory, values that do not fit into it, rows.

use super::HEIGHT_SCALE;

const SHORT: u16 = 3;
const LONG: u16 = 4;
const DOUBLE: u16 = 12;
const ASCII: u16 = 2;
const LONG8: u16 = 16;

/// Bytes of a strip, about.
const STRIP_BYTES: u64 = 1 << 17;
/// Largest classic TIFF, with room for the header.
const CLASSIC_BYTES: u64 = (1 << 32) - (1 << 24);

/// The bytes before the first row of a grid of `size` x `size` 16-bit samples.
pub(super) fn header(size: u32, spacing_m: f64) -> Vec<u8> {
    let row_bytes = u64::from(size) * 2;
    let big = row_bytes * u64::from(size) > CLASSIC_BYTES;
    let rows_per_strip = (STRIP_BYTES / row_bytes).clamp(1, u64::from(size));
    let strips = u64::from(size).div_ceil(rows_per_strip);
    let strip_rows = |strip: u64| rows_per_strip.min(u64::from(size) - strip * rows_per_strip);
    let place = if big { LONG8 } else { LONG };
    let sizes: Vec<u64> = (0..strips).map(|strip| strip_rows(strip) * row_bytes).collect();

    let mut tags = Tags { big, entries: Vec::new() };
    tags.numbers(256, LONG, &[u64::from(size)]);
    tags.numbers(257, LONG, &[u64::from(size)]);
    tags.numbers(258, SHORT, &[16]);
    tags.numbers(259, SHORT, &[1]);
    tags.numbers(262, SHORT, &[1]);
    tags.numbers(273, place, &vec![0; sizes.len()]);
    tags.numbers(277, SHORT, &[1]);
    tags.numbers(278, LONG, &[rows_per_strip]);
    tags.numbers(279, place, &sizes);
    tags.numbers(339, SHORT, &[1]);
    tags.reals(33550, &[spacing_m, spacing_m, 0.0]);
    // The first sample is the north-west corner, `PixelIsPoint`; the south-west one is the origin.
    tags.reals(33922, &[0.0, 0.0, 0.0, 0.0, f64::from(size - 1) * spacing_m, 0.0]);
    let citation = "Terrasoar synthetic terrain, local metres|";
    tags.numbers(
        34735,
        SHORT,
        &[
            [1, 1, 0, 5],
            [1024, 0, 1, 1],
            [1025, 0, 1, 2],
            [1026, 34737, citation.len() as u64, 0],
            [3072, 0, 1, 32767],
            [3076, 0, 1, 9001],
        ]
        .concat(),
    );
    tags.text(34737, citation);
    tags.text(
        42112,
        &format!(
            "<GDALMetadata>\n  <Item name=\"SCALE\" sample=\"0\" role=\"scale\">{HEIGHT_SCALE}</Item>\n  \
             <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">m</Item>\n</GDALMetadata>\n"
        ),
    );

    // The places of the strips follow from the header's length, which they do not change.
    let start = tags.bytes().len() as u64;
    let places: Vec<u64> = (0..strips).map(|strip| start + strip * rows_per_strip * row_bytes).collect();
    tags.entries.retain(|entry| entry.tag != 273);
    tags.numbers(273, place, &places);
    tags.entries.sort_by_key(|entry| entry.tag);
    tags.bytes()
}

struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    values: Vec<u8>,
}

struct Tags {
    big: bool,
    entries: Vec<Entry>,
}

impl Tags {
    fn numbers(&mut self, tag: u16, kind: u16, numbers: &[u64]) {
        let bytes = match kind {
            SHORT => 2,
            LONG => 4,
            _ => 8,
        };
        let values = numbers.iter().flat_map(|number| number.to_le_bytes().into_iter().take(bytes)).collect();
        self.entries.push(Entry { tag, kind, count: numbers.len() as u64, values });
    }

    fn reals(&mut self, tag: u16, reals: &[f64]) {
        let values = reals.iter().flat_map(|real| real.to_le_bytes()).collect();
        self.entries.push(Entry { tag, kind: DOUBLE, count: reals.len() as u64, values });
    }

    fn text(&mut self, tag: u16, text: &str) {
        let values: Vec<u8> = text.bytes().chain([0]).collect();
        self.entries.push(Entry { tag, kind: ASCII, count: values.len() as u64, values });
    }

    /// Header, directory and the values outside it.
    fn bytes(&self) -> Vec<u8> {
        let (header, count, entry, word) = if self.big { (16, 8, 20, 8) } else { (8, 2, 12, 4) };
        let number = |value: u64| value.to_le_bytes().into_iter().take(word);
        let mut bytes: Vec<u8> = if self.big { b"II+\0\x08\0\0\0".to_vec() } else { b"II*\0".to_vec() };
        bytes.extend(number(header));
        bytes.extend((self.entries.len() as u64).to_le_bytes().into_iter().take(count));
        let outside = header as usize + count + self.entries.len() * entry + word;
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
                bytes.extend(number((outside + values.len()) as u64));
                values.extend(&entry.values);
                values.resize(values.len().next_multiple_of(8), 0);
            }
        }
        bytes.extend(number(0));
        bytes.extend(values);
        bytes
    }
}
