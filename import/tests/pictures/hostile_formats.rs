//! WebP, JPEG 2000 and JPEG XL made to exhaust memory or time, bare, in a JP2 file and inside of a TIFF.

use super::*;

const BARE: &[u8] = include_bytes!("../image_fixtures/grey.j2k");
const TILED: &[u8] = include_bytes!("../image_fixtures/rgb-tiles.jp2");
const XL: [&[u8]; 3] = [
    include_bytes!("../image_fixtures/rgb.jxl"),
    include_bytes!("../image_fixtures/rgba.jxl"),
    include_bytes!("../image_fixtures/lossy.jxl"),
];
const LOSSY: &[u8] = include_bytes!("../image_fixtures/rgb.webp");

fn find(bytes: &[u8], wanted: &[u8]) -> usize {
    bytes.windows(wanted.len()).position(|window| window == wanted).unwrap()
}

/// A stream with other sizes of picture and tile.
fn resized(stream: &[u8], size: [u32; 2], tile: [u32; 2]) -> Vec<u8> {
    let mut bytes = stream.to_vec();
    let at = find(&bytes, b"\xff\x51") + 6;
    for (number, at) in [(size[0], at), (size[1], at + 4), (tile[0], at + 16), (tile[1], at + 20)] {
        bytes[at..at + 4].copy_from_slice(&number.to_be_bytes());
    }
    bytes
}

fn needs_memory(error: &LayoutError) -> u64 {
    let Some(Remedy::Memory { enough_mib: Some(enough) }) = error.remedy() else { panic!("{error}") };
    enough
}

#[test]
fn the_memory_of_a_jpeg_2000_is_asked_for_before_it_is_taken() {
    let _alone = alone();
    let bench = Bench::new();
    let side = 40_000;
    let large = resized(BARE, [side; 2], [side; 2]);
    assert!(needs_memory(&bench.refusal(&bench.write("a.j2k", &large))) > 10_000);
    // More tiles than a picture can have, and tiles that are not there.
    let many = resized(BARE, [side; 2], [8; 2]);
    assert!(bench.refusal(&bench.write("b.j2k", &many)).to_string().contains("more tiles"));
    let missing = resized(BARE, [side; 2], [1024; 2]);
    assert!(bench.refusal(&bench.write("c.j2k", &missing)).to_string().contains("tile 1 of 1600 is missing"));
    for size in [[0, 9], [u32::MAX, u32::MAX]] {
        bench.refusal(&bench.write("d.j2k", &resized(BARE, size, [64; 2])));
    }
    bench.refusal(&bench.write("e.j2k", &resized(BARE, [72, 56], [0; 2])));
}

/// Blocks of 4 x 4 samples, each of 32 layers: hundreds of bytes a block.
#[test]
fn small_blocks_of_a_jpeg_2000_count_as_memory() {
    let _alone = alone();
    let bench = Bench::new();
    let mut small = resized(BARE, [1500; 2], [1500; 2]);
    let plain = open_image(&bench.write("a.j2k", &small)).unwrap().info().memory_bytes;
    let style = find(&small, b"\xff\x52");
    small[style + 6..style + 8].copy_from_slice(&32u16.to_be_bytes());
    small[style + 10..style + 12].fill(0);
    let image = open_image(&bench.write("b.j2k", &small)).unwrap();
    let told = image.info().memory_bytes;
    assert!(told > 5 * plain, "{told}, {plain} before");
    let (_, bytes) = peak(|| image.rows().and_then(|mut rows| rows.read(&mut vec![0; 4 * 1500])));
    assert!(bytes as u64 <= told + 2 * MIB as u64, "{bytes} taken, {told} told");
    // The same in the header of a tile, of which the main header says nothing.
    let mut hidden = resized(BARE, [1000; 2], [1000; 2]);
    let length = usize::from(u16::from_be_bytes([small[style + 2], small[style + 3]])) + 2;
    let segment = small[style..style + length].to_vec();
    let data = find(&hidden, b"\xff\x93");
    let part = find(&hidden, b"\xff\x90");
    hidden.splice(data..data, segment);
    let whole = u32::from_be_bytes(hidden[part + 6..part + 10].try_into().unwrap());
    if whole > 0 {
        hidden[part + 6..part + 10].copy_from_slice(&(whole + length as u32).to_be_bytes());
    }
    let said = bench.refusal(&bench.write("c.j2k", &hidden)).to_string();
    assert!(said.contains("smaller blocks"), "{said}");
}

