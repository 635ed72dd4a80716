//! Where the strips or tiles of an image lie, whatever they hold: heights ([`super::chunks`]) or colours ([`super::colour_table`]).
//!
//! Chunk `i` covers a rectangle of `chunk_width * chunk_height` samples, `across` of them side by side.
//! Tiles at the right and lower edge are stored whole, strips at the lower edge only as far as the image.

use super::tags::{self, Directory, TiffFile};
use crate::dem::Window;
use crate::error::LayoutError;

/// Largest unpacked chunk: the codecs need it in memory at once.
pub(super) const MAX_CHUNK_BYTES: u64 = 512 << 20;

/// The chunks of an image.
#[derive(Debug)]
pub(super) struct ChunkGrid {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) chunk_width: u32,
    pub(super) chunk_height: u32,
    pub(super) tiled: bool,
    pub(super) across: u32,
    /// Offset and packed length of each; 0 where the file left it out.
    pub(super) places: Vec<(u64, u64)>,
}

impl ChunkGrid {
    /// Reads the table of the image `directory`, and checks that it is as long as the image's size asks for.
    pub(super) fn read(
        file: &mut TiffFile,
        directory: &Directory,
        [width, height]: [u32; 2],
    ) -> Result<Self, LayoutError> {
        let tiled = file.number(directory, tags::TILE_WIDTH)?.is_some();
        let (chunk_width, chunk_height) = if tiled {
            (
                side(file, directory, tags::TILE_WIDTH, "tile width")?,
                side(file, directory, tags::TILE_LENGTH, "tile height")?,
            )
        } else {
            let rows = file.number(directory, tags::ROWS_PER_STRIP)?.unwrap_or(u64::MAX);
            (width, rows.min(u64::from(height)) as u32)
        };
        if chunk_width == 0 || chunk_height == 0 {
            return Err(file.damaged("a strip or tile without samples is declared; write the file again"));
        }
        let across = width.div_ceil(chunk_width);
        let wanted = u64::from(across) * u64::from(height.div_ceil(chunk_height));
        let (offsets, counts) = if tiled {
            (tags::TILE_OFFSETS, tags::TILE_BYTE_COUNTS)
        } else {
            (tags::STRIP_OFFSETS, tags::STRIP_BYTE_COUNTS)
        };
        let offsets = file.numbers(directory, offsets)?.unwrap_or_default();
        let counts = file.numbers(directory, counts)?.unwrap_or_default();
        if offsets.len() as u64 != wanted || counts.len() as u64 != wanted {
            return Err(file.damaged(format!(
                "{wanted} chunks make up the image, but {} places and {} lengths are listed; fetch the file again",
                offsets.len(),
                counts.len()
            )));
        }
        let places = offsets.into_iter().zip(counts).collect();
        Ok(Self { width, height, chunk_width, chunk_height, tiled, across, places })
    }

    /// Number of chunks.
    pub(super) fn count(&self) -> u64 {
        self.places.len() as u64
    }

    /// Offset and packed length of a chunk; `None` if the file left it out.
    pub(super) fn place(&self, chunk: u64) -> Option<(u64, u64)> {
        self.places.get(chunk as usize).copied().filter(|(at, bytes)| *at != 0 && *bytes != 0)
    }

    /// The part of the image a chunk covers.
    pub(super) fn window(&self, chunk: u64) -> Window {
        // Both fit: there are `across` chunks in a row and the image's sides are 32-bit.
        let col = (chunk % u64::from(self.across)) as u32 * self.chunk_width;
        let row = (chunk / u64::from(self.across)) as u32 * self.chunk_height;
        Window {
            col,
            row,
            width: self.chunk_width.min(self.width - col),
            height: self.chunk_height.min(self.height - row),
        }
    }

    /// Name of a chunk in messages.
    pub(super) fn name(&self, chunk: u64) -> String {
        format!("{} {chunk} of {}", if self.tiled { "tile" } else { "strip" }, self.count())
    }

    /// Refuses chunks of `bytes` unpacked if that is too much.
    pub(super) fn check_size(&self, file: &TiffFile, bytes: u64) -> Result<(), LayoutError> {
        if bytes <= MAX_CHUNK_BYTES {
            return Ok(());
        }
        Err(LayoutError::unsupported(
            file.path(),
            format!(
                "its {} of {} x {} would take {} MiB each in memory, more than the {} MiB allowed; write it again in tiles: \
                 gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER INPUT output.tif",
                self.kind(),
                self.chunk_width,
                self.chunk_height,
                bytes >> 20,
                MAX_CHUNK_BYTES >> 20
            ),
        ))
    }

    /// Refuses a chunk that lies at `at` and does not end in the file.
    pub(super) fn check_end(
        &self,
        file: &TiffFile,
        chunk: u64,
        at: u64,
        bytes: u64,
    ) -> Result<(), LayoutError> {
        if at.checked_add(bytes).is_some_and(|end| end <= file.bytes()) {
            return Ok(());
        }
        Err(LayoutError::damaged(
            file.path(),
            self.name(chunk),
            format!(
                "it would end beyond the {} bytes of the file, which is cut short; fetch it again",
                file.bytes()
            ),
        ))
    }

    /// "tiles" or "strips".
    pub(super) fn kind(&self) -> &'static str {
        if self.tiled { "tiles" } else { "strips" }
    }
}

/// A side of the image or of a tile.
pub(super) fn side(
    file: &mut TiffFile,
    directory: &Directory,
    tag: u16,
    what: &str,
) -> Result<u32, LayoutError> {
    let value = file.number(directory, tag)?;
    // Sides of 2^31 and more would overflow the sum of a chunk's place and its size.
    let side = value.and_then(|value| u32::try_from(value).ok()).filter(|side| *side <= i32::MAX as u32);
    side.ok_or_else(|| match value {
        Some(value) => {
            file.damaged(format!("a {what} of {value} samples is out of range; fetch the file again"))
        }
        None => file.damaged(format!("the {what} is missing; fetch or write the file again")),
    })
}
