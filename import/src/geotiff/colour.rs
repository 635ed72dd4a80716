//! GeoTIFF as pictures: grey, palette, RGB, YCbCr, CMYK, with or without alpha, side by side or band after band, 8 bits a channel or 16 cut to them, JPEG-compressed chunks included;
//! of any numbers where a person states which are black and white.
//!
//! [`super::colour_table`] says where the chunks are and how they are packed; here they become rows. As many chunks as make one row of tiles, or some
//! 64 rows of strips, are unpacked in parallel and handed out row by row. Memory: those chunks, 4 bytes a texel, as numbers 16.
//!
//! A texel whose channels all equal the declared void value is transparent, as is a chunk the file left out. A mask in an image of its own is handed on.

use super::chunks::Predictor;
use super::colour_paint::Paint;
use super::colour_table::{Packing, Table};
use super::listing::Places;
use super::span::turn_bits;
use super::{TiffMask, codec, colour_codecs, failure, geokeys, predictor, tags};
use crate::guard::guard;
use crate::input;
use crate::reader::{CrsSaid, NumberRows, Numbers, Orientation, Picture, Reader, bits_of};
use crate::shown::PictureOptions;
use rayon::prelude::*;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU16, Ordering};
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::read_at;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};

/// Rows of strips unpacked at once, about.
const GROUP_ROWS: u32 = 64;
/// What is known of a chunk at hand: its place, where its texels are, and what an allocation costs.
const CHUNK_BYTES: u64 = 96;

/// A TIFF picture.
#[derive(Debug)]
pub(crate) struct TiffImage {
    path: PathBuf,
    info: ImageInfo,
    table: Table,
    map: Option<[f64; 6]>,
    crs: CrsSaid,
    mask: Option<TiffMask>,
    orientation: Orientation,
    /// Bits in use of 16, once they were looked for or said.
    bits: OnceLock<u32>,
}

impl TiffImage {
    /// Reads the directory of the first full-resolution image.
    pub(crate) fn open(path: &Path, options: &PictureOptions) -> Result<Self, LayoutError> {
        let mut file = tags::TiffFile::open(path)?;
        let directory = file.first_full_image()?;
        let table = Table::read(&mut file, &directory, options)?;
        let place = geokeys::read(&mut file, &directory)?;
        let mask = match file.mask_of([table.grid.width, table.grid.height])? {
            Some(directory) => Some(TiffMask::of(&mut file, &directory)?),
            None => None,
        };
        let orientation = Orientation::of_tag(file.number(&directory, tags::ORIENTATION)?.unwrap_or(1));
        let info = ImageInfo {
            texels: [table.grid.width, table.grid.height],
            georeference: Georeference::default(),
            format: format!("{}{}", if file.is_big() { "BigTIFF" } else { "TIFF" }, table.describe()),
            notes: table.notes.iter().cloned().chain(place.warnings.into_iter().map(|w| w.words)).collect(),
            memory_bytes: memory_bytes(&table, options.stretch.is_some() && !table.has_bytes()),
        };
        Ok(Self {
            path: path.to_owned(),
            info,
            table,
            map: place.map,
            crs: place.crs,
            mask,
            orientation,
            bits: OnceLock::new(),
        })
    }
}

impl Picture for TiffImage {
    fn said(&self) -> (Option<[f64; 6]>, CrsSaid) {
        (self.map, self.crs.clone())
    }

    fn mask(&self) -> Option<&dyn Reader> {
        self.mask.as_ref().map(|mask| mask as &dyn Reader)
    }

    fn orientation(&self) -> Orientation {
        self.orientation
    }

    fn has_bytes(&self) -> bool {
        self.table.has_bytes()
    }

    fn bits(&self) -> Result<u32, LayoutError> {
        if self.has_bytes() || !self.has_light() {
            return Ok(8);
        }
        if let Some(bits) = self.bits.get() {
            return Ok(*bits);
        }
        let bits = bits_of(self.peak()?);
        Ok(*self.bits.get_or_init(|| bits))
    }

    fn use_bits(&mut self, bits: u32) {
        self.bits = OnceLock::from(bits);
    }

