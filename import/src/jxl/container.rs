//! The stream of a JPEG XL file (ISO/IEC 18181-2): all of it, or what its boxes hold of it.
//!
//! Other boxes are passed over and not read: what they pack may become any length. Cost: a read of 8 to 20 bytes a box.

use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};

/// A file of boxes begins so.
const SIGNATURE: [u8; 12] = *b"\0\0\0\x0cJXL \r\n\x87\n";
/// A bare stream begins so.
const START: [u8; 2] = [0xff, 0x0a];
/// Boxes of a file, at most.
const MAX_BOXES: u32 = 4096;

/// Whether a file of these first bytes is JPEG XL, in boxes or bare.
pub(crate) fn is_jxl(head: &[u8]) -> bool {
    head.starts_with(&SIGNATURE) || head.starts_with(&START)
}

/// The bytes of the stream.
pub(super) struct Stream<R> {
    input: R,
    /// Bytes of the stream that lie next; a box may go on to the end of the file.
    left: u64,
    boxes: u32,
}

impl<R: Read + Seek> Stream<R> {
    /// Of a file, from its first byte on.
    pub(super) fn begin(mut input: R) -> Result<Self> {
        let mut head = [0; 2];
        input.read_exact(&mut head)?;
        input.seek(SeekFrom::Start(0))?;
        let is_bare = head == START;
        Ok(Self {
            input,
            left: if is_bare { u64::MAX } else { 0 },
            boxes: if is_bare { MAX_BOXES } else { 0 },
        })
    }

    /// Goes to the next box that holds some of the stream; whether there is one.
    fn next_box(&mut self) -> Result<bool> {
        while self.boxes < MAX_BOXES {
            self.boxes += 1;
            let mut head = [0; 8];
            match self.input.read_exact(&mut head) {
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(false),
                read => read?,
            }
            let length = u64::from(u32::from_be_bytes([head[0], head[1], head[2], head[3]]));
            let content = match length {
                0 => u64::MAX,
                1 => {
                    let mut long = [0; 8];
                    self.input.read_exact(&mut long)?;
                    u64::from_be_bytes(long).checked_sub(16).ok_or(ErrorKind::InvalidData)?
                }
                length => length.checked_sub(8).ok_or(ErrorKind::InvalidData)?,
            };
            match &head[4..] {
                b"jxlc" => self.left = content,
                // A part, with its number in front.
                b"jxlp" => {
                    self.input.read_exact(&mut [0; 4])?;
                    let rest = if content == u64::MAX { Some(content) } else { content.checked_sub(4) };
                    self.left = rest.ok_or(ErrorKind::InvalidData)?;
                }
                _ if content == u64::MAX => return Ok(false),
                _ => {
                    let step = i64::try_from(content).map_err(|_| Error::from(ErrorKind::InvalidData))?;
                    self.input.seek_relative(step)?;
                }
            }
            if self.left > 0 {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

impl<R: Read + Seek> Read for Stream<R> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        while !bytes.is_empty() {
            if self.left == 0 && !self.next_box()? {
                break;
            }
            let most = usize::try_from(self.left).unwrap_or(usize::MAX).min(bytes.len());
            let read = self.input.read(&mut bytes[..most])?;
            if read > 0 {
                self.left -= if self.left == u64::MAX { 0 } else { read as u64 };
                return Ok(read);
            }
            // The file ends in the box.
            self.left = 0;
            self.boxes = MAX_BOXES;
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn boxed(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat()
    }

    fn stream(parts: &[Vec<u8>]) -> Result<Vec<u8>> {
        let mut read = Vec::new();
        Stream::begin(Cursor::new(parts.concat()))?.read_to_end(&mut read)?;
        Ok(read)
    }

    #[test]
    fn parts_are_joined_and_other_boxes_passed_over() {
        let whole = [START.to_vec(), vec![7; 300]].concat();
        assert_eq!(stream(std::slice::from_ref(&whole)).unwrap(), whole);
        let signature = SIGNATURE.to_vec();
        let other = boxed(b"brob", &[1; 77]);
        let one = boxed(b"jxlc", &whole);
        assert_eq!(stream(&[signature.clone(), other.clone(), one.clone(), other.clone()]).unwrap(), whole);
        let part = |number: u8, bytes: &[u8]| boxed(b"jxlp", &[&[0, 0, 0, number][..], bytes].concat());
        let parts =
            [signature.clone(), part(0, &whole[..5]), other.clone(), part(1, &[]), part(130, &whole[5..])];
        assert_eq!(stream(&parts).unwrap(), whole);
        // A length of 64 bits, and one that is the rest of the file.
        let long = [&b"\0\0\0\x01jxlc"[..], &(whole.len() as u64 + 16).to_be_bytes(), &whole].concat();
        assert_eq!(stream(&[signature.clone(), long, other.clone()]).unwrap(), whole);
        assert_eq!(stream(&[signature.clone(), [&b"\0\0\0\0jxlc"[..], &whole].concat()]).unwrap(), whole);
        // Cut in a box; boxes that cannot be; nothing but others.
        assert_eq!(stream(&[signature.clone(), one[..50].to_vec()]).unwrap(), whole[..42]);
        for broken in [
            &b"\0\0\0\x07jxlc"[..],
            b"\0\0\0\x01jxlc\0\0\0\0\0\0\0\x0f",
            b"\0\0\0\x0ajxlp\0\0",
            b"\0\0\0\x01free\xff\xff\xff\xff\xff\xff\xff\xff",
        ] {
            assert!(stream(&[signature.clone(), broken.to_vec()]).is_err(), "{broken:?}");
        }
        assert!(
            stream(&[signature.clone(), boxed(b"free", &[]).repeat(5000), one.clone()]).unwrap().is_empty()
        );
        assert!(is_jxl(&signature) && is_jxl(&whole) && !is_jxl(b"\xff\xd8"));
    }
}
