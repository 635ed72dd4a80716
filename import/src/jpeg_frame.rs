//! What a JPEG stream declares, read marker by marker before anything is decoded: size, sampling, scans.
//!
//! A picture may come in any number of scans. For each of them the decoder goes through the whole picture, even if the scan has a few bytes. The memory that it takes follows from
//! size and sampling alone. Both are known here before the decoder sees a byte (ITU-T T.81, annex B). Cost: one pass over the bytes.

use crate::jpeg_rows::Shape;
use std::io::BufRead;

/// Scans that any picture may have. Encoders make some ten, one a coefficient and component at the very most.
const FEW_SCANS: u64 = 32;
/// Scans that a small picture may have.
const MANY_SCANS: u64 = 100;
/// Texels times scans up to which a picture is small.
const SMALL_WORK: u64 = 1 << 31;
/// Segments that a colour profile may be cut into.
const MAX_PROFILE_SEGMENTS: u64 = 255;

/// Marks of T.81, table B.1.
const SOI: u8 = 0xd8;
const EOI: u8 = 0xd9;
const SOS: u8 = 0xda;
const APP2: u8 = 0xe2;
const TEM: u8 = 0x01;

/// The frame of a JPEG stream.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct JpegFrame {
    /// Width and height in texels.
    size: [u64; 2],
    /// Horizontal and vertical sampling of each component.
    sampling: Vec<[u64; 2]>,
    is_progressive: bool,
    scans: u64,
    profile_segments: u64,
}

impl JpegFrame {
    /// Reads the markers of `input` up to the end of the image, or of the input; a stream without a frame is empty.
    pub(crate) fn read(mut input: impl BufRead) -> std::io::Result<Self> {
        let mut frame = Self::default();
        while let Some(marker) = next_marker(&mut input)? {
            match marker {
                EOI => break,
                TEM | SOI | 0xd0..=0xd7 => continue,
                SOS => {
                    frame.scans += 1;
                    if frame.scans > MANY_SCANS {
                        // More need not be known.
                        break;
                    }
                }
                _ => {}
            }
            let Some(segment) = segment(&mut input)? else { break };
            match marker {
                APP2 if segment.starts_with(b"ICC_PROFILE\0") => frame.profile_segments += 1,
                0xc0..=0xcf if !matches!(marker, 0xc4 | 0xc8 | 0xcc) && frame.sampling.is_empty() => {
                    frame.is_progressive = marker & 3 == 2;
                    frame.start(&segment);
                }
                _ => {}
            }
        }
        Ok(frame)
    }

    /// Takes size and sampling from a frame header.
    fn start(&mut self, header: &[u8]) {
        let [_, high, higher, wide, wider, components, specified @ ..] = header else { return };
        self.size =
            [u16::from_be_bytes([*wide, *wider]), u16::from_be_bytes([*high, *higher])].map(u64::from);
        let sampling = |component: &[u8]| [u64::from(component[1] >> 4), u64::from(component[1] & 15)];
        let each = specified.chunks_exact(3).take(usize::from(*components));
        self.sampling = each.map(|component| sampling(component).map(|factor| factor.clamp(1, 4))).collect();
    }

    /// Says what is wrong with a picture that would take the decoder beyond all measure.
    pub(crate) fn check(&self) -> Result<(), String> {
        let texels = self.size[0] * self.size[1];
        let most = (SMALL_WORK / texels.max(1)).clamp(FEW_SCANS, MANY_SCANS);
        if self.scans > most {
            return Err(format!(
                "its picture comes in more than {most} scans, where some ten make sense; write it again, for example: magick \
                 INPUT -interlace none output.jpg"
            ));
        }
        if self.profile_segments > MAX_PROFILE_SEGMENTS {
            return Err(format!(
                "its colour profile is cut into {} parts, where {MAX_PROFILE_SEGMENTS} are the most; write it again without",
                self.profile_segments
            ));
        }
        Ok(())
    }

    /// Its shape, where it may be read some rows at a time: baseline, and all channels in one scan.
    pub(crate) fn in_rows(&self) -> Option<Shape> {
        let size = self.size.map(|side| side as u32);
        let is_plain =
            !self.is_progressive && self.scans == 1 && !size.contains(&0) && !self.sampling.is_empty();
        is_plain.then(|| Shape::new(size, &self.sampling))
    }

