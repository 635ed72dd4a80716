//! Black and white of numbers, and bands by their numbers: what is counted, what is not, and what is refused.

use super::tiff::{DATA_AT, RAW, Tag, longs, shorts, text, tiff};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use terrasoar_import::{PictureOptions, Stretch, open_images};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Columns and rows of the pictures made here.
const SIDE: [u32; 2] = [20, 10];

/// A picture of `bands` side by side in one strip.
fn made(bands: u16, bits: u16, format: u16, more: Vec<Tag>, data: &[u8]) -> Vec<u8> {
    let mut tags = vec![
        longs(256, &[SIDE[0]]),
        longs(257, &[SIDE[1]]),
        shorts(258, &vec![bits; bands.into()]),
        shorts(259, &[RAW]),
        shorts(262, &[1]),
        longs(273, &[DATA_AT]),
        shorts(277, &[bands]),
        longs(279, &[data.len() as u32]),
        shorts(339, &vec![format; bands.into()]),
    ];
    tags.extend(more);
    tiff(false, tags, data)
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn options(stretch: Option<Stretch>, bands: &[u32]) -> PictureOptions {
    let bands = bands.iter().map(|band| NonZero::new(*band).unwrap()).collect();
    PictureOptions { bands, stretch, ..PictureOptions::default() }
}

/// Texels and notes of a picture.
type Shown = (Vec<[u8; 4]>, String);

fn shown(paths: &[PathBuf], options: &PictureOptions) -> Result<Vec<Shown>, LayoutError> {
    let read = |image: &dyn terrasoar_layout::imagery::ImageSource| {
        let [wide, high] = image.info().texels;
        let mut rgba = vec![0; (wide * high * 4) as usize];
        image.rows()?.read(&mut rgba)?;
        Ok((rgba.as_chunks::<4>().0.to_vec(), image.info().notes.join("; ")))
    };
    open_images(paths, None, options)?.iter().map(|image| read(&**image)).collect()
}

fn reals(numbers: impl Iterator<Item = f32>) -> Vec<u8> {
    numbers.flat_map(f32::to_le_bytes).collect()
}

const PERCENT: Option<Stretch> = Some(Stretch::Percentiles(5.0, 95.0));

#[test]
fn percentiles_count_what_is_seen_alone() {
    let folder = Folder::new();
    // 0 to 198 in steps, and one in two is void by its value, is not a number, or is infinite.
    let number = |at: u32| match at % 8 {
        1 | 5 => -9999.0,
        3 => f32::NAN,
        7 => f32::INFINITY,
        _ => at as f32,
    };
    let path = folder.put("a.tif", &made(1, 32, 3, vec![text(42113, "-9999")], &reals((0..200).map(number))));
    let (texels, notes) = shown(&[path], &options(PERCENT, &[])).unwrap().remove(0);
    // Of 100 numbers the fifth is 8 and the ninety-fifth 188.
    assert!(notes.contains("8 to 188 (5 and 95 percent)"), "{notes}");
    for (at, texel) in (0..).zip(&texels) {
        match at % 8 {
            1 | 3 | 5 => assert_eq!(texel[3], 0, "{at}"),
            7 => assert_eq!(*texel, [255; 4], "{at}"),
            _ => {
                let share = ((at as f64 - 8.0) / 180.0).clamp(0.0, 1.0);
                let grey = (share * 255.0 + 0.5) as u8;
                assert_eq!(*texel, [grey, grey, grey, 255], "{at}");
            }
        }
    }
}

#[test]
fn alpha_and_masks_hide_numbers_from_the_count() {
    let folder = Folder::new();
    // Grey and alpha of 16 bits; what is hidden is far brighter.
    let pairs = (0..200u16).flat_map(|at| if at < 100 { [at, u16::MAX] } else { [60_000, 0] });
    let data: Vec<u8> = pairs.flat_map(u16::to_le_bytes).collect();
    let path = folder.put("a.tif", &made(2, 16, 1, vec![shorts(338, &[2])], &data));
    let all = Some(Stretch::Percentiles(0.0, 100.0));
    let (texels, notes) = shown(&[path], &options(all, &[])).unwrap().remove(0);
    assert!(notes.contains("0 to 99 (0 and 100 percent)"), "{notes}");
    assert_eq!([texels[0], texels[99]], [[0, 0, 0, 255], [255; 4]]);
    assert!(texels[100..].iter().all(|texel| texel[3] == 0));
    // A mask beside it.
    let data: Vec<u8> =
        (0..200u16).map(|at| if at < 100 { at } else { 60_000 }).flat_map(u16::to_le_bytes).collect();
    let path = folder.put("b.tif", &made(1, 16, 1, Vec::new(), &data));
    let mask: Vec<u8> = (0..200).map(|at| if at < 100 { 255 } else { 0 }).collect();
    folder.put("b.tif.msk", &made(1, 8, 1, Vec::new(), &mask));
    let (texels, notes) = shown(&[path], &options(all, &[])).unwrap().remove(0);
    assert!(notes.contains("0 to 99 (0 and 100 percent)"), "{notes}");
    assert_eq!((texels[99], texels[150][3]), ([255; 4], 0));
}

#[test]
fn pictures_of_a_mosaic_have_one_black_and_one_white() {
    let folder = Folder::new();
    let grey = |first: u16| (first..first + 200).flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let paths = [0u16, 200, 400, 600]
        .map(|first| folder.put(&format!("{first}.tif"), &made(1, 16, 1, Vec::new(), &grey(first))));
    let together = shown(&paths, &options(PERCENT, &[])).unwrap();
    // Of 800 numbers from 0 on the 40th is 39 and the 760th 759.
    assert!(together.iter().all(|(_, notes)| notes.contains("39 to 759 (5 and 95 percent of all pictures)")));
    assert_eq!((together[0].0[39][0], together[0].0[40][0], together[3].0[159][0]), (0, 0, 255));
    assert_eq!(together[1].0[199][0], ((399.0 - 39.0) / 720.0 * 255.0 + 0.5) as u8);
    // In any order, by any number of threads.
    let mut turned = paths.to_vec();
    turned.reverse();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let again = pool.install(|| shown(&turned, &options(PERCENT, &[]))).unwrap();
        assert!(again.iter().rev().eq(together.iter()));
    }
    // Reals among them: as numbers of one kind.
    let real = folder.put("r.tif", &made(1, 32, 3, Vec::new(), &reals((0..200).map(|at| at as f32 / 2.0))));
    let mixed =
        shown(&[paths[0].clone(), real], &options(Some(Stretch::Percentiles(0.0, 100.0)), &[])).unwrap();
    assert!(mixed.iter().all(|(_, notes)| notes.contains("0 to 199")), "{mixed:?}");
}

