//! Chunks that are pictures of their own: JPEG, WebP, JPEG 2000 and JPEG XL streams, decoded into samples side by side.
//!
//! What a stream declares is compared with the chunk before memory is taken for it. Cost: the decoder's.

use super::colour_paint::Samples;
use super::colour_table::{Packing, Table};
use crate::jpeg_frame::JpegFrame;
use crate::jpeg2000::{self, Header, Source, Stream};
use crate::jxl::{self, Depth};
use crate::webp::{self, Frame};
use jpeg_decoder::{ColorTransform, Decoder, PixelFormat};
use std::io::Cursor;
use terrasoar_layout::dem::SampleType;

/// The samples of a chunk of which `rows` rows are wanted, and how many lie side by side; or what is wrong with it.
pub(super) fn decode(table: &Table, packed: &[u8], rows: u32) -> Result<(Vec<u8>, usize), String> {
    match &table.packing {
        Packing::Jpeg { tables } => jpeg(table, &join_tables(tables, packed), rows),
        Packing::Webp => webp(table, packed, rows),
        Packing::JpegXl => jpeg_xl(table, packed, rows),
        _ => jpeg_2000(table, packed, rows),
    }
}

/// Whether a stream of a size is one of a chunk.
fn is_of_chunk(table: &Table, [wide, high]: [u32; 2], rows: u32) -> Result<(), String> {
    match wide == table.grid.chunk_width && (rows..=table.grid.chunk_height).contains(&high) {
        true => Ok(()),
        false => Err(format!("its stream is of {wide} x {high} texels")),
    }
}

fn webp(table: &Table, packed: &[u8], rows: u32) -> Result<(Vec<u8>, usize), String> {
    let damaged = |_| "its WebP stream is damaged".to_owned();
    let frame = Frame::read(Cursor::new(packed)).map_err(damaged)?;
    is_of_chunk(table, frame.size, rows)?;
    let texels = webp::decode(Cursor::new(packed), &frame).map_err(damaged)?;
    let (channels, wanted) = (frame.channels(), table.bands as usize);
    if channels == wanted {
        return Ok((texels, wanted));
    }
    // What has no transparent texel may be stored without alpha.
    let full = [255; 4];
    let texel = |texel: &[u8]| {
        let mut whole = full;
        whole[..channels].copy_from_slice(texel);
        whole
    };
    Ok((texels.chunks_exact(channels).flat_map(|t| texel(t).into_iter().take(wanted)).collect(), wanted))
}

fn jpeg_2000(table: &Table, packed: &[u8], rows: u32) -> Result<(Vec<u8>, usize), String> {
    let damaged = |_| "its JPEG 2000 stream is damaged or of an unusual kind".to_owned();
    let source = Source::Memory(packed);
    let stream = Stream::read(source, 0, packed.len() as u64).map_err(damaged)?;
    is_of_chunk(table, stream.texels(), rows)?;
    let wanted = table.side_by_side() as usize;
    if stream.channels() != wanted {
        return Err(format!("its stream has {} channels and the image {wanted}", stream.channels()));
    }
    if stream.tile_bytes() > table.picture_bytes() + 2 * packed.len() as u64 {
        return Err("its stream takes more memory than a chunk should".into());
    }
    let (samples, wide) = (&table.samples, table.grid.chunk_width as usize);
    let pixel = wanted * samples.bytes();
    let mut bytes = vec![0; wide * stream.texels()[1] as usize * pixel];
    for tile in 0..stream.tiles()[0] * stream.tiles()[1] {
        let channels = jpeg2000::decode_tile(source, &stream, tile, &Header::default()).map_err(damaged)?;
        if channels.len() != wanted {
            return Err("its stream has other channels than the image".into());
        }
        let [left, top] = stream.tile_at(tile).map(|at| at as usize);
        let across = stream.tile_size(tile)[0] as usize;
        for (band, (values, _)) in channels.iter().enumerate() {
            for (row, line) in values.chunks_exact(across).enumerate() {
                for (col, value) in line.iter().enumerate() {
                    let at = ((top + row) * wide + left + col) * pixel + band * samples.bytes();
                    put(samples, *value, &mut bytes[at..]);
                }
            }
        }
    }
    Ok((bytes, wanted))
}