#[test]
fn a_jpeg_2000_takes_no_more_memory_than_it_says() {
    let _alone = alone();
    let bench = Bench::new();
    let image = open_image(&bench.write("a.j2k", &resized(BARE, [2048; 2], [2048; 2]))).unwrap();
    let (_, bytes) = peak(|| image.rows().and_then(|mut rows| rows.read(&mut vec![0; 4 * 2048])));
    let told = image.info().memory_bytes as usize;
    assert!(bytes <= told + 2 * MIB, "{bytes} taken, {told} told");
}

/// A stream of so many bits a channel instead of 8.
fn of_bits(stream: &[u8], bits: u8) -> Vec<u8> {
    let mut bytes = stream.to_vec();
    let at = find(&bytes, b"\xff\x51");
    let channels = usize::from(bytes[at + 39]);
    (0..channels).for_each(|channel| bytes[at + 40 + 3 * channel] = bits - 1);
    bytes
}

/// Bits in use are looked for among numbers, which take more than bytes.
#[test]
fn a_jpeg_2000_of_16_bits_takes_no_more_memory_than_it_says() {
    let _alone = alone();
    let bench = Bench::new();
    // All six tiles in a row.
    let side = 512;
    let wide = of_bits(&resized(TILED, [6 * side, side], [side; 2]), 16);
    let image = open_image(&bench.write("a.jp2", &wide)).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let read = || image.rows().and_then(|mut rows| rows.read(&mut vec![0; 4 * 6 * side as usize]));
    let (done, bytes) = peak(|| pool.install(read));
    done.unwrap();
    let told = image.info().memory_bytes as usize;
    println!("{bytes} taken, {told} told");
    assert!(bytes <= told + MIB, "{bytes} taken, {told} told");
}

/// Two pictures of 16 bits: bits in use are looked for before draping, in both.
#[test]
fn the_memory_of_bits_in_use_is_asked_for_before_it_is_taken() {
    let _alone = alone();
    let bench = Bench::new();
    let large = of_bits(&resized(BARE, [1500; 2], [1500; 2]), 16);
    let paths = ["a.j2k", "b.j2k"].map(|name| bench.write(name, &large));
    let terrain = terrasoar_layout::read::terrain::Terrain::open(&bench.path("a.iqt")).unwrap();
    let tight = PictureOptions { memory_mib: Some(16), ..PictureOptions::default() };
    let (refused, bytes) = peak(|| open_images(&paths, Some(terrain.header()), &tight).err());
    let enough = needs_memory(&refused.expect("an error"));
    assert!(bytes < 4 * MIB, "{bytes}");
    let allowed = PictureOptions { memory_mib: Some(enough), ..PictureOptions::default() };
    let (done, bytes) = peak(|| open_images(&paths, Some(terrain.header()), &allowed).map(drop));
    assert!(done.is_ok() && bytes < enough as usize * MIB, "{bytes}");
    // One picture is looked at when it is read.
    assert!(open_images(&paths[..1], Some(terrain.header()), &tight).is_ok());
}

/// Headers are held by every tile at work: of the file and of the stream.
#[test]
fn headers_of_a_jpeg_2000_count_as_memory() {
    let _alone = alone();
    let bench = Bench::new();
    let memory =
        |bytes: &[u8]| open_image(&bench.write("a.jp2", bytes)).unwrap().info().memory_bytes as usize;
    let plain = memory(TILED);
    let profile = 4 << 20;
    let at = find(TILED, b"jp2h") + 4;
    let mut long = TILED.to_vec();
    let size = u32::from_be_bytes(long[at - 8..at - 4].try_into().unwrap()) + 8 + profile;
    long[at - 8..at - 4].copy_from_slice(&size.to_be_bytes());
    // A profile behind the system that counts.
    let end = at + size as usize - 16 - profile as usize;
    long.splice(
        end..end,
        [&(profile + 8).to_be_bytes()[..], b"colr\x02\0\0", &vec![0; profile as usize - 3]].concat(),
    );
    let told = memory(&long);
    let image = open_image(&bench.path("a.jp2")).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (done, bytes) =
        peak(|| pool.install(|| image.rows().and_then(|mut rows| rows.read(&mut vec![0; 4 * 72]))));
    done.unwrap();
    assert!(told >= plain + profile as usize && bytes <= told, "{bytes} taken, {told} told, {plain} before");
    // Segments of a stream's header that nobody reads.
    let style = find(TILED, b"\xff\x52");
    let mut long = TILED.to_vec();
    // The stream goes on to the end of the file.
    let stream = find(TILED, b"jp2c") - 4;
    long[stream..stream + 4].fill(0);
    let segment = [&b"\xff\x5c"[..], &60_000u16.to_be_bytes(), &[0x42; 59_998]].concat();
    long.splice(style..style, segment.repeat(50));
    let told = memory(&long);
    assert!(told >= plain + 3_000_000, "{told}, {plain} before");
}

