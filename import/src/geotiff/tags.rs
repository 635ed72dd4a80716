//! The tag directories of a TIFF or BigTIFF file.
//!
//! A directory is a list of (tag, type, count, value or place of the values). Every place and count is
//! checked against the length of the file when the directory is read. That does not bound memory by itself, because a file may be long and empty, and tags may
//! share their values. So code that reads values says how many of them it can use, and no more are read. The one list that grows with the image,
//! that of its chunks, stays in the file ([`super::listing`]). Cost: one small read a directory, one read a value.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::super::input;
use super::listing::Column;
use super::listing::whole_number;
use terrasoar_layout::error::LayoutError;

pub(super) const NEW_SUBFILE_TYPE: u16 = 254;
pub(super) const SUBFILE_TYPE: u16 = 255;
pub(super) const IMAGE_WIDTH: u16 = 256;
pub(super) const IMAGE_LENGTH: u16 = 257;
pub(super) const BITS_PER_SAMPLE: u16 = 258;
pub(super) const COMPRESSION: u16 = 259;
pub(super) const PHOTOMETRIC: u16 = 262;
pub(super) const FILL_ORDER: u16 = 266;
pub(super) const ORIENTATION: u16 = 274;
pub(super) const STRIP_OFFSETS: u16 = 273;
pub(super) const SAMPLES_PER_PIXEL: u16 = 277;
pub(super) const ROWS_PER_STRIP: u16 = 278;
pub(super) const STRIP_BYTE_COUNTS: u16 = 279;
pub(super) const PLANAR_CONFIGURATION: u16 = 284;
pub(super) const PREDICTOR: u16 = 317;
pub(super) const COLOR_MAP: u16 = 320;
pub(super) const TILE_WIDTH: u16 = 322;
pub(super) const TILE_LENGTH: u16 = 323;
pub(super) const TILE_OFFSETS: u16 = 324;
pub(super) const TILE_BYTE_COUNTS: u16 = 325;
pub(super) const SUB_IFDS: u16 = 330;
pub(super) const EXTRA_SAMPLES: u16 = 338;
pub(super) const SAMPLE_FORMAT: u16 = 339;
pub(super) const JPEG_TABLES: u16 = 347;
pub(super) const YCBCR_COEFFICIENTS: u16 = 529;
pub(super) const YCBCR_SUBSAMPLING: u16 = 530;
pub(super) const REFERENCE_BLACK_WHITE: u16 = 532;
pub(super) const MODEL_PIXEL_SCALE: u16 = 33550;
pub(super) const MODEL_TIEPOINT: u16 = 33922;
pub(super) const MODEL_TRANSFORMATION: u16 = 34264;
pub(super) const GEO_KEY_DIRECTORY: u16 = 34735;
pub(super) const GEO_DOUBLE_PARAMS: u16 = 34736;
pub(super) const GEO_ASCII_PARAMS: u16 = 34737;
pub(super) const GDAL_METADATA: u16 = 42112;
pub(super) const GDAL_NODATA: u16 = 42113;
pub(super) const LERC_PARAMETERS: u16 = 50674;

/// The tags that mean something here; what others hold is never looked at.
const KNOWN: [u16; 36] = [
    NEW_SUBFILE_TYPE,
    SUBFILE_TYPE,
    IMAGE_WIDTH,
    IMAGE_LENGTH,
    BITS_PER_SAMPLE,
    COMPRESSION,
    PHOTOMETRIC,
    FILL_ORDER,
    ORIENTATION,
    STRIP_OFFSETS,
    SAMPLES_PER_PIXEL,
    ROWS_PER_STRIP,
    STRIP_BYTE_COUNTS,
    PLANAR_CONFIGURATION,
    PREDICTOR,
    COLOR_MAP,
    TILE_WIDTH,
    TILE_LENGTH,
    TILE_OFFSETS,
    TILE_BYTE_COUNTS,
    SUB_IFDS,
    EXTRA_SAMPLES,
    SAMPLE_FORMAT,
    JPEG_TABLES,
    MODEL_PIXEL_SCALE,
    MODEL_TIEPOINT,
    MODEL_TRANSFORMATION,
    GEO_KEY_DIRECTORY,
    GEO_DOUBLE_PARAMS,
    GEO_ASCII_PARAMS,
    GDAL_METADATA,
    GDAL_NODATA,
    LERC_PARAMETERS,
    YCBCR_COEFFICIENTS,
    YCBCR_SUBSAMPLING,
    REFERENCE_BLACK_WHITE,
];