#[test]
fn bytes_are_stretched_on_request_and_white_as_zero_stays_so() {
    let folder = Folder::new();
    let data: Vec<u8> = (0..200).map(|at| 50 + at / 2).collect();
    let values = Some(Stretch::Values(50.0, 149.0));
    let path = folder.put("a.tif", &made(1, 8, 1, Vec::new(), &data));
    let texels = shown(&[path], &options(values, &[])).unwrap().remove(0).0;
    assert_eq!([texels[0][0], texels[199][0]], [0, 255]);
    for (bits, step) in [(8, 1), (16, 256)] {
        let numbers = (0..200u16).map(|at| (50 + at / 2) * step);
        let data: Vec<u8> = match bits {
            8 => numbers.map(|number| number as u8).collect(),
            _ => numbers.flat_map(u16::to_le_bytes).collect(),
        };
        let path = folder.put("w.tif", &made(1, bits, 1, vec![shorts(262, &[0])], &data));
        // As bytes it is turned round before, and as numbers after.
        let stretch = match bits {
            8 => Stretch::Values(106.0, 205.0),
            _ => Stretch::Values(50.0 * 256.0, 149.0 * 256.0),
        };
        let texels = shown(&[path], &options(Some(stretch), &[])).unwrap().remove(0).0;
        assert_eq!([texels[0][0], texels[199][0]], [255, 0], "{bits}");
    }
}

