//! Where the strips or tiles of an image lie, whatever they hold: heights ([`super::chunks`]) or colours ([`super::colour_table`]).
//!
//! Chunk `i` covers a rectangle of `chunk_width * chunk_height` samples, `across` of them side by side.
//! Tiles at the right and lower edge are stored whole, strips at the lower edge only as far as the image. Only the shape is held in memory. Where each chunk lies stays in the file
//! ([`super::listing`]).

use super::listing::{Listing, Place, Places};
use super::tags::{self, Directory, TiffFile};
use std::fs::File;
use std::path::Path;
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;

/// Samples from which on an image is large.
const LARGE_SAMPLES: u64 = 1 << 26;
/// Of how many samples of a large image one is stored at least.
const SPARSEST: u64 = 1024;

/// The chunks of an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChunkGrid {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) chunk_width: u32,
    pub(super) chunk_height: u32,
    pub(super) tiled: bool,
    pub(super) across: u32,
    /// Images of the same shape that are listed one after the other, one for each band.
    planes: u64,
    listing: Listing,
    /// Chunks that one in the file was cut into, one below the other.
    cuts: u32,
    /// Bytes of a row of a chunk that was cut.
    row_bytes: u64,
}

/// What a look at all places found.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stored {
    /// Packed length of the longest chunk.
    pub(super) longest: u64,
    /// Samples of the image that lie in a chunk.
    pub(super) samples: u64,
}

impl ChunkGrid {
    /// Reads the table of the image `directory`, and checks that it is as long as the image's size and its `planes` ask for.
    pub(super) fn read(
        file: &mut TiffFile,
        directory: &Directory,
        [width, height]: [u32; 2],
        planes: u64,
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
        let one = u64::from(across) * u64::from(height.div_ceil(chunk_height));
        let wanted = one.saturating_mul(planes);
        let (offsets, counts) = if tiled {
            (tags::TILE_OFFSETS, tags::TILE_BYTE_COUNTS)
        } else {
            (tags::STRIP_OFFSETS, tags::STRIP_BYTE_COUNTS)
        };
        let listed = [file.count(directory, offsets), file.count(directory, counts)];
        let (offsets, counts) = (file.column(directory, offsets)?, file.column(directory, counts)?);
        let listing = offsets.and_then(|offsets| Listing::new(offsets, counts, file.bytes()));
        let listing = listing.filter(|listing| listing.count() == wanted);
        let Some(listing) = listing else {
            return Err(file.damaged(format!(
                "{wanted} chunks make up the image, but {} places and {} lengths are listed; fetch the file again",
                listed[0], listed[1]
            )));
        };
        Ok(Self {
            width,
            height,
            chunk_width,
            chunk_height,
            tiled,
            across,
            planes,
            listing,
            cuts: 1,
            row_bytes: 0,
        })
    }

    /// Cuts chunks that are not compressed, of `row_bytes` a row, into such of `rows` rows, which their height is a multiple of unless there is but one
    /// row of them.
    pub(super) fn cut(&mut self, rows: u32, row_bytes: u64) {
        self.cuts = self.chunk_height.div_ceil(rows);
        self.row_bytes = row_bytes;
        self.chunk_height = rows;
    }

    /// Offset and packed length of a chunk of the plane told; `None` if the file left it out. No chunk of an image of several planes is cut.
    pub(super) fn place_of(
        &self,
        plane: u64,
        chunk: u64,
        places: &mut Places<'_>,
    ) -> Result<Option<(u64, u64)>, LayoutError> {
        self.place(plane * self.count() + chunk, places)
    }

    /// Number of chunks of a plane, cut ones counted apart.
    pub(super) fn count(&self) -> u64 {
        u64::from(self.across) * u64::from(self.height.div_ceil(self.chunk_height))
    }

    /// Says how many bytes a chunk unpacks to at most: that bounds how long one can be whose length the file does not state. What is worth packing becomes no longer by it, but for
    /// a head and a sum.
    pub(super) fn set_decoded_bytes(&mut self, decoded: u64) {
        self.listing.set_unstated_bytes(decoded.saturating_mul(2).saturating_add(64));
    }

