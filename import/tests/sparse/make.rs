//! BigTIFF files of which next to nothing is there, written tag by tag: the tables of chunks are holes but for the chunks that are stored.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

/// An image of a file.
#[derive(Clone, Default)]
pub(crate) struct Image {
    /// Columns and rows.
    pub(crate) size: [u32; 2],
    /// Columns and rows of a tile; of a strip 0 and its rows.
    pub(crate) chunk: [u32; 2],
    pub(crate) bits: u16,
    /// Whether samples of 16 bits have no sign.
    pub(crate) is_unsigned: bool,
    /// Samples of a pixel, of which the last is alpha if it `has_alpha`.
    pub(crate) bands: u16,
    pub(crate) has_alpha: bool,
    /// Bands one after the other.
    pub(crate) is_planar: bool,
    /// What it is (NewSubfileType): 0 an image, 1 a smaller one, 4 a mask, 5 a smaller mask.
    pub(crate) kind: u32,
    /// Whether it says that it masks the file beside it.
    pub(crate) is_mask_file: bool,
    pub(crate) nodata: Option<&'static str>,
    /// Bytes of the chunks that are there, packed by DEFLATE, by number; those of the second band of a planar image count on.
    pub(crate) chunks: BTreeMap<u64, Vec<u8>>,
}

impl Image {
    fn count(&self) -> u64 {
        let across = if self.chunk[0] == 0 { 1 } else { self.size[0].div_ceil(self.chunk[0]) };
        let planes = if self.is_planar { self.bands } else { 1 };
        u64::from(across) * u64::from(self.size[1].div_ceil(self.chunk[1])) * u64::from(planes)
    }

    /// Stores what `value` says of columns, rows and bands in the chunks, of the first plane, that hold the places told.
    pub(crate) fn fill(&mut self, places: &[[u32; 2]], value: impl Fn(u32, u32, u16) -> i16) {
        let [wide, high] = [if self.chunk[0] == 0 { self.size[0] } else { self.chunk[0] }, self.chunk[1]];
        let across = u64::from(self.size[0].div_ceil(wide));
        for [x, y] in places {
            let [col, row] = [x / wide, y / high];
            let number = u64::from(row) * across + u64::from(col);
            let top = row * self.chunk[1];
            let high = if self.chunk[0] == 0 { high.min(self.size[1] - row * high) } else { high };
            for plane in 0..if self.is_planar { self.bands } else { 1 } {
                let mut bytes = Vec::new();
                for (y, x) in (0..high).flat_map(|y| (0..wide).map(move |x| (top + y, col * wide + x))) {
                    for band in if self.is_planar { plane..plane + 1 } else { 0..self.bands } {
                        let value = value(x, y, band);
                        if self.bits == 8 {
                            bytes.push(value as u8)
                        } else {
                            bytes.extend(value.to_le_bytes())
                        }
                    }
                }
                let each = self.count() / u64::from(if self.is_planar { self.bands } else { 1 });
                let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
                encoder.write_all(&bytes).unwrap();
                self.chunks.insert(number + u64::from(plane) * each, encoder.finish().unwrap());
            }
        }
    }
}

/// Writes images into a file, 10 m a sample, in zone 33.
pub(crate) fn write(path: &Path, images: &[Image]) {
    let mut file = File::create(path).unwrap();
    let mut end = 16u64;
    let mut put = |at: u64, bytes: &[u8]| {
        file.seek(SeekFrom::Start(at)).unwrap();
        file.write_all(bytes).unwrap();
    };
    put(0, b"II\x2b\0\x08\0\0\0");
    let mut link = 8;
    for image in images {
        let tables = [end, end + 8 * image.count()];
        end += 16 * image.count();
        for (number, bytes) in &image.chunks {
            put(tables[0] + 8 * number, &end.to_le_bytes());
            put(tables[1] + 8 * number, &(bytes.len() as u64).to_le_bytes());
            put(end, bytes);
            end += bytes.len().next_multiple_of(8) as u64;
        }
        let is_tiled = image.chunk[0] > 0;
        let mut tags: Vec<(u16, u16, u64, Vec<u8>)> = Vec::new();
        let mut short = |number: u16, values: &[u16]| {
            tags.push((
                number,
                3,
                values.len() as u64,
                values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            ));
        };
        short(258, &vec![image.bits; image.bands.into()]);
        short(259, &[8]);
        short(262, &[if image.kind & 4 == 4 { 4 } else { 1 }]);
        short(277, &[image.bands]);
        short(284, &[if image.is_planar { 2 } else { 1 }]);
        short(339, &vec![if image.bits == 16 && !image.is_unsigned { 2 } else { 1 }; image.bands.into()]);
        if image.bands > 1 {
            let kinds: Vec<u16> = (1..image.bands)
                .map(|band| if image.has_alpha && band + 1 == image.bands { 2 } else { 0 })
                .collect();
            short(338, &kinds);
        }
        // A projected system, pixels that are areas, EPSG:32633.
        short(34735, &[1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32633]);
        let mut long = |number: u16, value: u32| tags.push((number, 4, 1, value.to_le_bytes().to_vec()));
        long(254, image.kind);
        long(256, image.size[0]);
        long(257, image.size[1]);
        if is_tiled {
            long(322, image.chunk[0]);
            long(323, image.chunk[1]);
        } else {
            long(278, image.chunk[1]);
        }
        let [offsets, lengths] = if is_tiled { [324, 325] } else { [273, 279] };
        let reals = |values: &[f64]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        tags.push((33550, 12, 3, reals(&[10.0, 10.0, 0.0])));
        tags.push((33922, 12, 6, reals(&[0.0, 0.0, 0.0, 400_000.0, 5_400_000.0, 0.0])));
        let mut text = |number: u16, text: &str| {
            tags.push((number, 2, text.len() as u64 + 1, format!("{text}\0").into_bytes()));
        };
        if image.is_mask_file {
            text(42112, "<GDALMetadata><Item name=\"INTERNAL_MASK_FLAGS_1\">2</Item></GDALMetadata>");
        }
        if let Some(nodata) = image.nodata {
            text(42113, nodata);
        }
        let columns = [(offsets, tables[0]), (lengths, tables[1])];
        let listed = columns.map(|(number, at)| (number, 16, image.count(), at.to_le_bytes().to_vec()));
        if image.count() > 1 {
            tags.extend(listed);
        } else {
            let (at, length) = image
                .chunks
                .get(&0)
                .map_or((0, 0), |bytes| (end - bytes.len().next_multiple_of(8) as u64, bytes.len() as u64));
            tags.push((offsets, 16, 1, at.to_le_bytes().to_vec()));
            tags.push((lengths, 16, 1, length.to_le_bytes().to_vec()));
        }
        let is_table = |number: u16| number == offsets || number == lengths;
        for (number, _, _, bytes) in &mut tags {
            if bytes.len() > 8 && !is_table(*number) {
                put(end, bytes);
                let at = end;
                end += bytes.len().next_multiple_of(8) as u64;
                *bytes = at.to_le_bytes().to_vec();
            }
            bytes.resize(8, 0);
        }
        tags.sort_by_key(|(number, ..)| *number);
        put(link, &end.to_le_bytes());
        let mut directory = (tags.len() as u64).to_le_bytes().to_vec();
        for (number, kind, count, bytes) in &tags {
            directory.extend(number.to_le_bytes());
            directory.extend(kind.to_le_bytes());
            directory.extend(count.to_le_bytes());
            directory.extend(bytes);
        }
        link = end + directory.len() as u64;
        directory.extend([0; 8]);
        put(end, &directory);
        end += directory.len() as u64;
    }
}