    fn byte_of(&self, number: f64) -> Option<u8> {
        self.table.shown(number)
    }

    fn colours(&self) -> usize {
        if matches!(self.table.paint, Paint::Grey | Paint::InverseGrey) { 1 } else { 3 }
    }

    fn has_chosen_bands(&self) -> bool {
        true
    }

    fn numbers(&self) -> Result<Option<Box<dyn NumberRows + '_>>, LayoutError> {
        // Places in a palette and inks are no numbers of light.
        if self.has_bytes() || !self.has_light() {
            return Ok(None);
        }
        Ok(Some(Box::new(self.begin::<Numbers>(8)?)))
    }

    fn limits(&self) -> Option<[i32; 2]> {
        if self.has_light() { self.table.samples.limits() } else { Some([0, 255]) }
    }

    fn is_inverse(&self) -> bool {
        matches!(self.table.paint, Paint::InverseGrey) && !self.has_bytes()
    }
}

/// Memory for the chunks at hand, what is known of each, and the work on as many as there are threads.
fn memory_bytes(table: &Table, as_numbers: bool) -> u64 {
    let texel_bytes = if as_numbers { size_of::<Numbers>() as u64 } else { 4 };
    let chunks = u64::from(group_chunks(table)) * u64::from(table.grid.across);
    let texels = u64::from(table.grid.chunk_width) * u64::from(table.grid.chunk_height);
    let threads = (rayon::current_num_threads() as u64).min(chunks);
    chunks
        .saturating_mul(texels.saturating_mul(texel_bytes).saturating_add(CHUNK_BYTES))
        .saturating_add(table.worker_bytes().saturating_mul(threads))
}

/// Rows of chunks unpacked at once.
fn group_chunks(table: &Table) -> u32 {
    GROUP_ROWS.div_ceil(table.grid.chunk_height).min(table.grid.height.div_ceil(table.grid.chunk_height))
}

impl ImageSource for TiffImage {
    fn path(&self) -> &Path {
        &self.path
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        Ok(Box::new(self.begin::<[u8; 4]>(self.bits()?)?))
    }
}

/// What samples become.
trait Texel: Copy + Default + Send + Sync {
    /// Of the samples of a chunk, so many channels a texel, which make use of so many bits.
    fn paint(table: &Table, samples: &[u8], channels: usize, bits: u32, texels: &mut [Self]);
}

impl Texel for [u8; 4] {
    fn paint(table: &Table, samples: &[u8], channels: usize, bits: u32, texels: &mut [Self]) {
        table.channels.paint(&table.paint, &table.samples, samples, channels, bits, texels);
    }
}

impl Texel for Numbers {
    fn paint(table: &Table, samples: &[u8], channels: usize, _: u32, texels: &mut [Self]) {
        table.channels.numbers(&table.samples, samples, channels, texels);
    }
}

/// Rows as they are asked for, from the chunks at hand.
struct Rows<'i, T> {
    image: &'i TiffImage,
    file: File,
    y: u32,
    /// First chunk at hand.
    first_chunk: u32,
    /// Their texels, `chunk_width` a row.
    chunks: Vec<Vec<T>>,
    /// Bits in use.
    bits: u32,
}

impl RowReader for Rows<'_, [u8; 4]> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        self.fill(rgba.as_chunks_mut::<4>().0)
    }
}

impl NumberRows for Rows<'_, Numbers> {
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError> {
        self.fill(texels)
    }
}

