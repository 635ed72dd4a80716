//! A tile as a file, packed (`.hgt.gz`) or one of several in a zip archive.
//!
//! A tile's length gives its shape, so the length of a packed tile must be known before it is unpacked: gzip does so in its last four bytes, zip in its directory. Unpacking stops at that
//! length and refuses any other. Cost: a packed tile is unpacked whole, some 26 MB for one arc-second.

use super::name;
use super::shape::{refusal, samples_of};
use crate::guard::guard;
use crate::identify::is_called;
use crate::input;
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;
use zip::ZipArchive;

/// Largest tile that is unpacked: a third of an arc-second.
const MOST_BYTES: u64 = 2 * 10_801 * 10_801;
/// What DEFLATE makes shorter at most: 258 bytes of two bits.
const MOST_RATIO: u64 = 1032;
/// Entries of an archive, and bytes of its directory, that are looked through.
const MOST_ENTRIES: u16 = 4096;
const MOST_DIRECTORY: u32 = 1 << 20;

/// How a tile is stored.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Packing {
    Plain,
    Gzip,
    /// Number and name in the archive.
    Zip(usize, String),
}

/// A tile.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tile {
    path: PathBuf,
    packing: Packing,
    /// Columns and rows.
    pub(super) samples: [u32; 2],
}

/// Whether a file is a tile or an archive of tiles.
pub(crate) fn is_tile(path: &Path) -> bool {
    is_called(path, "hgt") || is_called(path, "hgt.gz") || (is_called(path, "zip") && has_tiles(path))
}

/// Whether a file is a zip archive with tiles in it.
pub(crate) fn has_tiles(path: &Path) -> bool {
    archive(path).is_ok_and(|archive| entries(&archive).next().is_some())
}

impl Tile {
    /// The tiles that the file at `path` holds: one, or those of an archive. `stated` is the shape that a person states.
    pub(super) fn all_of(path: &Path, stated: Option<[u32; 2]>) -> Result<Vec<Self>, LayoutError> {
        let mut file = input::open(path, "cannot open the .hgt tile")?;
        let failed = |source| LayoutError::io(path, "cannot read the .hgt tile", source);
        let length = file.metadata().map_err(failed)?.len();
        let mut magic = Vec::new();
        file.by_ref().take(4).read_to_end(&mut magic).map_err(failed)?;
        let tile = |packing: Packing, bytes: u64, packed: u64| {
            if bytes / MOST_RATIO > packed.min(length) {
                let problem = format!(
                    "the tile in it is said to have {bytes} bytes, more than can be packed into so few; fetch it again"
                );
                return Err(LayoutError::damaged(path, "packed heights", problem));
            }
            if packing != Packing::Plain && bytes > MOST_BYTES {
                let problem = format!(
                    "the tile in it is said to have {bytes} bytes, more than any tile; unpack it and name what comes out"
                );
                return Err(LayoutError::unsupported(path, problem));
            }
            let samples = match stated {
                Some(samples) if u64::from(samples[0]) * u64::from(samples[1]) * 2 == bytes => Some(samples),
                Some(_) => None,
                None => samples_of(bytes),
            };
            let samples = samples
                .ok_or_else(|| LayoutError::unsupported(path, refusal(bytes)).mended_by(Remedy::RawShape))?;
            Ok(Self { path: path.to_owned(), packing, samples })
        };
        if magic.starts_with(b"PK\x03\x04") {
            let mut archive = archive(path)?;
            let found: Vec<(usize, String)> = entries(&archive).collect();
            let sizes = found.into_iter().map(|(number, name)| {
                let entry = archive
                    .by_index_raw(number)
                    .map_err(|error| damaged_archive(path, &error.to_string()))?;
                tile(Packing::Zip(number, name), entry.size(), entry.compressed_size())
            });
            return sizes.collect();
        }
        if magic.starts_with(b"\x1f\x8b") {
            // At the end stands the length, modulo 2^32, of what was packed last; more than one piece is found out when it is unpacked.
            let mut last = [0; 4];
            file.seek(SeekFrom::End(-4)).and_then(|_| file.read_exact(&mut last)).map_err(failed)?;
            return Ok(vec![tile(Packing::Gzip, u64::from(u32::from_le_bytes(last)), length)?]);
        }
        Ok(vec![tile(Packing::Plain, length, length)?])
    }

    /// Its south-western corner by its name, latitude and longitude in whole degrees.
    pub(super) fn corner(&self) -> Option<(i32, i32)> {
        match &self.packing {
            Packing::Zip(_, name) => name::corner(Path::new(name)),
            _ => name::corner(&self.path),
        }
    }

    /// Its name for messages.
    pub(super) fn shown(&self) -> String {
        match &self.packing {
            Packing::Zip(_, name) => format!("{} in {}", harmless(name, 60), self.path.display()),
            _ => self.path.display().to_string(),
        }
    }

