//! ZSTD in plain Rust, for programs without a C compiler: the same frames, windows and refusals as by the library.
//!
//! Blocks are unpacked one by one. So a few bytes that unpack to very many take no more memory than a block of 128 KiB beside the window.

use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::io::{self, BufRead, Read};

use super::failure::{Failure, damaged};

/// A stream of frames on its way.
pub(super) struct Stream {
    window: u64,
    /// The frame that is under way.
    frame: Option<Box<FrameDecoder>>,
}

impl Stream {
    /// Refuses, when it comes to it, a frame that needs a window of more than `window` bytes.
    #[cfg_attr(test, allow(clippy::unnecessary_wraps, reason = "the library's can fail"))]
    pub(super) fn new(window: u64) -> Result<Self, Failure> {
        Ok(Self { window: 1 << window.max(1).ilog2().clamp(10, 27), frame: None })
    }

    /// Takes from `input` and puts into `unpacked`; gives the bytes written, none where the input has ended.
    pub(super) fn fill(&mut self, input: &mut impl BufRead, unpacked: &mut [u8]) -> Result<usize, Failure> {
        let mut input = Noted { input, failed: None, is_over: false };
        loop {
            let step = self.step(&mut input, unpacked);
            if let Some(error) = input.failed.take() {
                return Err(error.into());
            }
            match step {
                Ok(0) => {}
                Ok(written) => return Ok(written),
                // Whoever asked for more says how much is missing.
                Err(()) if input.is_over => return Ok(0),
                Err(()) => return Err(damaged("its ZSTD stream is damaged")),
            }
        }
    }

    /// What is ready, or a head or a block more.
    fn step(&mut self, input: &mut Noted<'_, impl BufRead>, unpacked: &mut [u8]) -> Result<usize, ()> {
        let Some(frame) = &mut self.frame else {
            self.frame = begin(input, self.window)?;
            return Ok(0);
        };
        let written = frame.read(unpacked).map_err(drop)?;
        if written > 0 {
            return Ok(written);
        }
        if frame.is_finished() {
            check_sum(frame)?;
            self.frame = None;
            return Ok(0);
        }
        frame.decode_blocks(input, BlockDecodingStrategy::UptoBlocks(1)).map_err(drop)?;
        Ok(0)
    }
}

/// Reads a frame's head; `None` for a frame that holds nothing of the stream, which is passed over.
fn begin(input: &mut impl Read, window: u64) -> Result<Option<Box<FrameDecoder>>, ()> {
    let mut frame = Box::new(FrameDecoder::new());
    frame.set_max_window_size(window);
    match frame.init(&mut *input) {
        Ok(()) => Ok(Some(frame)),
        Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame { length, .. })) => {
            let passed = io::copy(&mut input.take(u64::from(length)), &mut io::sink()).map_err(drop)?;
            if passed < u64::from(length) { Err(()) } else { Ok(None) }
        }
        Err(_) => Err(()),
    }
}

fn check_sum(frame: &FrameDecoder) -> Result<(), ()> {
    let stated = frame.get_checksum_from_data();
    if stated.is_some() && stated != frame.get_calculated_checksum() { Err(()) } else { Ok(()) }
}

/// Unpacks the first frame of `packed` into `unpacked`, which has room for all of it, without a window. Gives the bytes of it; `None` if it is damaged.
pub(super) fn unpack_frame(mut packed: &[u8], unpacked: &mut [u8]) -> Option<usize> {
    let mut frame = loop {
        if let Some(frame) = begin(&mut packed, u64::MAX).ok()? {
            break frame;
        }
    };
    while !frame.is_finished() {
        frame.decode_blocks(&mut packed, BlockDecodingStrategy::UptoBlocks(1)).ok()?;
        // The window it names may be far larger than the frame, so that nothing may be taken before its end.
        if frame.can_collect() > unpacked.len() {
            return None;
        }
    }
    let mut written = 0;
    loop {
        match frame.read(&mut unpacked[written..]).ok()? {
            0 => break,
            more => written += more,
        }
    }
    if frame.can_collect() > 0 {
        return None;
    }
    check_sum(&frame).ok()?;
    Some(written)
}

/// An input that tells its end and its failures from damage.
struct Noted<'i, R> {
    input: &'i mut R,
    failed: Option<io::Error>,
    is_over: bool,
}

