//! The header of a Netpbm picture: `P5`, width, height, largest value; comments from `#` to the end of a line.

use crate::text::{is_blank, number, shown};
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// Most bytes of a header, its comments included.
pub(super) const MOST_BYTES: usize = 1 << 16;

/// How samples are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Class {
    Text,
    Bytes,
    Real { is_big: bool },
}

/// What the header says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub(super) class: Class,
    pub(super) samples: [u32; 2],
    pub(super) largest: f64,
    /// Byte at which samples begin.
    pub(super) data_at: usize,
}

/// Whether a file that begins so is a Netpbm picture, of any kind.
pub(crate) fn is_pnm(head: &[u8]) -> bool {
    let [b'P', b'1'..=b'6' | b'F' | b'f', rest @ ..] = head else { return false };
    let mut rest = rest.iter().skip_while(|byte| byte.is_ascii_whitespace());
    head.get(2).is_some_and(u8::is_ascii_whitespace)
        && rest.next().is_some_and(|byte| byte.is_ascii_digit() || *byte == b'#')
}

impl Header {
    pub(super) fn parse(path: &Path, head: &[u8]) -> Result<Self, LayoutError> {
        let damaged = |problem: String| LayoutError::damaged(path, "header", problem);
        let kind = head.get(1).copied().unwrap_or_default();
        match kind {
            b'2' | b'5' | b'f' => {}
            b'1' | b'4' => {
                return Err(LayoutError::unsupported(
                    path,
                    "this is a picture of black and white, which has no heights; look for the elevation data it was made from",
                ));
            }
            _ => {
                return Err(LayoutError::unsupported(
                    path,
                    "this is a Netpbm picture of colours, and heights are read from grey ones (P2, P5, Pf); if it is a picture of the terrain, look for its elevation data; if \
                     heights are in one channel, extract it: gdal_translate -of PNM -b 1 INPUT output.pgm",
                ));
            }
        }
        let mut at = 2;
        let mut word = || {
            let (word, end) = next_word(head, at);
            at = end;
            word
        };
        let side = |word: &[u8]| {
            let whole = number(word)
                .filter(|value| value.fract() == 0.0 && (2.0..=f64::from(u32::MAX)).contains(value));
            // Within the type, by the filter.
            whole.map(|side| side as u32).ok_or_else(|| {
                damaged(format!(
                    "a side of {} samples makes no terrain; at least 2 x 2 are needed",
                    shown(word)
                ))
            })
        };
        let samples = [side(word())?, side(word())?];
        let last = word();
        let value = number(last).filter(|value| value.is_finite() && *value != 0.0);
        let refused =
            || damaged(format!("{} is no largest value from 1 to 65535; fetch the file again", shown(last)));
        let value = value.ok_or_else(refused)?;
        let class = match kind {
            b'2' => Class::Text,
            b'5' => Class::Bytes,
            // The sign of the scale tells the order of bytes; its size means nothing to most programs.
            _ => Class::Real { is_big: value > 0.0 },
        };
        let is_real = matches!(class, Class::Real { .. });
        if !is_real && (value.fract() != 0.0 || !(1.0..=65_535.0).contains(&value)) {
            return Err(refused());
        }
        // One blank separates the header from the samples.
        Ok(Self { class, samples, largest: value, data_at: (at + 1).min(head.len()) })
    }
}

/// The next word from `at`, comments passed over, and the place behind it.
fn next_word(head: &[u8], mut at: usize) -> (&[u8], usize) {
    loop {
        while head.get(at).is_some_and(|byte| is_blank(*byte)) {
            at += 1;
        }
        if head.get(at) != Some(&b'#') {
            break;
        }
        while head.get(at).is_some_and(|byte| *byte != b'\n' && *byte != b'\r') {
            at += 1;
        }
    }
    let end = head[at..]
        .iter()
        .position(|byte| is_blank(*byte) || *byte == b'#')
        .map_or(head.len(), |length| at + length);
    (&head[at..end], end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_with_comments() {
        let parsed = |text: &[u8]| Header::parse(Path::new("a"), text);
        let header = parsed(b"P5\n# made by\n 3 # wide\n2\n65535\n\0\x01").unwrap();
        assert_eq!(
            (header.class, header.samples, header.largest, header.data_at),
            (Class::Bytes, [3, 2], 65535.0, 31)
        );
        assert_eq!(parsed(b"Pf 3 2 -1.0\n").unwrap().class, Class::Real { is_big: false });
        assert_eq!(parsed(b"P2 3 2 255").unwrap().data_at, 10);
        for (text, wanted) in [
            (&b"P6 3 2 255 "[..], "colours"),
            (b"P1 3 2 ", "black and white"),
            (b"P5 3 1 255 ", "2 x 2"),
            (b"P5 3 2 70000 ", "largest value"),
            (b"P5 3 2 0 ", "largest value"),
            (b"P5 3", "2 x 2"),
            (b"Pf 3 2 nan ", "largest value"),
        ] {
            let said = parsed(text).unwrap_err().to_string();
            assert!(said.contains(wanted), "{said}");
        }
        assert!(
            is_pnm(b"P5\n3 2")
                && is_pnm(b"P2 #x")
                && !is_pnm(b"P5")
                && !is_pnm(b"P7 3")
                && !is_pnm(b"PK\x03\x04")
                && !is_pnm(b"P5\nx")
        );
    }
}
