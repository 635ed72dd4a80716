//! GeoTIFF as pictures: grey, palette, RGB, with or without alpha, 8 bits a channel or 16 cut to them, JPEG-compressed chunks included.
//!
//! [`super::colour_table`] says where the chunks are and how they are packed; here they become rows. As many chunks as make one row of tiles, or some
//! 64 rows of strips, are unpacked in parallel and handed out row by row. Memory: those chunks, 4 bytes a texel.
//!
//! A texel whose channels all equal the declared void value is transparent, as is a chunk the file left out. A mask in an image of its own is handed on.

use super::colour_table::{Packing, Paint, Table};
use super::span::turn_bits;
use super::{TiffMask, codec, failure, geokeys, predictor, tags};
use crate::guard::guard;
use crate::input;
use crate::jpeg_frame::JpegFrame;
use crate::reader::{CrsSaid, Orientation, Picture, Reader, bits_of};
use jpeg_decoder::{ColorTransform, Decoder, PixelFormat};
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
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let mut file = tags::TiffFile::open(path)?;
        let directory = file.first_full_image()?;
        let table = Table::read(&mut file, &directory)?;
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
            notes: table.notes.clone(),
            memory_bytes: memory_bytes(&table),
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
        self.table.sample_bytes == 1
    }

    fn bits(&self) -> Result<u32, LayoutError> {
        if self.has_bytes() {
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
}

/// Memory for the chunks at hand, what is known of each, and the work on as many as there are threads.
fn memory_bytes(table: &Table) -> u64 {
    let chunks = u64::from(group_chunks(table)) * u64::from(table.grid.across);
    let texels = u64::from(table.grid.chunk_width) * u64::from(table.grid.chunk_height);
    let threads = (rayon::current_num_threads() as u64).min(chunks);
    chunks
        .saturating_mul(texels.saturating_mul(4).saturating_add(CHUNK_BYTES))
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
        let file = input::open(&self.path, "cannot open the TIFF file")?;
        Ok(Box::new(Rows { image: self, file, y: 0, first_chunk: 0, chunks: Vec::new(), bits: self.bits()? }))
    }
}

/// Rows as they are asked for, from the chunks at hand.
struct Rows<'i> {
    image: &'i TiffImage,
    file: File,
    y: u32,
    /// First chunk at hand.
    first_chunk: u32,
    /// Their texels, `chunk_width` a row.
    chunks: Vec<Vec<u8>>,
    /// Bits in use.
    bits: u32,
}

impl RowReader for Rows<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let table = &self.image.table;
        let pitch = table.grid.chunk_width as usize * 4;
        for row in rgba.chunks_exact_mut(table.grid.width as usize * 4) {
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
}

impl Rows<'_> {
    fn unpack(&mut self, first: u32) -> Result<(), LayoutError> {
        let table = &self.image.table;
        let end = (table.grid.count() as u32).min(first + group_chunks(table) * table.grid.across);
        self.chunks.resize((end - first) as usize, Vec::new());
        let (image, bits) = (self.image, self.bits);
        let file = &self.file;
        let mut places = table.grid.places(&image.path, file);
        let places: Vec<Option<(u64, u64)>> = (first..end)
            .map(|chunk| table.place(u64::from(chunk), &mut places))
            .collect::<Result<_, LayoutError>>()?;
        self.chunks
            .par_iter_mut()
            .zip(first..end)
            .zip(places)
            .map_init(Scratch::default, |scratch, ((texels, chunk), place)| {
                let paint = |samples: &[u8], channels: usize, rgba: &mut [u8]| {
                    table.paint_chunk(samples, channels, bits, rgba);
                };
                image.unpack(file, (chunk, place), scratch, texels, &paint)
            })
            .collect::<Result<(), LayoutError>>()?;
        self.first_chunk = first;
        Ok(())
    }
}

/// What is done with the samples of a chunk, so many channels a texel: RGBA is made of them.
type Paints<'a> = dyn Fn(&[u8], usize, &mut [u8]) + 'a;

#[derive(Default)]
struct Scratch {
    packed: Vec<u8>,
    bytes: Vec<u8>,
}

impl TiffImage {
    /// The largest number of the colours, of the whole picture.
    fn peak(&self) -> Result<u16, LayoutError> {
        let table = &self.table;
        let file = input::open(&self.path, "cannot open the TIFF file")?;
        let found = AtomicU16::new(0);
        (0..table.grid.count() as u32).into_par_iter().try_for_each_init(
            || (Scratch::default(), Vec::new(), table.grid.places(&self.path, &file)),
            |(scratch, texels, places), chunk| {
                let place = table.place(u64::from(chunk), places)?;
                let look = |samples: &[u8], channels: usize, _: &mut [u8]| {
                    found.fetch_max(table.peak_of(samples, channels), Ordering::Relaxed);
                };
                self.unpack(&file, (chunk, place), scratch, texels, &look)
            },
        )?;
        Ok(found.into_inner())
    }