#[test]
fn bands_are_chosen_in_every_format() {
    let folder = Folder::new();
    let data: Vec<u8> = (0..200).flat_map(|at| [0, 1, 2, 3, 4].map(|band| at / 2 + 20 * band)).collect();
    let path = folder.put("a.tif", &made(5, 8, 1, Vec::new(), &data));
    let of =
        |bands: &[u32]| shown(std::slice::from_ref(&path), &options(None, bands)).unwrap().remove(0).0[100];
    assert_eq!(of(&[4, 3, 2]), [110, 90, 70, 255]);
    assert_eq!(of(&[5]), [130, 130, 130, 255]);
    assert_eq!(of(&[]), [50, 70, 90, 255]);
    for name in [
        "rgb-strips.tif",
        "rgb-16.png",
        "rgb-tiles.jp2",
        "baseline.jpg",
        "rgba.webp",
        "rgb-planes.tif",
        "rgb-tiles-webp.tif",
    ] {
        let path = super::fixture(name);
        let plain = shown(std::slice::from_ref(&path), &options(None, &[])).unwrap().remove(0).0;
        let turned = shown(std::slice::from_ref(&path), &options(None, &[3, 1, 2])).unwrap().remove(0).0;
        let grey = shown(std::slice::from_ref(&path), &options(None, &[2])).unwrap().remove(0).0;
        for ((plain, turned), grey) in plain.iter().zip(turned).zip(grey) {
            let [r, g, b, a] = *plain;
            assert_eq!((turned, grey), ([b, r, g, a], [g, g, g, a]), "{name}");
        }
        let refused = shown(&[path], &options(None, &[1, 2, 5])).unwrap_err().to_string();
        assert!(refused.contains("there is no band 5") && refused.contains(name), "{refused}");
    }
    let refused = shown(&[path], &options(None, &[1, 2])).unwrap_err().to_string();
    assert!(refused.contains("2 bands make no colours"), "{refused}");
}

#[test]
fn numbers_that_say_no_black_are_refused_with_a_remedy() {
    let folder = Folder::new();
    let float = folder.put("f.tif", &made(1, 32, 3, Vec::new(), &reals((0..200).map(|at| at as f32))));
    let signed = folder.put("s.tif", &made(1, 16, 2, Vec::new(), &[0; 400]));
    for path in [float, signed] {
        let refused = shown(&[path], &options(None, &[])).unwrap_err();
        assert_eq!(refused.remedy(), Some(Remedy::Stretch), "{refused}");
        assert!(refused.to_string().contains("black"), "{refused}");
    }
    // All of it void, or of one number: nothing to divide by.
    let void = folder.put("v.tif", &made(1, 32, 3, Vec::new(), &reals((0..200).map(|_| f32::NAN))));
    assert!(shown(&[void], &options(PERCENT, &[])).unwrap()[0].0.iter().all(|texel| texel[3] == 0));
    let one = folder.put("o.tif", &made(1, 32, 3, Vec::new(), &reals((0..200).map(|_| 7.5))));
    assert!(shown(&[one], &options(PERCENT, &[])).unwrap()[0].0.iter().all(|texel| *texel == [0, 0, 0, 255]));
}