/// The header of a JPEG that is read in bands is held by each of them.
#[test]
fn a_jpeg_with_a_long_header_is_read_as_a_whole() {
    let _alone = alone();
    let bench = Bench::new();
    let frame = BASELINE.windows(2).position(|p| p == [0xff, 0xc0]).unwrap();
    let mut large = BASELINE.to_vec();
    large[frame + 5..frame + 9].copy_from_slice(&[0x20, 0, 0x20, 0]);
    let plain = open_image(&bench.write("a.jpg", &large)).unwrap().info().memory_bytes;
    let kept = [&[0xff, 0xe0, 0xff, 0xff][..], &[b'x'; 65_533]].concat();
    for (count, is_whole) in [(3, false), (5, true)] {
        let mut long = large.clone();
        long.splice(2..2, kept.repeat(count));
        let told = open_image(&bench.write("a.jpg", &long)).unwrap().info().memory_bytes;
        assert_eq!(told > plain, is_whole, "{count}: {told}, {plain} before");
    }
}

#[test]
fn boxes_of_a_jp2_end() {
    let _alone = alone();
    let bench = Bench::new();
    let head = &TILED[..find(TILED, b"jp2h") - 4];
    let boxes = |kind: &[u8; 4], length: u32, count: usize| {
        [head, &[&length.to_be_bytes()[..], kind].concat().repeat(count)].concat()
    };
    for bytes in [
        boxes(b"free", 8, 1 << 20),
        boxes(b"free", 0, 3),
        boxes(b"free", 4, 3),
        boxes(b"uuid", u32::MAX, 1),
        boxes(b"jp2h", u32::MAX, 2),
        boxes(b"asoc", 16, 1 << 16),
        boxes(b"jp2c", 8, 2),
    ] {
        bench.refusal(&bench.write("a.jp2", &bytes));
    }
    // A box of a GeoTIFF that is none is passed over, with a word.
    let mut other = TILED.to_vec();
    let tiff = find(&other, b"II*\0");
    other[tiff + 4..tiff + 8].fill(0xff);
    let image = open_image(&bench.write("b.jp2", &other)).unwrap();
    assert!(image.info().notes.iter().any(|note| note.contains("GeoJP2")), "{:?}", image.info().notes);
}

#[test]
fn a_webp_is_no_larger_than_it_says() {
    let _alone = alone();
    let bench = Bench::new();
    // A frame of 16,383 x 16,383 in a picture of 72 x 56, behind a header of its own.
    let mut frame = LOSSY[12..].to_vec();
    frame[14..18].copy_from_slice(&[0xff, 0x3f, 0xff, 0x3f]);
    let canvas = [b"VP8X\x0a\0\0\0\0\0\0\0".as_slice(), &[71, 0, 0, 55, 0, 0]].concat();
    let riff = |content: Vec<u8>| {
        [&b"RIFF"[..], &(content.len() as u32 + 4).to_le_bytes(), b"WEBP", &content].concat()
    };
    let said = bench.refusal(&bench.write("a.webp", &riff([canvas, frame.clone()].concat()))).to_string();
    assert!(said.contains("another size"), "{said}");
    // By itself it is a picture of two gigabytes.
    assert!(needs_memory(&bench.refusal(&bench.write("b.webp", &riff(frame)))) > 2000);
    // Chunks without end, and one that is cut short.
    let many = riff([&LOSSY[12..12], &b"ABCD\0\0\0\0".repeat(1 << 16)].concat());
    bench.refusal(&bench.write("c.webp", &many));
    bench.refusal(&bench.write("d.webp", &LOSSY[..LOSSY.len() / 2]));
    // Inside of a TIFF whose tiles are of another size.
    for (size, is_read) in [([72, 56], true), ([80, 56], false)] {
        let mut tags = picture(size, 50001, size, &[(DATA_AT, LOSSY.len() as u32)]);
        tags.push(shorts(259, &[50001]));
        let path = bench.write("e.tif", &tiff(false, tags, LOSSY));
        match is_read {
            true => drop(Bench::new().drape(&path, 256).0.unwrap()),
            false => assert!(bench.refusal(&path).to_string().contains("72 x 56")),
        }
    }
}