    /// One chunk from its place: `paint` makes RGBA of its samples.
    fn unpack(
        &self,
        file: &File,
        (chunk, place): (u32, Option<(u64, u64)>),
        scratch: &mut Scratch,
        texels: &mut Vec<u8>,
        paint: &Paints<'_>,
    ) -> Result<(), LayoutError> {
        let table = &self.table;
        let rows = table.grid.window(u64::from(chunk)).height;
        let count = table.grid.chunk_width as usize * rows as usize;
        texels.resize(count * 4, 0);
        let Some((at, length)) = place else {
            texels.fill(0);
            return Ok(());
        };
        // The table's check has shown that the file is this long.
        scratch.packed.resize(length as usize, 0);
        read_at(file, &mut scratch.packed, at).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                &self.path,
                table.grid.name(u64::from(chunk)),
                "the file was cut short while it was read; start again",
            ),
            _ => LayoutError::io(&self.path, "cannot read the TIFF file", e),
        })?;
        turn_bits(&mut scratch.packed, table.is_reversed);
        let damaged = |problem: String| {
            LayoutError::damaged(
                &self.path,
                table.grid.name(u64::from(chunk)),
                format!("{problem}; fetch or write the file again"),
            )
        };
        guard(
            &self.path,
            || table.grid.name(u64::from(chunk)),
            || match &table.packing {
                Packing::Jpeg { tables } => {
                    let image = join_tables(tables, &scratch.packed);
                    let (bytes, channels) = self.decode_jpeg(&image, rows).map_err(damaged)?;
                    paint(&bytes, channels, texels);
                    Ok(())
                }
                Packing::Bytes(compression) => {
                    let pixel = table.bands as usize * table.sample_bytes as usize;
                    scratch.bytes.resize(count * pixel, 0);
                    let whole = table.grid.chunk_width as usize * table.grid.chunk_height as usize * pixel;
                    codec::unpack(*compression, &scratch.packed, &mut scratch.bytes, whole).map_err(
                        |failure| match failure {
                            failure::Failure::Damaged(problem) => damaged(problem),
                            failure::Failure::Io(source) => {
                                LayoutError::io(&self.path, "cannot read the TIFF file", source)
                            }
                        },
                    )?;
                    if table.differences {
                        let stride = table.grid.chunk_width as usize * pixel;
                        predictor::horizontal(
                            &mut scratch.bytes,
                            stride,
                            table.bands as usize,
                            table.sample_bytes,
                            table.big_endian,
                        );
                    }
                    paint(&scratch.bytes, table.bands as usize, texels);
                    Ok(())
                }
            },
        )
    }

    fn decode_jpeg(&self, image: &[u8], rows: u32) -> Result<(Vec<u8>, usize), String> {
        let damaged = |_| "its JPEG stream is damaged".to_owned();
        // Reading from memory does not fail.
        let frame = JpegFrame::read(image).map_err(|_| "its JPEG stream is damaged".to_owned())?;
        frame.check()?;
        if frame.memory_bytes() > self.table.jpeg_bytes() {
            return Err("its JPEG stream is of another size or sampling than its tiles".into());
        }
        let mut decoder = Decoder::new(image);
        decoder.read_info().map_err(damaged)?;
        let Some(info) = decoder.info() else { return Err("its JPEG stream has no size".into()) };
        let size = (u32::from(info.width), u32::from(info.height));
        if size.0 != self.table.grid.chunk_width || size.1 < rows || size.1 > self.table.grid.chunk_height {
            return Err(format!("its JPEG stream is of {} x {} texels", size.0, size.1));
        }
        let channels = match info.pixel_format {
            PixelFormat::L8 => 1,
            PixelFormat::RGB24 => 3,
            _ => return Err("its JPEG stream has neither one nor three channels of 8 bits".into()),
        };
        let is_rgb = matches!(self.table.paint, Paint::Rgb);
        if channels != self.table.bands as usize {
            return Err(format!(
                "its JPEG stream has {channels} channels and the image {}",
                self.table.bands
            ));
        }
        if channels == 3 {
            decoder.set_color_transform(if is_rgb { ColorTransform::RGB } else { ColorTransform::YCbCr });
        }
        Ok((decoder.decode().map_err(damaged)?, channels))
    }
}

/// A stream that a decoder reads: the tables that all chunks share, without their end mark, and the chunk without its begin mark.
fn join_tables(tables: &[u8], chunk: &[u8]) -> Vec<u8> {
    match (tables.strip_suffix(&[0xff, 0xd9]), chunk.strip_prefix(&[0xff, 0xd8])) {
        (Some(tables), Some(chunk)) => [tables, chunk].concat(),
        _ => chunk.to_vec(),
    }
}
