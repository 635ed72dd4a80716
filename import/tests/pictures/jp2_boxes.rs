//! Boxes of JP2 around streams that exist: which channel is alpha, what a palette holds, and where the picture lies.
//!
//! A map of channels (`cmap`) without a palette's column repeats a channel of the stream, so that three make four and five.

use super::{SIZE, colour, each, fixture};
use std::path::PathBuf;
use tempfile::TempDir;
use terrasoar_import::{PictureOptions, Stretch, open_image, open_images};
use terrasoar_layout::error::LayoutError;

const GREY: u32 = 17;
const RGB: u32 = 16;
const COLOUR: u16 = 0;
const ALPHA: u16 = 1;
const PREMULTIPLIED: u16 = 2;
/// A kind, or a colour, of which nothing is said.
const NONE: u16 = u16::MAX;

fn boxed(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat()
}

fn stream(name: &str) -> Vec<u8> {
    let bytes = std::fs::read(fixture(name)).unwrap();
    let start = bytes.windows(4).position(|four| four == b"\xff\x4f\xff\x51").unwrap();
    bytes[start..].to_vec()
}

fn system(number: u32) -> Vec<u8> {
    boxed(b"colr", &[&[1, 0, 0][..], &number.to_be_bytes()].concat())
}

/// Kind and colour of each channel.
fn kinds(channels: &[(u16, u16)]) -> Vec<u8> {
    let each = (0u16..).zip(channels).flat_map(|(number, (kind, of))| [number, *kind, *of]);
    let numbers = std::iter::once(channels.len() as u16).chain(each);
    boxed(b"cdef", &numbers.flat_map(u16::to_be_bytes).collect::<Vec<u8>>())
}

/// A palette of columns of so many bits, and the channels made of it: of a channel of the stream, and a column or none.
fn palette(bits: &[u8], entries: &[Vec<u16>], channels: &[(u16, Option<u8>)]) -> Vec<u8> {
    let mut content = (entries.len() as u16).to_be_bytes().to_vec();
    content.push(bits.len() as u8);
    content.extend(bits.iter().map(|bits| bits - 1));
    for (bits, number) in entries.iter().flat_map(|entry| bits.iter().zip(entry)) {
        let bytes = number.to_be_bytes();
        content.extend(&bytes[if *bits > 8 { 0 } else { 1 }..]);
    }
    let map = channels.iter().flat_map(|(channel, column)| {
        let [high, low] = channel.to_be_bytes();
        [high, low, u8::from(column.is_some()), column.unwrap_or(0)]
    });
    [boxed(b"pclr", &content), boxed(b"cmap", &map.collect::<Vec<u8>>())].concat()
}

/// Channels of the stream, repeated.
fn repeated(channels: &[u16]) -> Vec<u8> {
    let entry = vec![0; channels.len()];
    let map: Vec<_> = channels.iter().map(|channel| (*channel, None)).collect();
    palette(&vec![8; channels.len()], &[entry.clone(), entry], &map)
}