/// The bare stream of a fixture as the only tile of a TIFF.
#[test]
fn jpeg_2000_inside_of_a_tiff_is_read() {
    let folder = Folder::new();
    let stream = std::fs::read(super::fixture("grey.j2k")).unwrap();
    let [wide, high] = super::SIZE;
    let tags = |size: [u32; 2]| {
        vec![
            longs(256, &[size[0]]),
            longs(257, &[size[1]]),
            shorts(258, &[8]),
            shorts(259, &[34712]),
            shorts(262, &[1]),
            longs(273, &[DATA_AT]),
            shorts(277, &[1]),
            longs(278, &[size[1]]),
            longs(279, &[stream.len() as u32]),
        ]
    };
    let path = folder.put("a.tif", &tiff(false, tags([wide, high]), &stream));
    let texels = shown(&[path], &options(None, &[])).unwrap().remove(0).0;
    let bare = shown(&[super::fixture("grey.j2k")], &options(None, &[])).unwrap().remove(0).0;
    assert!(texels == bare && texels[0][0] == super::colour(0, 0)[0]);
    let path = folder.put("b.tif", &tiff(false, tags([wide + 1, high]), &stream));
    let refused = shown(&[path], &options(None, &[])).unwrap_err().to_string();
    assert!(refused.contains("strip 0 of 1") && refused.contains("72 x 56"), "{refused}");
}

/// Reading for percentiles takes no more memory than is allowed.
#[test]
fn memory_is_asked_for_before_percentiles_are_looked_for() {
    let path: &Path = &super::fixture("baseline.jpg");
    let tight = PictureOptions { memory_mib: Some(1), ..options(PERCENT, &[]) };
    let refused = open_images(&[path.to_owned()], None, &tight).err().expect("an error");
    assert!(matches!(refused.remedy(), Some(Remedy::Memory { .. })), "{refused}");
}

/// Numbers of less than a byte are shown as bytes, and so is "no data".
#[test]
fn no_data_of_few_bits_is_a_hole() {
    let folder = Folder::new();
    for bits in 1..8u16 {
        let most = (1u32 << bits) - 1;
        let number = |x: u32, y: u32| (7 * x + 3 * y) & most;
        let mut data = Vec::new();
        for y in 0..SIDE[1] {
            let row =
                (0..SIDE[0]).flat_map(|x| (0..bits).rev().map(move |bit| (number(x, y) >> bit & 1) as u8));
            let row: Vec<u8> = row.collect();
            data.extend(
                row.chunks(8).map(|eight| (0..8).fold(0, |byte, i| byte << 1 | eight.get(i).unwrap_or(&0))),
            );
        }
        for void in 0..=most {
            let path = folder.put("a.tif", &made(1, bits, 1, vec![text(42113, &void.to_string())], &data));
            let texels = shown(&[path], &options(None, &[])).unwrap().remove(0).0;
            for (at, texel) in (0..).zip(texels) {
                let number = number(at % SIDE[0], at / SIDE[0]);
                let alpha = if number == void { 0 } else { 255 };
                assert_eq!(texel[3], alpha, "{number} of {bits} bits, void {void}");
                assert!(texel[0].abs_diff((number * 255 / most) as u8) <= 1, "{number} of {bits} bits");
            }
        }
        let path = folder.put("a.tif", &made(1, bits, 1, vec![text(42113, "300")], &data));
        assert!(shown(&[path], &options(None, &[])).unwrap()[0].0.iter().all(|texel| texel[3] == 255));
    }
}