    /// The file that it is in.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it has to be unpacked before it is read.
    pub(super) fn is_packed(&self) -> bool {
        self.packing != Packing::Plain
    }

    /// Bytes of its heights.
    pub(super) fn bytes(&self) -> u64 {
        u64::from(self.samples[0]) * u64::from(self.samples[1]) * 2
    }

    /// The heights of a packed tile as bytes, from the north-western one on.
    pub(super) fn unpack(&self) -> Result<Vec<u8>, LayoutError> {
        let place = || self.shown();
        guard(&self.path, place, || match &self.packing {
            Packing::Plain => self.all_from(input::open(&self.path, "cannot open the .hgt tile")?),
            Packing::Gzip => {
                let file = input::open(&self.path, "cannot open the .hgt tile")?;
                self.all_from(MultiGzDecoder::new(BufReader::with_capacity(1 << 16, file)))
            }
            Packing::Zip(number, _) => {
                let mut archive = archive(&self.path)?;
                let entry = archive
                    .by_index(*number)
                    .map_err(|error| damaged_archive(&self.path, &error.to_string()))?;
                self.all_from(entry)
            }
        })
    }

    fn all_from(&self, mut stream: impl Read) -> Result<Vec<u8>, LayoutError> {
        let wanted = self.bytes();
        // At most MOST_BYTES, and no more than the packed bytes may become.
        let mut bytes = Vec::with_capacity(usize::try_from(wanted + 1).unwrap_or(0));
        let read = stream.by_ref().take(wanted + 1).read_to_end(&mut bytes);
        read.map_err(|source| match source.raw_os_error() {
            Some(_) => LayoutError::io(&self.path, "cannot read the .hgt tile", source),
            None => LayoutError::damaged(
                &self.path,
                "packed heights",
                "they cannot be unpacked; fetch the file again",
            ),
        })?;
        if bytes.len() as u64 != wanted {
            let problem = format!(
                "there are not the {wanted} bytes that the file says; fetch it again, or unpack it and name what comes out"
            );
            return Err(LayoutError::damaged(&self.path, "packed heights", problem));
        }
        Ok(bytes)
    }
}

/// Opens an archive whose directory is of a sane size.
fn archive(path: &Path) -> Result<ZipArchive<BufReader<File>>, LayoutError> {
    let failed = |source| LayoutError::io(path, "cannot read the archive", source);
    let mut file = input::open(path, "cannot open the archive")?;
    let length = file.metadata().map_err(failed)?.len();
    // The directory's end is in the last 22 bytes and a remark of at most 65,535.
    let mut tail = Vec::new();
    file.seek(SeekFrom::Start(length.saturating_sub(22 + 65_535)))
        .and_then(|_| file.by_ref().take(22 + 65_535).read_to_end(&mut tail))
        .map_err(failed)?;
    // Any of several ends may be the one that is believed.
    for at in tail.windows(4).enumerate().filter(|(_, bytes)| *bytes == b"PK\x05\x06").map(|(at, _)| at) {
        let Some(end) = tail.get(at..at + 20) else { continue };
        let entries = u16::from_le_bytes([end[10], end[11]]);
        let directory = u32::from_le_bytes([end[12], end[13], end[14], end[15]]);
        if entries > MOST_ENTRIES || directory > MOST_DIRECTORY {
            let problem = format!(
                "the archive has more than {MOST_ENTRIES} files; unpack it and name the folder with the tiles"
            );
            return Err(LayoutError::unsupported(path, problem));
        }
    }
    guard(
        path,
        || "directory of the archive".into(),
        || ZipArchive::new(BufReader::new(file)).map_err(|error| damaged_archive(path, &error.to_string())),
    )
}

/// Numbers and names of the tiles in an archive.
fn entries(archive: &ZipArchive<BufReader<File>>) -> impl Iterator<Item = (usize, String)> {
    let is_tile = |name: &str| is_called(Path::new(name), "hgt") && !name.contains("__MACOSX");
    let names = (0..archive.len())
        .filter_map(|number| Some((number, archive.name_for_index(number)?.ok()?.into_owned())));
    names.filter(move |(_, name)| is_tile(name))
}

fn damaged_archive(path: &Path, reason: &str) -> LayoutError {
    // The library's words name what is wrong, which may be a password or a rare packing.
    let is_locked = reason.to_ascii_lowercase().contains("password");
    let problem = if is_locked {
        "the archive is locked with a password; unpack it and name the tile inside"
    } else {
        "the archive cannot be read: it is damaged or packed in a rare way; fetch it again, or unpack it and name the tile inside"
    };
    LayoutError::damaged(path, "archive", problem)
}