    /// Memory that decoding takes at most: planes of samples and the picture made of them; blocks of coefficients that wait for the threads that transform them; and, of a progressive
    /// picture, the coefficients of all of it.
    pub(crate) fn memory_bytes(&self) -> u64 {
        let largest = |i: usize| self.sampling.iter().map(|factors| factors[i]).max().unwrap_or(1);
        let units = [0, 1].map(|i| self.size[i].div_ceil(8 * largest(i)));
        let planes: u64 =
            self.sampling.iter().map(|[across, down]| units[0] * across * units[1] * down * 64).sum();
        let picture = self.size[0] * self.size[1] * self.sampling.len() as u64;
        let coefficients = if self.is_progressive { 2 * planes } else { 0 };
        coefficients + planes + picture.max(2 * planes) + (self.profile_segments << 16)
    }
}

/// The next marker; `None` at the end of the input. Everything up to it is passed over: packed samples hold none.
fn next_marker(input: &mut impl BufRead) -> std::io::Result<Option<u8>> {
    loop {
        let ahead = input.fill_buf()?;
        if ahead.is_empty() {
            return Ok(None);
        }
        let Some(at) = ahead.iter().position(|byte| *byte == 0xff) else {
            let passed = ahead.len();
            input.consume(passed);
            continue;
        };
        input.consume(at + 1);
        loop {
            match next_byte(input)? {
                None => return Ok(None),
                Some(0xff) => {}
                Some(0) => break,
                Some(marker) => return Ok(Some(marker)),
            }
        }
    }
}

fn next_byte(input: &mut impl BufRead) -> std::io::Result<Option<u8>> {
    let byte = input.fill_buf()?.first().copied();
    if byte.is_some() {
        input.consume(1);
    }
    Ok(byte)
}

/// The bytes of a marker's segment; `None` if the input ends in it.
fn segment(input: &mut impl BufRead) -> std::io::Result<Option<Vec<u8>>> {
    let (Some(high), Some(low)) = (next_byte(input)?, next_byte(input)?) else { return Ok(None) };
    let mut segment = vec![0; usize::from(u16::from_be_bytes([high, low])).saturating_sub(2)];
    match input.read_exact(&mut segment) {
        Ok(()) => Ok(Some(segment)),
        Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(parts: &[&[u8]]) -> JpegFrame {
        JpegFrame::read(&parts.concat()[..]).unwrap()
    }

    const START: &[u8] = &[0xff, 0xd8, 0xff, 0xe0, 0, 4, 0xff, 0xda];
    /// Progressive, 100 wide, 60 high, 4:2:0.
    const FRAME: &[u8] = &[0xff, 0xc2, 0, 17, 8, 0, 60, 0, 100, 3, 1, 0x22, 0, 2, 0x11, 1, 3, 0x11, 1];
    const SCAN: &[u8] = &[0xff, 0xff, 0xda, 0, 3, 9, 1, 2, 0xff, 0, 0xff, 0xd3, 5, 6];
    const END: &[u8] = &[0xff, 0xd9];

    #[test]
    fn markers_are_told_from_what_looks_like_them() {
        let found = frame(&[START, FRAME, SCAN, SCAN, END, SCAN]);
        assert_eq!((found.size, found.scans, found.is_progressive), ([100, 60], 2, true));
        assert_eq!(found.sampling, [[2, 2], [1, 1], [1, 1]]);
        // 7 x 4 units of 16 x 16: planes of 112 x 64, 56 x 32 and 56 x 32.
        let planes = 112 * 64 * 3 / 2;
        assert_eq!(found.memory_bytes(), 5 * planes);
        assert_eq!(frame(&[START, FRAME, &SCAN[..4]]).scans, 1);
        assert_eq!(frame(&[]), JpegFrame::default());
    }

    #[test]
    fn scans_and_profiles_beyond_measure_are_refused() {
        let with_scans = |size: [u64; 2], scans| JpegFrame { size, scans, ..JpegFrame::default() };
        assert!(with_scans([100, 60], 100).check().is_ok());
        assert!(with_scans([100, 60], 101).check().unwrap_err().contains("100 scans"));
        assert!(with_scans([65_500, 65_500], 32).check().is_ok());
        assert!(with_scans([65_500, 65_500], 33).check().unwrap_err().contains("32 scans"));
        assert_eq!(frame(&[START, FRAME, &SCAN.repeat(2000), END]).scans, MANY_SCANS + 1);
        let profile = [&[0xff, APP2, 0, 14][..], b"ICC_PROFILE\0"].concat();
        assert!(frame(&[START, &profile.repeat(255), FRAME, SCAN, END]).check().is_ok());
        assert!(frame(&[START, &profile.repeat(256), FRAME, SCAN, END]).check().is_err());
    }
}