/// A grey picture with a palette beside it is shown in its colours, as GDAL does, and in grey where a person asks for the band.
#[test]
fn a_palette_of_a_picture_that_calls_itself_grey_counts() {
    let folder = Folder::new();
    let colours: Vec<u16> =
        (0..768u32).map(|i| (i % 256 * 257) as u16 ^ [0, 0xffff, 0x0f0f][i as usize / 256]).collect();
    let data: Vec<u8> = (0..200).collect();
    let path = folder.put("a.tif", &made(1, 8, 1, vec![shorts(320, &colours)], &data));
    let (texels, notes) = shown(std::slice::from_ref(&path), &options(None, &[])).unwrap().remove(0);
    for (at, texel) in (0u8..).zip(texels) {
        assert_eq!(texel, [at, at ^ 0xff, at ^ 0x0f, 255]);
    }
    assert!(notes.contains("has a palette"), "{notes}");
    let (texels, notes) = shown(&[path], &options(None, &[1])).unwrap().remove(0);
    assert!((0u8..).zip(texels).all(|(at, texel)| texel == [at, at, at, 255]) && notes.is_empty(), "{notes}");
    let short = folder.put("b.tif", &made(1, 8, 1, vec![shorts(320, &colours[..300])], &data));
    let (texels, notes) = shown(&[short], &options(None, &[])).unwrap().remove(0);
    assert!(texels[7] == [7, 7, 7, 255] && notes.contains("300 numbers does not go"), "{notes}");
}

/// Inks and places in a palette have no bits in use: they leave a picture beside them as bright as it is.
#[test]
fn inks_and_palettes_of_a_mosaic_change_no_brightness() {
    let folder = Folder::new();
    let land = folder.0.path().join("a.iqt");
    super::common::drape::land(&land);
    let terrain = terrasoar_layout::read::terrain::Terrain::open(&land).unwrap();
    let words = |numbers: &[u16]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let dark: Vec<u16> = (0..200).map(|at| at * 20).collect();
    let dark = folder.put("dark.tif", &made(1, 16, 1, Vec::new(), &words(&dark)));
    let inks = words(&[60_000, 30_000, 65_535, 1000].repeat(200));
    let inks = folder.put("inks.tif", &made(4, 16, 1, vec![shorts(262, &[5])], &inks));
    let colours: Vec<u16> = (0..3 * 65_536u32).map(|i| (i % 65_536) as u16).collect();
    let table = vec![shorts(262, &[3]), shorts(320, &colours)];
    let places: Vec<u16> = (0..200).map(|at| 65_535 - at).collect();
    let places = folder.put("places.tif", &made(1, 16, 1, table, &words(&places)));
    for other in [inks, places] {
        let images =
            open_images(&[dark.clone(), other], Some(terrain.header()), &PictureOptions::default()).unwrap();
        let mut rgba = vec![0; (SIDE[0] * SIDE[1] * 4) as usize];
        images[0].rows().unwrap().read(&mut rgba).unwrap();
        for (at, texel) in rgba.as_chunks::<4>().0.iter().enumerate() {
            assert_eq!(usize::from(texel[0]), (at * 20) >> 4, "{at}");
        }
        // And the other is as it is alone.
        let alone = open_images(&[images[1].path().to_owned()], None, &PictureOptions::default()).unwrap();
        let mut both = [rgba.clone(), rgba];
        images[1].rows().unwrap().read(&mut both[0]).unwrap();
        alone[0].rows().unwrap().read(&mut both[1]).unwrap();
        assert!(both[0] == both[1]);
    }
}

/// "No data" beside a picture of 16 bits counts with a stretch alone, and the note says so.
#[test]
fn no_data_beside_a_picture_of_16_bits_is_told() {
    let folder = Folder::new();
    let data: Vec<u8> = (0..200u16).map(|at| at * 300).flat_map(u16::to_le_bytes).collect();
    let path = folder.put("a.tif", &made(1, 16, 1, Vec::new(), &data));
    folder.put(
        "a.tif.aux.xml",
        b"<PAMDataset><PAMRasterBand band=\"1\"><NoDataValue>300</NoDataValue></PAMRasterBand></PAMDataset>",
    );
    let (texels, notes) = shown(std::slice::from_ref(&path), &options(None, &[])).unwrap().remove(0);
    assert!(notes.contains("\"no data\" 300") && notes.contains("black and white"), "{notes}");
    assert_eq!(texels[1][3], 255);
    let (texels, notes) = shown(&[path], &options(PERCENT, &[])).unwrap().remove(0);
    assert!(!notes.contains("no data") && texels[1][3] == 0, "{notes}");
}