fn jp2(boxes: &[Vec<u8>], stream: &[u8]) -> Vec<u8> {
    let mut image = [SIZE[1].to_be_bytes(), SIZE[0].to_be_bytes()].concat();
    image.extend([0, 3, 7, 7, 0, 0]);
    [
        b"\0\0\0\x0cjP  \r\n\x87\n".to_vec(),
        boxed(b"ftyp", b"jp2 \0\0\0\0jp2 "),
        boxed(b"jp2h", &[boxed(b"ihdr", &image), boxes.concat()].concat()),
        boxed(b"jp2c", stream),
    ]
    .concat()
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn put(&self, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join("a.jp2");
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn shown(&self, bytes: &[u8], options: &PictureOptions) -> Result<Vec<[u8; 4]>, LayoutError> {
        let images = open_images(&[self.put(bytes)], None, options)?;
        let mut rgba = vec![0; (SIZE[0] * SIZE[1] * 4) as usize];
        images[0].rows()?.read(&mut rgba)?;
        Ok(rgba.as_chunks::<4>().0.to_vec())
    }
}

#[test]
fn alpha_is_the_channel_that_is_said_to_be_it() {
    let folder = Folder::new();
    let stream = stream("rgb-tiles.jp2");
    let rgb = [(COLOUR, 1), (COLOUR, 2), (COLOUR, 3)];
    let (premultiplied, alpha, unsaid) = ((PREMULTIPLIED, 0), (ALPHA, 0), (NONE, NONE));
    // Channels of the stream, what they are, and which of the stream's are then shown and alpha.
    let of_three = |kinds: [(u16, u16); 3], system, shown: [usize; 3], alpha: Option<usize>| {
        (Vec::new(), kinds.to_vec(), system, shown, alpha)
    };
    let [r, g, b] = rgb;
    for (channels, said, number, shown, alpha) in [
        of_three([premultiplied, r, unsaid], GREY, [1; 3], Some(0)),
        of_three([r, unsaid, alpha], GREY, [0; 3], Some(2)),
        of_three([alpha, r, unsaid], GREY, [1; 3], Some(0)),
        of_three([unsaid, alpha, r], GREY, [2; 3], Some(1)),
        of_three([b, r, g], RGB, [1, 2, 0], None),
        of_three([unsaid; 3], RGB, [0, 1, 2], None),
        // Alpha, red, green and blue.
        (vec![1, 0, 1, 2], vec![premultiplied, r, g, b], RGB, [0, 1, 2], Some(1)),
        (vec![1, 0, 1, 2], vec![alpha, r, g, b], RGB, [0, 1, 2], Some(1)),
        // Red, green, blue, alpha and infrared, whose kind is not said, or which is a colour without a number.
        (vec![0, 1, 2, 0, 1], vec![r, g, b, alpha, unsaid], RGB, [0, 1, 2], Some(0)),
        (vec![0, 1, 2, 0, 1], vec![r, g, b, premultiplied, unsaid], RGB, [0, 1, 2], Some(0)),
        (vec![0, 1, 2, 0, 1], vec![r, g, b, alpha, (COLOUR, 0)], RGB, [0, 1, 2], Some(0)),
        (vec![0, 2, 1, 0, 2], vec![unsaid, b, g, alpha, r], RGB, [2, 1, 2], Some(0)),
        // Only alpha is spoken of.
        (vec![2, 1, 0, 1], vec![r, g, b, premultiplied], RGB, [2, 1, 0], Some(1)),
    ] {
        let mut boxes = vec![system(number)];
        if !channels.is_empty() {
            boxes.push(repeated(&channels));
        }
        boxes.push(kinds(&said));
        let texels = folder.shown(&jp2(&boxes, &stream), &PictureOptions::default()).unwrap();
        each(&texels, |x, y, texel| {
            let channel = colour(x, y);
            let [r, g, b] = shown.map(|i| channel[i]);
            let wanted = [r, g, b, alpha.map_or(255, |i| channel[i])];
            assert_eq!(texel, wanted, "{channels:?} {said:?} {x} {y}");
        });
    }
}

#[test]
fn bands_are_counted_as_they_stand_in_the_file() {
    let folder = Folder::new();
    let said = kinds(&[(COLOUR, 3), (COLOUR, 1), (COLOUR, 2)]);
    let bytes = jp2(&[system(RGB), said], &stream("rgb-tiles.jp2"));
    let bands = [1, 3, 2].map(|band: u32| band.try_into().unwrap()).to_vec();
    let texels = folder.shown(&bytes, &PictureOptions { bands, ..PictureOptions::default() }).unwrap();
    each(&texels, |x, y, texel| {
        let [first, second, third] = colour(x, y);
        assert_eq!(texel, [first, third, second, 255], "{x} {y}");
    });
}

#[test]
fn palettes_are_of_up_to_eight_bits() {
    let folder = Folder::new();
    let stream = stream("grey.j2k");
    let map = [(0, Some(0)), (0, Some(1)), (0, Some(2))];
    let shown = |bits: [u8; 3], map: &[(u16, Option<u8>)]| {
        let number =
            |number: u16, bits: u8| if bits < 8 { number >> (8 - bits) } else { number << (bits - 8) };
        let entry =
            |i: u16| [255 - i, i, i / 2].into_iter().zip(bits).map(|(n, bits)| number(n, bits)).collect();
        let entries: Vec<Vec<u16>> = (0..256).map(entry).collect();
        folder.shown(&jp2(&[system(RGB), palette(&bits, &entries, map)], &stream), &PictureOptions::default())
    };
    each(&shown([8, 4, 8], &map).unwrap(), |x, y, texel| {
        let place = colour(x, y)[0];
        assert_eq!(texel, [255 - place, (place >> 4) * 17, place / 2, 255], "{x} {y}");
    });
    for bits in [[9; 3], [8, 12, 8], [8, 8, 16]] {
        let refused = shown(bits, &map).unwrap_err().to_string();
        assert!(refused.contains("palette") && refused.contains("gdal_translate"), "{refused}");
    }
    // A palette that ends too early, one without colours, and a channel of a column that it does not have.
    for broken in [&b"\x01\x00\x03\x07\x07\x07abc"[..], b"\0\0\x03\x07\x07\x07", b"\0\x01", b""] {
        let bytes = jp2(&[system(RGB), boxed(b"pclr", broken)], &stream);
        assert!(folder.shown(&bytes, &PictureOptions::default()).is_err(), "{broken:?}");
    }
    assert!(shown([8; 3], &[(0, Some(0)), (0, Some(1)), (0, Some(3))]).is_err());
    assert!(shown([8; 3], &[(0, Some(0)), (1, None), (0, Some(1))]).is_err());
}

/// Numbers with a sign, in front of which stands a colour profile with bytes that read as the name of a palette's box.
#[test]
fn signed_numbers_are_read_and_a_colour_profile_is_no_palette() {
    let folder = Folder::new();
    let mut signed = stream("grey.j2k");
    let sizes = signed.windows(2).position(|pair| pair == b"\xff\x51").unwrap();
    // The same numbers without half of the range that is put on those without a sign.
    signed[sizes + 40] |= 0x80;
    let profile = boxed(b"colr", &[&[2, 0, 0][..], &[0; 60], b"pclr", &[0; 60]].concat());
    for (black, white, zero) in [(-128.0, 127.0, 0), (0.0, 127.0, 128)] {
        let stretch = Some(Stretch::Values(black, white));
        let options = PictureOptions { stretch, ..PictureOptions::default() };
        let texels = folder.shown(&jp2(std::slice::from_ref(&profile), &signed), &options).unwrap();
        each(&texels, |x, y, texel| {
            let wanted = f64::from(colour(x, y)[0].saturating_sub(zero)) * 255.0 / (white - black);
            assert!((f64::from(texel[0]) - wanted).abs() <= 0.5, "{x} {y}: {texel:?}, not {wanted}");
        });
    }
}

/// A GeoTIFF of no picture that says a system, and no place.
fn system_alone(code: u16) -> Vec<u8> {
    let keys = [1u16, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, code];
    let mut tiff = b"II*\0\x08\0\0\0\x03\0".to_vec();
    for (tag, kind, count, value) in
        [(256u16, 3u16, 1u32, 1u32), (257, 3, 1, 1), (34_735, 3, keys.len() as u32, 50)]
    {
        tiff.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        tiff.extend([count.to_le_bytes(), value.to_le_bytes()].concat());
    }
    tiff.extend([0; 4]);
    tiff.extend(keys.iter().flat_map(|number| number.to_le_bytes()));
    let id = [0xb1, 0x4b, 0xf8, 0xbd, 0x08, 0x3d, 0x4b, 0x43, 0xa5, 0xae, 0x8c, 0xd7, 0xd5, 0xa6, 0xce, 0x03];
    boxed(b"uuid", &[&id[..], &tiff].concat())
}

/// A box of a GeoTIFF says the system, and a world file the place.
#[test]
fn a_system_without_a_place_is_kept() {
    let folder = Folder::new();
    let bytes = [jp2(&[system(RGB)], &stream("rgb-tiles.jp2")), system_alone(32_632)].concat();
    let path = folder.put(&bytes);
    std::fs::write(path.with_extension("wld"), "2\n0\n0\n-2\n1001\n4999\n").unwrap();
    let image = open_image(&path).unwrap();
    let found = &image.info().georeference;
    assert_eq!(found.pixel_to_crs, Some([1001.0, 2.0, 0.0, 4999.0, 0.0, -2.0]));
    assert_eq!(found.epsg, Some(32_632), "{:?}", image.info().notes);
}
