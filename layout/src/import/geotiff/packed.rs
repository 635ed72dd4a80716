//! Decodes compressed chunks with the `tiff` crate, one decoder a worker.
//!
//! A chunk is decoded whole into bytes in native order and pushed in windows of a few rows. The number
//! of workers is limited so that the chunks in memory stay below a gibibyte together.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use tiff::TiffError;
use tiff::decoder::{Decoder, Limits};

use super::super::guard::guard;
use super::super::parallel::each_task;
use super::chunks::Chunks;
use super::convert::Void;
use super::{parts, put_constant, rows_at_once};
use crate::dem::SampleSink;
use crate::error::LayoutError;

/// Memory for decoded chunks, all workers together.
const BUDGET_BYTES: u64 = 1 << 30;

struct Worker {
    decoder: Decoder<BufReader<File>>,
    bytes: Vec<u8>,
    samples: Vec<f64>,
}

/// Pushes every sample of the image once.
pub(super) fn stream(
    path: &Path,
    chunks: &Chunks,
    void: &Void,
    sink: &dyn SampleSink,
) -> Result<(), LayoutError> {
    let workers = usize::try_from(BUDGET_BYTES / chunks.decoded_bytes().max(1)).unwrap_or(usize::MAX);
    each_task(
        chunks.count(),
        workers,
        || open(path, chunks),
        |worker, chunk| {
            let window = chunks.window(chunk);
            if chunks.place(chunk).is_none() {
                return put_constant(sink, window, void.absent());
            }
            let row_bytes = u64::from(window.width) * chunks.sample_bytes();
            // At most MAX_CHUNK_BYTES, and no more than the packed bytes can become: the table's check has shown it.
            worker.bytes.resize((row_bytes * u64::from(window.height)) as usize, 0);
            let number = u32::try_from(chunk)
                .map_err(|_| LayoutError::unsupported(path, "it has more than 2^32 chunks"))?;
            // The decoder asserts what a damaged file may break; a panic is damage in this chunk.
            guard(
                path,
                || chunks.name(chunk),
                || {
                    let decoded = worker.decoder.read_chunk_bytes(number, &mut worker.bytes);
                    decoded.map_err(|error| decoding_error(path, chunks.name(chunk), error))
                },
            )?;
            if chunks.inverted {
                worker.bytes.iter_mut().for_each(|byte| *byte = !*byte);
            }
            let native = cfg!(target_endian = "big");
            let mut rest = worker.bytes.as_slice();
            for part in parts(window, rows_at_once(window.width)) {
                let (bytes, after) = rest.split_at((row_bytes * u64::from(part.height)) as usize);
                rest = after;
                worker.samples.clear();
                void.append(chunks.sample_type, native, bytes, &mut worker.samples);
                sink.put(part, &worker.samples)?;
            }
            Ok(())
        },
    )
}

/// A decoder standing at the image.
fn open(path: &Path, chunks: &Chunks) -> Result<Worker, LayoutError> {
    let file =
        File::open(path).map_err(|source| LayoutError::io(path, "cannot open the TIFF file", source))?;
    let place = || "tag directory".to_owned();
    guard(path, place, || {
        let decoder = Decoder::new(BufReader::with_capacity(1 << 16, file));
        let mut limits = Limits::default();
        // Packed chunks are checked to lie in the file; incompressible ones are a little larger than unpacked.
        limits.intermediate_buffer_size = usize::try_from(BUDGET_BYTES).unwrap_or(usize::MAX);
        let mut decoder = decoder.map_err(|error| decoding_error(path, place(), error))?.with_limits(limits);
        if chunks.image > 0 {
            decoder.seek_to_image(chunks.image).map_err(|error| decoding_error(path, place(), error))?;
        }
        let size = decoder.dimensions().map_err(|error| decoding_error(path, place(), error))?;
        if size != (chunks.width, chunks.height) || decoder.chunk_dimensions().0 != chunks.chunk_width {
            return Err(LayoutError::damaged(
                path,
                place(),
                "the file changed while it was read; start again",
            ));
        }
        Ok(Worker { decoder, bytes: Vec::new(), samples: Vec::new() })
    })
}

fn decoding_error(path: &Path, place: String, error: TiffError) -> LayoutError {
    match error {
        TiffError::IoError(source) if source.raw_os_error().is_some() => {
            LayoutError::io(path, "cannot read the TIFF file", source)
        }
        TiffError::UnsupportedError(what) => LayoutError::unsupported(
            path,
            format!("{what}; convert it: gdal_translate -co TILED=YES -co COMPRESS=DEFLATE INPUT output.tif"),
        ),
        error => LayoutError::damaged(path, place, format!("{error}; fetch or write the file again")),
    }
}