/// A stream of JPEG XL of another size: from the 17th bit on a bit that says whether the sides are multiples of 8, and those of height and width.
fn resized_xl(stream: &[u8], [wide, high]: [u32; 2]) -> Vec<u8> {
    let bits: Vec<bool> = stream.iter().flat_map(|byte| (0..8).map(move |at| byte >> at & 1 == 1)).collect();
    // 72 x 56 is kept in short: the bit, five bits of height, three of a ratio, five of width.
    assert!(bits[16], "sides of multiples of 8");
    let mut made = bits[..16].to_vec();
    let mut put = |number: u32, count: u32| made.extend((0..count).map(|at| number >> at & 1 == 1));
    put(0, 1);
    // Of 30 bits each.
    put(3, 2);
    put(high - 1, 30);
    put(0, 3);
    put(3, 2);
    put(wide - 1, 30);
    made.extend(&bits[16 + 1 + 5 + 3 + 5..]);
    made.chunks(8).map(|eight| eight.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit))).collect()
}

#[test]
fn the_memory_of_a_jpeg_xl_is_asked_for_before_it_is_taken() {
    let _alone = alone();
    let bench = Bench::new();
    for (number, stream) in XL.into_iter().enumerate() {
        let path = bench.write("a.jxl", stream);
        let image = open_image(&path).unwrap();
        let (done, bytes) = peak(|| image.rows().and_then(|mut rows| rows.read(&mut vec![0; 4 * 72])));
        done.unwrap();
        let told = image.info().memory_bytes as usize;
        assert!(bytes <= told, "{number}: {bytes} taken, {told} told");
        // Far more texels than the stream has.
        let large = resized_xl(stream, [100_000; 2]);
        let (refused, bytes) = peak(|| bench.refusal(&bench.write("b.jxl", &large)));
        assert!(needs_memory(&refused) > 200_000 && bytes < 4 * MIB, "{number}: {bytes} taken; {refused}");
        // As many as are allowed, of a stream that is damaged by it.
        let allowed = resized_xl(stream, [1200; 2]);
        let path = bench.write("c.jxl", &allowed);
        let image = open_image(&path).unwrap();
        assert_eq!(image.info().texels, [1200; 2]);
        let (_, bytes) = peak(|| image.rows().map(drop));
        let told = image.info().memory_bytes as usize;
        assert!(bytes <= told, "{number}: {bytes} taken, {told} told");
    }
}

/// A colour profile that says it is 200 MB long.
#[test]
fn a_long_colour_profile_of_a_jpeg_xl_is_refused() {
    let _alone = alone();
    let bench = Bench::new();
    let mut bits: Vec<bool> = Vec::new();
    let mut put = |number: u64, count: u32| bits.extend((0..count).map(|at| number >> at & 1 == 1));
    // 72 x 56 texels; not all as usual, no more fields, 8 bits, no channels but the colours, not lossy.
    for (number, count) in
        [(0x0aff, 16), (1, 1), (6, 5), (0, 3), (8, 5), (0, 1), (0, 1), (0, 1), (0, 2), (1, 1), (0, 2), (0, 1)]
    {
        put(number, count);
    }
    // Colours by a profile of RGB; no extensions; usual matrices. Then its length.
    for (number, count) in [
        (0, 1),
        (1, 1),
        (0, 2),
        (0, 2),
        (1, 1),
        (3, 2),
        (200_000_000 & 0xfff, 12),
        (1, 1),
        (200_000_000 >> 12 & 0xff, 8),
        (1, 1),
        (200_000_000 >> 20, 8),
        (0, 1),
    ] {
        put(number, count);
    }
    (0..20).for_each(|_| put(0, 32));
    let bytes: Vec<u8> = bits
        .chunks(8)
        .map(|eight| eight.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit)))
        .collect();
    let (refused, taken) = peak(|| bench.refusal(&bench.write("a.jxl", &bytes)).to_string());
    assert!(refused.contains("colour profile is longer") && taken < 4 * MIB, "{taken} taken; {refused}");
}