impl<T: Texel> Rows<'_, T> {
    fn fill(&mut self, texels: &mut [T]) -> Result<(), LayoutError> {
        let table = &self.image.table;
        let pitch = table.grid.chunk_width as usize;
        for row in texels.chunks_exact_mut(table.grid.width as usize) {
            let wanted = self.y / table.grid.chunk_height * table.grid.across;
            if !(self.first_chunk..self.first_chunk + self.chunks.len() as u32).contains(&wanted) {
                self.unpack(wanted)?;
            }
            let at = (self.y % table.grid.chunk_height) as usize * pitch;
            let first = (wanted - self.first_chunk) as usize;
            for (part, chunk) in row.chunks_mut(pitch).zip(&self.chunks[first..]) {
                part.copy_from_slice(&chunk[at..at + part.len()]);
            }
            self.y += 1;
        }
        Ok(())
    }

    fn unpack(&mut self, first: u32) -> Result<(), LayoutError> {
        let table = &self.image.table;
        let end = (table.grid.count() as u32).min(first + group_chunks(table) * table.grid.across);
        self.chunks.resize((end - first) as usize, Vec::new());
        let (image, bits) = (self.image, self.bits);
        let file = &self.file;
        let mut places = table.grid.places(&image.path, file);
        let places: Vec<ChunkPlaces> =
            (first..end).map(|chunk| image.places(chunk, &mut places)).collect::<Result<_, LayoutError>>()?;
        self.chunks
            .par_iter_mut()
            .zip(places)
            .map_init(Scratch::default, |scratch, (texels, places)| {
                let paint = |samples: &[u8], channels: usize, texels: &mut [T]| {
                    T::paint(table, samples, channels, bits, texels);
                };
                image.unpack(file, &places, scratch, texels, &paint)
            })
            .collect::<Result<(), LayoutError>>()?;
        self.first_chunk = first;
        Ok(())
    }
}

/// What is done with the samples of a chunk, so many channels a texel: texels are made of them.
type Paints<'a, T> = dyn Fn(&[u8], usize, &mut [T]) + 'a;

/// A chunk, and where it lies in the file: that of each plane that is read.
struct ChunkPlaces {
    chunk: u32,
    planes: Vec<Option<(u64, u64)>>,
}

#[derive(Default)]
struct Scratch {
    packed: Vec<u8>,
    bytes: Vec<u8>,
    widened: Vec<u8>,
    joined: Vec<u8>,
}

impl TiffImage {
    /// Whether its samples are amounts of light.
    fn has_light(&self) -> bool {
        !matches!(self.table.paint, Paint::Palette(_) | Paint::Cmyk)
    }