    /// What reads places of chunks from `file`.
    pub(super) fn places<'f>(&self, path: &'f Path, file: &'f File) -> Places<'f> {
        Places::new(path, file, self.listing)
    }

    /// Offset and packed length of a chunk; `None` if the file left it out. The length of one that is not compressed means nothing.
    pub(super) fn place(
        &self,
        chunk: u64,
        places: &mut Places<'_>,
    ) -> Result<Option<(u64, u64)>, LayoutError> {
        if self.cuts == 1 {
            return places.get(chunk);
        }
        let [across, cuts] = [self.across, self.cuts].map(u64::from);
        let (row, col) = (chunk / across, chunk % across);
        let skipped = row % cuts * u64::from(self.chunk_height) * self.row_bytes;
        Ok(places.get(row / cuts * across + col)?.map(|(at, length)| (at.saturating_add(skipped), length)))
    }

    /// Looks at the place of every chunk, before they are cut: that it lies in the file, and that all of them together are no longer than the file and what they unpack to
    /// allow. `unpacked` gives the bytes that a chunk's samples take, `each` hears number, offset and packed length.
    pub(super) fn check_places(
        &self,
        file: &TiffFile,
        is_raw: bool,
        unpacked: impl Fn(u64) -> u64,
        mut each: impl FnMut(u64, u64, u64) -> Result<(), LayoutError>,
    ) -> Result<Stored, LayoutError> {
        let mut places = self.places(file.path(), file.file());
        let mut stored = Stored::default();
        let (mut packed_bytes, mut unpacked_bytes) = (0u64, 0u64);
        let mut next = 0;
        while let Some(Place { chunk, at, length: packed, is_stated }) = places.next(next)? {
            next = chunk + 1;
            let samples = unpacked(chunk);
            let length = if is_raw { samples } else { packed };
            self.check_end(file, chunk, at, length)?;
            each(chunk, at, packed)?;
            stored.longest = stored.longest.max(length);
            let Window { width, height, .. } = self.window(chunk);
            stored.samples += u64::from(width) * u64::from(height);
            if is_raw || is_stated {
                packed_bytes = packed_bytes.saturating_add(length);
            }
            unpacked_bytes = unpacked_bytes.saturating_add(samples);
        }
        // As if all planes were stored alike.
        stored.samples /= self.planes;
        // Equal chunks may be stored once; but then they are short. All of them long and in one place would make a small file endless.
        if packed_bytes > file.bytes().max(unpacked_bytes.saturating_mul(2)) {
            return Err(file.damaged(format!(
                "its {} lie over each other: {packed_bytes} bytes of them in a file of {}; fetch or write the file again",
                self.kind(),
                file.bytes()
            )));
        }
        Ok(stored)
    }

    /// Refuses an image that is large and hardly there, with what to do: a file of some hundred bytes would ask for hours and gigabytes.
    /// Of an image with a mask only the samples of which its mask is `shown` count.
    pub(super) fn check_sparse(
        &self,
        file: &TiffFile,
        stored: u64,
        shown: Option<u64>,
        advice: &str,
    ) -> Result<(), LayoutError> {
        let samples = shown.unwrap_or(u64::from(self.width) * u64::from(self.height));
        if samples < LARGE_SAMPLES || stored >= samples / SPARSEST {
            return Ok(());
        }
        let there = if stored == 0 { "none is".into() } else { format!("only {stored} are") };
        let which = if shown.is_some() { "of which its mask is stored" } else { "that it declares" };
        let problem = format!("of the {samples} samples {which} {there} stored; {advice}");
        Err(LayoutError::unsupported(file.path(), problem))
    }

    /// The part of the image a chunk of any plane covers.
    pub(super) fn window(&self, chunk: u64) -> Window {
        let chunk = chunk % self.count();
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
        format!("{} {chunk} of {}", if self.tiled { "tile" } else { "strip" }, self.planes * self.count())
    }

    /// Refuses a chunk that lies at `at` and does not end in the file.
    fn check_end(&self, file: &TiffFile, chunk: u64, at: u64, bytes: u64) -> Result<(), LayoutError> {
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