impl<R: BufRead> Read for Noted<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.input.read(buffer) {
            Ok(read) => {
                self.is_over |= read == 0 && !buffer.is_empty();
                Ok(read)
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Err(error),
            Err(error) => {
                let kind = error.kind();
                self.failed = Some(error);
                Err(kind.into())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, Write};

    fn packed(level: i32, bytes: &[u8], sum: bool) -> Vec<u8> {
        let mut encoder = zstd::Encoder::new(Vec::new(), level).unwrap();
        encoder.include_checksum(sum).unwrap();
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    /// All that a stream holds, or why not, pieces of the input and the output as small as may be.
    fn streamed(packed: &[u8], window: u64) -> Result<Vec<u8>, Failure> {
        let mut input = BufReader::with_capacity(7, packed);
        let mut stream = Stream::new(window)?;
        let (mut all, mut piece) = (Vec::new(), [0; 1000]);
        loop {
            match stream.fill(&mut input, &mut piece)? {
                0 => return Ok(all),
                read => all.extend_from_slice(&piece[..read]),
            }
        }
    }

    fn ground(count: u32) -> Vec<u8> {
        (0..count).map(|i| (i.wrapping_mul(i) / 997 + i / 5000) as u8).collect()
    }

    #[test]
    fn what_the_library_packs_comes_back() {
        for (level, count) in [(1, 0), (3, 1), (3, 300), (9, 200_000), (19, 1_000_000)] {
            let bytes = ground(count);
            for sum in [false, true] {
                let packed = packed(level, &bytes, sum);
                assert_eq!(streamed(&packed, 1 << 27).unwrap(), bytes);
                let mut whole = vec![0; bytes.len()];
                assert_eq!(unpack_frame(&packed, &mut whole), Some(bytes.len()));
                assert_eq!(whole, bytes);
            }
        }
    }

    #[test]
    fn frames_follow_frames_and_some_hold_nothing() {
        let (one, two) = (ground(5000), ground(70_000));
        let skipped = [&0x184d_2a53u32.to_le_bytes()[..], &3u32.to_le_bytes(), b"abc"].concat();
        let all = [skipped.clone(), packed(3, &one, false), skipped, packed(3, &two, true)].concat();
        assert_eq!(streamed(&all, 1 << 27).unwrap(), [one.clone(), two].concat());
        let mut first = vec![0; one.len()];
        assert_eq!(unpack_frame(&all, &mut first), Some(one.len()));
        assert_eq!(unpack_frame(&all, &mut first[1..]), None, "no room");
    }

    #[test]
    fn wrong_sums_wide_windows_and_other_bytes_are_refused() {
        let bytes = ground(50_000);
        let mut wrong = packed(3, &bytes, true);
        *wrong.last_mut().unwrap() ^= 1;
        assert!(matches!(streamed(&wrong, 1 << 27), Err(Failure::Damaged(_))));
        assert_eq!(unpack_frame(&wrong, &mut vec![0; 50_000]), None);
        let wide = packed(22, &bytes, false);
        assert!(matches!(streamed(&wide, 1 << 20), Err(Failure::Damaged(_))));
        assert!(matches!(streamed(b"no frame at all", 1 << 20), Err(Failure::Damaged(_))));
    }

    #[test]
    fn a_cut_stream_gives_what_it_has() {
        let bytes = ground(400_000);
        let packed = packed(3, &bytes, false);
        let got = streamed(&packed[..packed.len() / 2], 1 << 27).unwrap();
        assert!(got.len() < bytes.len() && bytes.starts_with(&got));
    }

    /// Whatever is changed in a stream, both say the same of it; where they differ in how much they give before they refuse, what they give is equal.
    #[test]
    #[cfg(feature = "zstd")]
    fn both_decoders_agree_on_damage() {
        use super::super::zstd_library;
        let bytes = ground(30_000);
        let whole = packed(3, &bytes, true);
        let mut differing = 0;
        for i in 0..whole.len().min(600) {
            let mut changed = whole.clone();
            changed[i] ^= 1 << (i % 8);
            let mut unpacked = [vec![0; 31_000], vec![0; 31_000]];
            let [plain, library] = &mut unpacked;
            let lengths = [unpack_frame(&changed, plain), zstd_library::unpack_frame(&changed, library)];
            differing += usize::from(lengths[0] != lengths[1] || lengths[0].is_some() && plain != library);
        }
        assert_eq!(differing, 0);
    }
}