    /// The first row is next.
    fn begin<T: Texel>(&self, bits: u32) -> Result<Rows<'_, T>, LayoutError> {
        let file = input::open(&self.path, "cannot open the TIFF file")?;
        Ok(Rows { image: self, file, y: 0, first_chunk: 0, chunks: Vec::new(), bits })
    }

    fn places(&self, chunk: u32, places: &mut Places<'_>) -> Result<ChunkPlaces, LayoutError> {
        let planes = &self.table.planes;
        let planes = if planes.is_empty() { &[0][..] } else { planes };
        let planes = planes.iter().map(|plane| self.table.place(*plane, u64::from(chunk), places));
        Ok(ChunkPlaces { chunk, planes: planes.collect::<Result<_, _>>()? })
    }

    /// The largest number of the colours, of the whole picture.
    fn peak(&self) -> Result<u16, LayoutError> {
        let table = &self.table;
        let file = input::open(&self.path, "cannot open the TIFF file")?;
        let found = AtomicU16::new(0);
        (0..table.grid.count() as u32).into_par_iter().try_for_each_init(
            || (Scratch::default(), Vec::<[u8; 4]>::new(), table.grid.places(&self.path, &file)),
            |(scratch, texels, places), chunk| {
                let places = self.places(chunk, places)?;
                let look = |samples: &[u8], channels: usize, _: &mut [[u8; 4]]| {
                    let peak = table.channels.peak_of(&table.samples, samples, channels);
                    found.fetch_max(peak, Ordering::Relaxed);
                };
                self.unpack(&file, &places, scratch, texels, &look)
            },
        )?;
        Ok(found.into_inner())
    }

    /// One chunk: `paint` makes texels of its samples.
    fn unpack<T: Texel>(
        &self,
        file: &File,
        places: &ChunkPlaces,
        scratch: &mut Scratch,
        texels: &mut Vec<T>,
        paint: &Paints<'_, T>,
    ) -> Result<(), LayoutError> {
        let table = &self.table;
        let rows = table.grid.window(u64::from(places.chunk)).height;
        let count = table.grid.chunk_width as usize * rows as usize;
        texels.resize(count, T::default());
        if places.planes.iter().all(Option::is_none) {
            texels.fill(T::default());
            return Ok(());
        }
        let size = table.samples.bytes();
        for (at, place) in places.planes.iter().enumerate() {
            let channels = match place {
                Some(place) => self.unpack_plane(file, places.chunk, rows, *place, scratch)?,
                None => {
                    scratch.bytes.clear();
                    scratch.bytes.resize(count * size, 0);
                    1
                }
            };
            if table.planes.is_empty() {
                paint(&scratch.bytes, channels, texels);
                return Ok(());
            }
            let pixel = size * table.planes.len();
            scratch.joined.resize(count * pixel, 0);
            let pixels = scratch.joined.chunks_exact_mut(pixel).zip(scratch.bytes.chunks_exact(size));
            pixels.for_each(|(to, from)| to[at * size..(at + 1) * size].copy_from_slice(from));
        }
        paint(&scratch.joined, table.planes.len(), texels);
        Ok(())
    }

    /// The samples of a chunk of one plane, into `scratch.bytes`. Gives how many lie side by side.
    fn unpack_plane(
        &self,
        file: &File,
        chunk: u32,
        rows: u32,
        (at, length): (u64, u64),
        scratch: &mut Scratch,
    ) -> Result<usize, LayoutError> {
        let table = &self.table;
        let name = || table.grid.name(u64::from(chunk));
        // The table's check has shown that the file is this long.
        scratch.packed.resize(length as usize, 0);
        read_at(file, &mut scratch.packed, at).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                &self.path,
                name(),
                "the file was cut short while it was read; start again",
            ),
            _ => LayoutError::io(&self.path, "cannot read the TIFF file", e),
        })?;
        turn_bits(&mut scratch.packed, table.is_reversed);
        let damaged = |problem: String| {
            LayoutError::damaged(&self.path, name(), format!("{problem}; fetch or write the file again"))
        };
        guard(&self.path, name, || match &table.packing {
            Packing::Jpeg { .. } | Packing::Webp | Packing::Jpeg2000 | Packing::JpegXl => {
                let packed = &scratch.packed;
                let (bytes, channels) = colour_codecs::decode(table, packed, rows).map_err(damaged)?;
                scratch.bytes = bytes;
                Ok(channels)
            }
            Packing::Bytes(compression) => {
                let stride = table.row_bytes() as usize;
                let wide = table.grid.chunk_width;
                let stored =
                    table.chroma.map_or(stride * rows as usize, |chroma| chroma.stored_bytes(wide, rows));
                scratch.bytes.resize(stored, 0);
                let whole = stride * table.grid.chunk_height as usize;
                codec::unpack(*compression, &scratch.packed, &mut scratch.bytes, whole).map_err(
                    |failure| match failure {
                        failure::Failure::Damaged(problem) => damaged(problem),
                        failure::Failure::Io(source) => {
                            LayoutError::io(&self.path, "cannot read the TIFF file", source)
                        }
                    },
                )?;
                let (samples, bands) = (&table.samples, table.side_by_side() as usize);
                let (size, is_big) = (samples.bits() / 8, samples.is_big_endian());
                match table.predictor {
                    Predictor::None => {}
                    Predictor::Horizontal => {
                        predictor::horizontal(&mut scratch.bytes, stride, bands, size, is_big);
                    }
                    Predictor::Floating => {
                        let line = &mut scratch.widened;
                        predictor::floating(&mut scratch.bytes, stride, bands, size, is_big, line);
                    }
                }
                if let Some(chroma) = table.chroma {
                    chroma.colours(&scratch.bytes, wide, rows, &mut scratch.widened);
                    std::mem::swap(&mut scratch.bytes, &mut scratch.widened);
                }
                if samples.odd.is_some() {
                    table.widen(&scratch.bytes, &mut scratch.widened);
                    std::mem::swap(&mut scratch.bytes, &mut scratch.widened);
                }
                Ok(bands)
            }
        })
    }
}