fn jpeg_xl(table: &Table, packed: &[u8], rows: u32) -> Result<(Vec<u8>, usize), String> {
    let depth = match (table.samples.sample_type, table.samples.odd) {
        (SampleType::U8, None) => Depth::Whole(8),
        (SampleType::U16, None) => Depth::Whole(16),
        (SampleType::F32, None) => Depth::Real(32),
        _ => return Err("its samples are of a type that JPEG XL does not have".into()),
    };
    let channels = table.side_by_side() as usize;
    let size = [table.grid.chunk_width, table.grid.chunk_height, rows];
    // The bytes of a big-endian file were packed as if they were little-endian, so they come out in the file's order.
    let bytes = jxl::chunk(packed, size, channels, depth).map_err(|trouble| match trouble {
        jxl::Trouble::Io(_) => "its JPEG XL stream is cut short".to_owned(),
        jxl::Trouble::Damaged(problem) | jxl::Trouble::Unsupported(problem) => problem.to_owned(),
    })?;
    Ok((bytes, channels))
}

/// A whole number as the file would have it without compression.
fn put(samples: &Samples, value: f32, bytes: &mut [u8]) {
    match (samples.sample_type, samples.is_big_endian()) {
        (SampleType::U8, _) => bytes[0] = value as u8,
        (_, true) => bytes[..2].copy_from_slice(&(value as u16).to_be_bytes()),
        (_, false) => bytes[..2].copy_from_slice(&(value as u16).to_le_bytes()),
    }
}

fn jpeg(table: &Table, image: &[u8], rows: u32) -> Result<(Vec<u8>, usize), String> {
    let damaged = |_| "its JPEG stream is damaged".to_owned();
    // Reading from memory does not fail.
    let frame = JpegFrame::read(image).map_err(|_| "its JPEG stream is damaged".to_owned())?;
    frame.check()?;
    if frame.memory_bytes() > table.picture_bytes() {
        return Err("its JPEG stream is of another size or sampling than its tiles".into());
    }
    let mut decoder = Decoder::new(image);
    decoder.read_info().map_err(damaged)?;
    let Some(info) = decoder.info() else { return Err("its JPEG stream has no size".into()) };
    let size = (u32::from(info.width), u32::from(info.height));
    if size.0 != table.grid.chunk_width || size.1 < rows || size.1 > table.grid.chunk_height {
        return Err(format!("its JPEG stream is of {} x {} texels", size.0, size.1));
    }
    let channels = match info.pixel_format {
        PixelFormat::L8 => 1,
        PixelFormat::RGB24 => 3,
        _ => return Err("its JPEG stream has neither one nor three channels of 8 bits".into()),
    };
    let declared = table.side_by_side();
    if channels as u64 != declared {
        return Err(format!("its JPEG stream has {channels} channels and the image {declared}"));
    }
    if channels == 3 {
        decoder.set_color_transform(if table.is_rgb { ColorTransform::RGB } else { ColorTransform::YCbCr });
    }
    Ok((decoder.decode().map_err(damaged)?, channels))
}

/// A stream that a decoder reads: the tables that all chunks share, without their end mark, and the chunk without its begin mark.
fn join_tables(tables: &[u8], chunk: &[u8]) -> Vec<u8> {
    match (tables.strip_suffix(&[0xff, 0xd9]), chunk.strip_prefix(&[0xff, 0xd8])) {
        (Some(tables), Some(chunk)) => [tables, chunk].concat(),
        _ => chunk.to_vec(),
    }
}
