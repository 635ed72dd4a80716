//! ZSTD by its C library.

use std::io::BufRead;
use zstd::stream::raw::{DParameter, Decoder, InBuffer, Operation, OutBuffer};

use super::failure::{Failure, damaged};

/// A stream of frames on its way.
pub(super) struct Stream {
    decoder: Decoder<'static>,
}

impl Stream {
    /// Refuses, when it comes to it, a frame that needs a window of more than `window` bytes.
    pub(super) fn new(window: u64) -> Result<Self, Failure> {
        let mut decoder = Decoder::new()?;
        decoder.set_parameter(DParameter::WindowLogMax(window.max(1).ilog2().clamp(10, 27)))?;
        Ok(Self { decoder })
    }

    /// Takes from `input` and puts into `unpacked`; gives the bytes written, none where the input has ended.
    pub(super) fn fill(&mut self, input: &mut impl BufRead, unpacked: &mut [u8]) -> Result<usize, Failure> {
        loop {
            let (mut packed, mut unpacked) =
                (InBuffer::around(input.fill_buf()?), OutBuffer::around(&mut *unpacked));
            // At a frame's end the next one begins.
            self.decoder
                .run(&mut packed, &mut unpacked)
                .map_err(|_| damaged("its ZSTD stream is damaged"))?;
            let (read, written) = (packed.pos(), unpacked.pos());
            input.consume(read);
            if written > 0 || read == 0 {
                return Ok(written);
            }
        }
    }
}

/// Unpacks the first frame of `packed` into `unpacked`, which has room for all of it, without a window. Gives the bytes of it; `None` if it is damaged.
pub(super) fn unpack_frame(packed: &[u8], unpacked: &mut [u8]) -> Option<usize> {
    // Writers may leave something behind the frame.
    let length = zstd::zstd_safe::find_frame_compressed_size(packed).ok()?;
    let mut decoder = zstd::bulk::Decompressor::new().ok()?;
    decoder.decompress_to_buffer(packed.get(..length)?, unpacked).ok()
}