/// Tags of all directories together, at most: a directory has some twenty.
pub(super) const MAX_TAGS: u64 = 1 << 18;

/// An open TIFF file.
#[derive(Debug)]
pub(super) struct TiffFile {
    path: PathBuf,
    file: BufReader<File>,
    bytes: u64,
    big_endian: bool,
    big: bool,
}

/// The tags of one image.
#[derive(Debug)]
pub(super) struct Directory {
    entries: BTreeMap<u16, Entry>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    kind: u16,
    count: u64,
    /// The values themselves if they fit, else their place in the file.
    value: [u8; 8],
}

impl Directory {
    /// Whether any tag says where the grid lies.
    pub(super) fn has_georeference(&self) -> bool {
        [MODEL_PIXEL_SCALE, MODEL_TRANSFORMATION, GEO_KEY_DIRECTORY]
            .iter()
            .any(|tag| self.entries.contains_key(tag))
    }
}

impl TiffFile {
    /// Opens the file and reads its header.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
        let cannot_read = |source| LayoutError::io(path, "cannot read the TIFF file", source);
        let file = input::open(path, "cannot open the TIFF file")?;
        let bytes = file.metadata().map_err(cannot_read)?.len();
        Self::of(path, file, bytes)
    }

    /// A TIFF that lies inside of another file; for its tags alone.
    pub(super) fn inside(path: &Path, tiff: &[u8]) -> Result<Self, LayoutError> {
        let cannot_keep =
            |source| LayoutError::io(path, "cannot keep a part of the file in a temporary one", source);
        let mut file = tempfile::tempfile().map_err(cannot_keep)?;
        file.write_all(tiff).map_err(cannot_keep)?;
        Self::of(path, file, tiff.len() as u64)
    }

    fn of(path: &Path, file: File, bytes: u64) -> Result<Self, LayoutError> {
        let mut this = Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(1 << 16, file),
            bytes,
            big_endian: false,
            big: false,
        };
        let head = this.read_at(0, 4, "header")?;
        this.big_endian = head[0] == b'M';
        this.big = this.u16(&head[2..]) == 43;
        Ok(this)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn file(&self) -> &File {
        self.file.get_ref()
    }

    /// Length of the file.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    pub(super) fn is_big(&self) -> bool {
        self.big
    }

    pub(super) fn is_big_endian(&self) -> bool {
        self.big_endian
    }

    pub(super) fn damaged(&self, problem: impl Into<String>) -> LayoutError {
        LayoutError::damaged(&self.path, "tag directory", problem)
    }

    /// Where the first directory lies.
    pub(super) fn first_directory(&mut self) -> Result<u64, LayoutError> {
        if !self.big {
            let head = self.read_at(0, 8, "header")?;
            return Ok(u64::from(self.u32(&head[4..])));
        }
        let head = self.read_at(0, 16, "header")?;
        if self.u16(&head[4..]) != 8 {
            return Err(
                self.damaged("a BigTIFF has 8-byte offsets, this file declares others; write it again")
            );
        }
        Ok(self.u64(&head[8..]))
    }

    /// Reads the directory at `at`, which may have `tags_left` tags; also gives the place of the next.
    pub(super) fn directory(
        &mut self,
        at: u64,
        tags_left: &mut u64,
    ) -> Result<(Directory, u64), LayoutError> {
        let (count_bytes, entry_bytes, next_bytes, inline) =
            if self.big { (8, 20, 8, 8) } else { (2, 12, 4, 4) };
        let count = self.read_at(at, count_bytes, "tag directory")?;
        let count = if self.big { self.u64(&count) } else { u64::from(self.u16(&count)) };
        if count > u64::from(u16::MAX) {
            return Err(self.damaged(format!("it claims {count} tags; fetch the file again")));
        }
        *tags_left = tags_left.checked_sub(count).ok_or_else(|| {
            self.damaged(format!(
                "its directories have more than {MAX_TAGS} tags; write the file again with gdal_translate"
            ))
        })?;
        let table = self.read_at(at + count_bytes, count * entry_bytes + next_bytes, "tag directory")?;
        let (table, next) = table.split_at((count * entry_bytes) as usize);
        let mut entries = BTreeMap::new();
        for raw in table.chunks_exact(entry_bytes as usize) {
            let tag = self.u16(raw);
            let mut value = [0; 8];
            let (count, rest) = if self.big {
                (self.u64(&raw[4..]), &raw[12..])
            } else {
                (u64::from(self.u32(&raw[4..])), &raw[8..])
            };
            value[..rest.len()].copy_from_slice(rest);
            let entry = Entry { kind: self.u16(&raw[2..]), count, value };
            let Some(bytes) = type_bytes(entry.kind).checked_mul(count) else {
                return Err(self.damaged(format!("tag {tag} claims {count} values; fetch the file again")));
            };
            if bytes > inline && self.place(&entry).checked_add(bytes).is_none_or(|end| end > self.bytes) {
                return Err(self.damaged(format!(
                    "the {count} values of tag {tag} lie beyond the end of the file; it is cut short: fetch it again"
                )));
            }
            if KNOWN.contains(&tag) {
                entries.entry(tag).or_insert(entry);
            }
        }
        let next = if self.big { self.u64(next) } else { u64::from(self.u32(next)) };
        Ok((Directory { entries }, next))
    }

    /// Number of a tag's values; 0 without the tag.
    pub(super) fn count(&self, directory: &Directory, tag: u16) -> u64 {
        directory.entries.get(&tag).map_or(0, |entry| entry.count)
    }

    /// The bytes of a tag's first values, `most` of them at most, in file order, and their type.
    fn values(
        &mut self,
        directory: &Directory,
        tag: u16,
        most: u64,
    ) -> Result<Option<(u16, Vec<u8>)>, LayoutError> {
        let Some(entry) = directory.entries.get(&tag).copied() else {
            return Ok(None);
        };
        // The larger product was checked when the directory was read.
        let wanted = type_bytes(entry.kind) * entry.count.min(most);
        let values = if self.is_inline(&entry) {
            entry.value[..wanted as usize].to_vec()
        } else {
            self.read_at(self.place(&entry), wanted, "tag values")?
        };
        Ok(Some((entry.kind, values)))
    }

    /// A tag's first values as unsigned integers, `most` of them at most.
    pub(super) fn numbers(
        &mut self,
        directory: &Directory,
        tag: u16,
        most: u64,
    ) -> Result<Option<Vec<u64>>, LayoutError> {
        let Some((kind, bytes)) = self.values(directory, tag, most)? else {
            return Ok(None);
        };
        let size = self.whole_number_bytes(tag, kind)?;
        Ok(Some(bytes.chunks_exact(size).map(|value| self.whole_number(value)).collect()))
    }

    /// Where a tag's values are, for whoever reads them piece by piece.
    pub(super) fn column(&self, directory: &Directory, tag: u16) -> Result<Option<Column>, LayoutError> {
        let Some(entry) = directory.entries.get(&tag) else {
            return Ok(None);
        };
        Ok(Some(Column {
            count: entry.count,
            value_bytes: self.whole_number_bytes(tag, entry.kind)?,
            big_endian: self.big_endian,
            inline: self.is_inline(entry).then_some(entry.value),
            at: self.place(entry),
        }))
    }

    /// A tag's values as they are in the file, `most` bytes of them at most.
    pub(super) fn bytes_of(
        &mut self,
        directory: &Directory,
        tag: u16,
        most: u64,
    ) -> Result<Option<Vec<u8>>, LayoutError> {
        if self.count(directory, tag) > most {
            return Err(self.damaged(format!("tag {tag} has more than {most} bytes; write the file again")));
        }
        Ok(self.values(directory, tag, most)?.map(|(_, bytes)| bytes))
    }

    /// A tag's first value as an unsigned integer.
    pub(super) fn number(&mut self, directory: &Directory, tag: u16) -> Result<Option<u64>, LayoutError> {
        Ok(self.numbers(directory, tag, 1)?.and_then(|values| values.first().copied()))
    }

    /// A tag's first values as floating-point numbers, `most` of them at most.
    pub(super) fn reals(
        &mut self,
        directory: &Directory,
        tag: u16,
        most: u64,
    ) -> Result<Option<Vec<f64>>, LayoutError> {
        let Some((kind, bytes)) = self.values(directory, tag, most)? else {
            return Ok(None);
        };
        Ok(Some(match kind {
            12 => bytes.chunks_exact(8).map(|value| f64::from_bits(self.u64(value))).collect(),
            5 => {
                bytes.chunks_exact(8).map(|v| f64::from(self.u32(v)) / f64::from(self.u32(&v[4..]))).collect()
            }
            11 => bytes.chunks_exact(4).map(|value| f64::from(f32::from_bits(self.u32(value)))).collect(),
            _ => {
                return Err(
                    self.damaged(format!("tag {tag} has values of type {kind}, which are no real numbers"))
                );
            }
        }))
    }

    /// A tag's text up to its first NUL; one of more than `most` bytes is refused.
    pub(super) fn text(
        &mut self,
        directory: &Directory,
        tag: u16,
        most: u64,
    ) -> Result<Option<String>, LayoutError> {
        let Some(mut bytes) = self.bytes_of(directory, tag, most)? else {
            return Ok(None);
        };
        let kind = directory.entries.get(&tag).map_or(0, |entry| entry.kind);
        if !matches!(kind, 1 | 2 | 7) {
            return Err(self.damaged(format!("tag {tag} has values of type {kind}, which are no text")));
        }
        bytes.truncate(bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len()));
        // Nearly always what is there is text, and no copy is made.
        Ok(Some(
            String::from_utf8(bytes).unwrap_or_else(|e| String::from_utf8_lossy(e.as_bytes()).into_owned()),
        ))
    }

    /// Reads `count` bytes at `at`, after checking that the file has them.
    fn read_at(&mut self, at: u64, count: u64, place: &str) -> Result<Vec<u8>, LayoutError> {
        let cut_short = || {
            LayoutError::damaged(
                &self.path,
                place,
                format!(
                    "bytes {at} to {} are wanted and the file has {}: it is cut short; fetch it again",
                    at.saturating_add(count),
                    self.bytes
                ),
            )
        };
        let length = usize::try_from(count).map_err(|_| cut_short())?;
        if at.checked_add(count).is_none_or(|end| end > self.bytes) {
            return Err(cut_short());
        }
        let mut bytes = vec![0; length];
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => {
                LayoutError::damaged(&self.path, place, "the file was cut short while it was read")
            }
            _ => LayoutError::io(&self.path, "cannot read the TIFF file", source),
        })?;
        Ok(bytes)
    }

    /// Whether the values stand in the directory itself.
    fn is_inline(&self, entry: &Entry) -> bool {
        // The product was checked when the directory was read.
        type_bytes(entry.kind) * entry.count <= if self.big { 8 } else { 4 }
    }

    /// Bytes of a whole number of the type `kind`.
    fn whole_number_bytes(&self, tag: u16, kind: u16) -> Result<usize, LayoutError> {
        match kind {
            1 | 7 => Ok(1),
            3 => Ok(2),
            4 | 13 => Ok(4),
            16 | 18 => Ok(8),
            _ => {
                Err(self.damaged(format!("tag {tag} has values of type {kind}, which are no whole numbers")))
            }
        }
    }

    fn whole_number(&self, bytes: &[u8]) -> u64 {
        whole_number(bytes, self.big_endian)
    }

    fn place(&self, entry: &Entry) -> u64 {
        if self.big { self.u64(&entry.value) } else { u64::from(self.u32(&entry.value)) }
    }

    fn u16(&self, bytes: &[u8]) -> u16 {
        whole_number(&bytes[..2], self.big_endian) as u16
    }

    fn u32(&self, bytes: &[u8]) -> u32 {
        whole_number(&bytes[..4], self.big_endian) as u32
    }

    fn u64(&self, bytes: &[u8]) -> u64 {
        whole_number(&bytes[..8], self.big_endian)
    }
}

/// Bytes of one value of a TIFF type; unknown types count as bytes, their tags are not read.
fn type_bytes(kind: u16) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16..=18 => 8,
        _ => 1,
    }
}
