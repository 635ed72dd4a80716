//! A picture of red, green and blue as PNG, and how a picture of ours is recognised.
//!
//! It has the text chunk `Software` before the pixels. The same pixels give the same bytes. Cost: the whole file in memory.

use png::{BitDepth, ColorType, Compression, Encoder, Filter};
use std::io;

/// Keyword and text of the chunk that tells who made a picture.
const MAKER: [&str; 2] = ["Software", "Terrasoar"];
/// Bytes of a PNG before the first chunk that may be there or not.
const FIXED_BYTES: usize = 33;

/// The PNG file of a picture of `size_px` pixels (across, down), three bytes a pixel, row by row from the top.
///
/// # Errors
/// A picture without pixels, or with another number of them.
pub fn encode(rgb: &[u8], size_px: [u32; 2]) -> io::Result<Vec<u8>> {
    encode_with(rgb, size_px, &[])
}

/// As [`encode`], with more texts: keywords of at most 79 letters, and what they say.
///
/// # Errors
/// As [`encode`]; a keyword that PNG does not take.
pub fn encode_with(rgb: &[u8], size_px: [u32; 2], texts: &[(&'static str, String)]) -> io::Result<Vec<u8>> {
    encode_for_print(rgb, size_px, texts, None)
}

/// As [`encode_with`], with how many pixels a metre it has when it is printed.
///
/// # Errors
/// As [`encode_with`].
pub fn encode_for_print(
    rgb: &[u8],
    size_px: [u32; 2],
    texts: &[(&'static str, String)],
    pixels_per_m: Option<u32>,
) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, size_px[0], size_px[1]);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Balanced);
    encoder.set_filter(Filter::Adaptive);
    encoder.add_text_chunk(MAKER[0].into(), MAKER[1].into())?;
    for (keyword, text) in texts {
        match text.is_ascii() {
            true => encoder.add_text_chunk((*keyword).into(), text.clone())?,
            false => encoder.add_itxt_chunk((*keyword).into(), text.clone())?,
        }
    }
    let mut writer = encoder.write_header()?;
    if let Some(count) = pixels_per_m {
        // After the maker, by which a picture of ours is known.
        let [a, b, c, d] = count.to_be_bytes();
        writer.write_chunk(png::chunk::pHYs, &[a, b, c, d, a, b, c, d, 1])?;
    }
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(bytes)
}

/// Whether a file that begins with `start` could be one of [`encode`]: 100 bytes are enough.
pub fn is_ours(start: &[u8]) -> bool {
    let [keyword, text] = MAKER;
    let maker = [b"tEXt", keyword.as_bytes(), b"\0", text.as_bytes()].concat();
    // Signature, then length, name, size, depth and colour of the first chunk; the second one's length lies before its name.
    start.starts_with(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")
        && start.get(24..26) == Some(&[8, 2])
        && start.get(FIXED_BYTES + 4..).is_some_and(|chunk| chunk.starts_with(&maker))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_survive_and_the_maker_is_known() {
        let rgb: Vec<u8> = (0..3 * 7 * 5).map(|i| (i * 37 % 251) as u8).collect();
        let file = encode(&rgb, [7, 5]).unwrap();
        let read = image::load_from_memory(&file).unwrap();
        assert_eq!(read.to_rgb8().into_raw(), rgb);
        assert!(is_ours(&file) && is_ours(&file[..100]));
        assert_eq!(file, encode(&rgb, [7, 5]).unwrap());
        let texts = [("Reference system", "EPSG:32632".to_owned()), ("Heights", "m über NN".to_owned())];
        let told = encode_with(&rgb, [7, 5], &texts).unwrap();
        assert!(is_ours(&told) && image::load_from_memory(&told).unwrap().to_rgb8().into_raw() == rgb);
        for chunk in [&b"tEXtReference system\0EPSG:32632"[..], "m über NN".as_bytes()] {
            assert!(told.windows(chunk.len()).any(|window| window == chunk));
        }
        assert!(encode(&rgb, [7, 6]).is_err() && encode(&[], [0, 0]).is_err());
    }

    #[test]
    fn pictures_of_others_are_not_ours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        image::RgbImage::new(9, 9).save(&path).unwrap();
        assert!(!is_ours(&std::fs::read(&path).unwrap()));
        let deep = image::ImageBuffer::<image::Luma<u16>, _>::new(9, 9);
        deep.save(&path).unwrap();
        assert!(!is_ours(&std::fs::read(&path).unwrap()));
        assert!(!is_ours(b"") && !is_ours(b"\x89PNG\r\n\x1a\n"));
    }
}
