//! PNG, VTP BT and SRTM tiles; and what is said to files that are none of these.

mod import_support;

use std::path::PathBuf;

use import_support::{Grid, data, read, refusal, write_hgt};
use tempfile::tempdir;
use terrasoar_layout::dem::{HorizontalUnit, SampleType};

const VOID: i16 = -32768;

#[test]
fn puget_sound_png() {
    let grid = read(&[data("puget_sound_1025.png")]).unwrap();
    assert_eq!((grid.info.samples_wide, grid.info.samples_high), (1025, 1025));
    assert_eq!((grid.info.sample_type, grid.info.height_scale), (SampleType::U16, 1.0));
    assert_eq!(grid.info.georeference, Default::default());
    // Largest value and checksum as GDAL reads them.
    assert_eq!(grid.samples.iter().copied().fold(0.0, f64::max), 43798.0);
    assert_eq!(grid.voids(), 0);
}

#[test]
fn crater_lake_bt() {
    let grid = read(&[data("crater_lake_1025.bt")]).unwrap();
    let georeference = &grid.info.georeference;
    assert_eq!(georeference.epsg, Some(26710));
    assert_eq!(georeference.unit, HorizontalUnit::Metre);
    assert_eq!(grid.info.height_scale, 0.25);
    let map = georeference.pixel_to_crs.unwrap();
    // Extent / samples, first sample half a spacing inside.
    assert!((map[1] - 10.081280487804879).abs() < 1e-12 && (map[5] + 13.639024390243902).abs() < 1e-12);
    assert!(
        (map[0] - (561133.125 + map[1] / 2.0)).abs() < 1e-9
            && (map[3] - (4760971.5 + map[5] / 2.0)).abs() < 1e-9
    );
    let heights: Vec<f64> = grid.samples.iter().map(|raw| raw * 0.25).collect();
    assert_eq!(heights.iter().copied().fold(f64::MAX, f64::min), 1521.5);
    assert_eq!(heights.iter().copied().fold(f64::MIN, f64::max), 2477.0);
}

/// A BT file of 3 columns and 2 rows of heights 1 to 6, the last one void.
fn bt(version: u8, float: bool, size: u8) -> Vec<u8> {
    let mut file = vec![0; 256];
    file[..10].copy_from_slice(format!("binterr1.{version}").as_bytes());
    file[10] = 3;
    file[14] = 2;
    file[18] = size;
    file[if version == 0 { 42 } else { 20 }] = u8::from(float);
    file[22] = 1;
    file[24..26].copy_from_slice(&(-33i16).to_le_bytes());
    if version == 0 {
        for (at, extent) in [(26, 10f32), (30, 40.0), (34, 100.0), (38, 120.0)] {
            file[at..at + 4].copy_from_slice(&extent.to_le_bytes());
        }
    } else {
        file[26..28].copy_from_slice(&6326i16.to_le_bytes());
        for (at, extent) in [(28, 10f64), (36, 40.0), (44, 100.0), (52, 120.0)] {
            file[at..at + 8].copy_from_slice(&extent.to_le_bytes());
        }
    }
    for height in [1, 2, 3, 4, 5, -32768i16] {
        match (size, float) {
            (2, _) => file.extend(height.to_le_bytes()),
            (_, true) => file.extend(f32::from(height).to_le_bytes()),
            _ => file.extend(i32::from(height).to_le_bytes()),
        }
    }
    file
}

#[test]
fn bt_versions_and_types() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("t.bt");
    for version in 0..4 {
        for (float, size) in [(false, 2), (false, 4), (true, 4)] {
            std::fs::write(&path, bt(version, float, size)).unwrap();
            let grid = read(std::slice::from_ref(&path)).unwrap();
            assert_eq!(format!("{:?}", grid.samples), "[2.0, 4.0, NaN, 1.0, 3.0, 5.0]", "1.{version}");
            let georeference = &grid.info.georeference;
            assert_eq!(georeference.pixel_to_crs, Some([15.0, 10.0, 0.0, 115.0, 0.0, -10.0]), "1.{version}");
            assert_eq!(georeference.epsg, if version == 0 { None } else { Some(32733) });
            assert_eq!(grid.info.height_scale, 1.0);
        }
    }
    let mut wrong = bt(3, false, 2);
    wrong[14] = 200;
    std::fs::write(&path, &wrong).unwrap();
    assert!(refusal(std::slice::from_ref(&path)).contains("cut short"));
    std::fs::write(&path, bt(3, true, 2)).unwrap();
    assert!(refusal(std::slice::from_ref(&path)).contains("float32"));
    wrong[9] = b'4';
    std::fs::write(&path, &wrong).unwrap();
    assert!(refusal(&[path]).contains("1.0 to 1.3"));
}

/// Height of a landscape at a sample of the mosaic counted from 0 E, 0 N; neighbours agree on their border.
fn agreed(col: i64, row: i64) -> i16 {
    ((col * 7 + row * 13) % 5000) as i16
}

fn tile_name(lat: i64, lon: i64) -> String {
    let (ns, ew) = (if lat < 0 { 'S' } else { 'N' }, if lon < 0 { 'W' } else { 'E' });
    format!("{ns}{:02}{ew}{:03}.hgt", lat.abs(), lon.abs())
}

fn write_agreed(folder: &std::path::Path, lat: i64, lon: i64, side: u32) -> PathBuf {
    let path = folder.join(tile_name(lat, lon));
    let step = i64::from(side) - 1;
    write_hgt(&path, side, |col, row| {
        agreed(lon * step + i64::from(col) + 4000, i64::from(row) - lat * step + 4000)
    });
    path
}

#[test]
fn hgt_mosaic_with_a_gap() {
    let folder = tempdir().unwrap();
    let side = 1201;
    // An L of three tiles across the equator and Greenwich; the south-eastern one is missing.
    let paths: Vec<PathBuf> = [(0, -1), (0, 0), (-1, -1)]
        .iter()
        .map(|(lat, lon)| write_agreed(folder.path(), *lat, *lon, side))
        .collect();
    let grid = read(&paths).unwrap();
    assert_eq!((grid.info.samples_wide, grid.info.samples_high), (2401, 2401));
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    assert_eq!(map, [-1.0, 1.0 / 1200.0, 0.0, 1.0, 0.0, -1.0 / 1200.0]);
    for row in 0..2401u32 {
        for col in 0..2401u32 {
            let height = grid.at(col, row);
            if col > 1200 && row > 1200 {
                assert!(height.is_nan(), "{col} {row}");
            } else {
                assert_eq!(
                    height,
                    f64::from(agreed(i64::from(col) - 1200 + 4000, i64::from(row) + 4000)),
                    "{col} {row}"
                );
            }
        }
    }
}

#[test]
fn hgt_borders_prefer_heights_to_voids() {
    let folder = tempdir().unwrap();
    let in_folder = |name: &str| folder.path().join(name);
    let read_all = |paths: &[PathBuf]| -> Grid { read(paths).unwrap() };
    let names = ["N01E010.hgt", "N01E011.hgt", "N00E010.hgt", "N00E011.hgt"].map(in_folder);
    // Each tile has one height all over, so a sample tells which tile gave it.
    for (height, path) in (1..).zip(&names) {
        write_hgt(path, 3, |_, _| height);
    }
    let grid = read_all(&names);
    #[rustfmt::skip]
    assert_eq!(grid.samples, [
        1., 1., 2., 2., 2.,
        1., 1., 2., 2., 2.,
        3., 3., 4., 4., 4.,
        3., 3., 4., 4., 4.,
        3., 3., 4., 4., 4.,
    ]);
    // Voids along its borders give way to the neighbour in the north, then the west, then both.
    write_hgt(&names[3], 3, |col, row| if col == 0 || row == 0 { VOID } else { 4 });
    let grid = read_all(&names);
    assert_eq!([grid.at(2, 2), grid.at(3, 2), grid.at(4, 2), grid.at(2, 3)], [2., 2., 2., 3.]);
    write_hgt(&names[1], 3, |_, row| if row == 2 { VOID } else { 2 });
    let grid = read_all(&names);
    assert_eq!([grid.at(2, 2), grid.at(2, 3)], [3., 3.]);
    assert!(grid.at(3, 2).is_nan());
    write_hgt(&names[2], 3, |_, _| VOID);
    let grid = read_all(&names);
    assert_eq!(grid.at(2, 2), 1.0);
}

#[test]
fn hgt_mistakes() {
    let folder = tempdir().unwrap();
    let in_folder = |name: &str| folder.path().join(name);
    let (a, b) = (in_folder("N01E010.hgt"), in_folder("N01E011.hgt"));
    write_hgt(&a, 3, |_, _| 1);
    write_hgt(&b, 5, |_, _| 1);
    // Unlike steps are no mistake: the finer ones are those of both.
    let both = read(&[a.clone(), b]).unwrap().info;
    assert_eq!([both.samples_wide, both.samples_high], [9, 5]);
    assert!(refusal(&[a.clone(), a.clone()]).contains("same tile"));
    let unnamed = in_folder("mountain.HGT");
    write_hgt(&unnamed, 3, |_, _| 1);
    assert!(refusal(&[a.clone(), unnamed.clone()]).contains("N29E080.hgt"));
    let alone = read(&[unnamed]).unwrap();
    assert_eq!(
        (alone.info.georeference.unit, alone.info.georeference.pixel_to_crs),
        (HorizontalUnit::Degree, None)
    );
    let far = in_folder("S60W170.hgt");
    write_hgt(&far, 3, |_, _| 1);
    assert!(refusal(&[a.clone(), far]).contains("scattered"));
    let cut = in_folder("N02E010.hgt");
    std::fs::write(&cut, [0; 19]).unwrap();
    assert!(refusal(&[cut]).contains("cut short"));
    assert!(refusal(&[a, data("crater_lake_1025.bt")]).contains("1,048,577 on a side"));
}

#[test]
fn hgt_mosaic_across_the_antimeridian() {
    let folder = tempdir().unwrap();
    let (east, west) = (folder.path().join("N10E179.hgt"), folder.path().join("N10W180.hgt"));
    write_hgt(&east, 3, |_, _| 1);
    write_hgt(&west, 3, |_, _| 2);
    let grid = read(&[west, east]).unwrap();
    assert_eq!((grid.info.samples_wide, grid.info.samples_high), (5, 3));
    assert_eq!(grid.samples[..5], [1., 1., 2., 2., 2.]);
    assert_eq!(grid.info.georeference.pixel_to_crs.unwrap()[0], 179.0);
}

/// A PNG of 4 x 3 made by the crate's encoder, with whatever `set` changes.
fn png(
    color: png::ColorType,
    depth: png::BitDepth,
    bytes: &[u8],
    set: impl Fn(&mut png::Info<'_>),
) -> Vec<u8> {
    let mut info = png::Info::with_size(4, 3);
    info.color_type = color;
    info.bit_depth = depth;
    set(&mut info);
    let mut file = Vec::new();
    let mut writer = png::Encoder::with_info(&mut file, info).unwrap().write_header().unwrap();
    writer.write_image_data(bytes).unwrap();
    writer.finish().unwrap();
    file
}

#[test]
fn png_kinds() {
    use png::{BitDepth, ColorType};
    let folder = tempdir().unwrap();
    let path = folder.path().join("t.png");
    let bytes: Vec<u8> = (0..24).collect();
    std::fs::write(&path, png(ColorType::Grayscale, BitDepth::Eight, &bytes[..12], |_| ())).unwrap();
    let grid = read(std::slice::from_ref(&path)).unwrap();
    assert_eq!(grid.info.sample_type, SampleType::U8);
    assert_eq!(grid.samples, (0..12).map(f64::from).collect::<Vec<_>>());
    // The transparent grey is void.
    let with_void = |info: &mut png::Info<'_>| info.trns = Some(vec![2, 3].into());
    std::fs::write(&path, png(ColorType::Grayscale, BitDepth::Sixteen, &bytes, with_void)).unwrap();
    let grid = read(std::slice::from_ref(&path)).unwrap();
    assert!(grid.at(1, 0).is_nan() && grid.voids() == 1);
    assert_eq!(grid.at(2, 0), f64::from(0x0405));
    let with_void = |info: &mut png::Info<'_>| info.trns = Some(vec![0, 7].into());
    std::fs::write(&path, png(ColorType::Grayscale, BitDepth::Eight, &bytes[..12], with_void)).unwrap();
    let grid = read(std::slice::from_ref(&path)).unwrap();
    assert!(grid.at(3, 1).is_nan() && grid.voids() == 1);
    std::fs::write(&path, png(ColorType::Rgb, BitDepth::Eight, &[0; 36], |_| ())).unwrap();
    let message = refusal(std::slice::from_ref(&path));
    assert!(message.contains("8-bit RGB PNG") && message.contains("gdal_translate"), "{message}");
    // Interlaced by its header alone: seven passes take more bytes than its rows. Set the flag and repair the header's checksum.
    let mut interlaced = png(ColorType::Grayscale, BitDepth::Eight, &bytes[..12], |_| ());
    interlaced[28] = 1;
    let checksum = crc32fast::hash(&interlaced[12..29]);
    interlaced[29..33].copy_from_slice(&checksum.to_be_bytes());
    std::fs::write(&path, interlaced).unwrap();
    let message = refusal(&[path]);
    assert!(message.contains("damaged") || message.contains("ends early"), "{message}");
}

#[test]
fn strangers_are_named() {
    let folder = tempdir().unwrap();
    let say = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        refusal(&[path])
    };
    assert!(say("a.jpg", b"\xff\xd8\xff\xe0 and so on").contains("JPEG picture"));
    // The name decides nothing.
    assert!(say("a.tif", b"\xff\xd8\xff\xe0 and so on").contains("JPEG picture"));
    assert!(say("a.zip", b"PK\x03\x04....").contains("unpack"));
    assert!(say("a.asc", b"ncols 100\nnrows 100\n").contains("100 x 100 samples do not fit"));
    assert!(say("a.iqt", b"whatever it is").contains("already built"));
    let unknown = say("a.dat", b"what is this");
    assert!(
        unknown.contains("unknown") && unknown.contains("GeoTIFF") && unknown.contains(".hgt"),
        "{unknown}"
    );
    assert!(say("empty.tif", b"").contains("empty"));
    // The one file of the folder that is elevation data.
    assert!(refusal(&[folder.path().to_owned()]).contains("100 x 100 samples do not fit"));
    assert!(refusal(&[folder.path().join("missing.tif")]).contains("missing.tif"));
    assert!(refusal(&[]).contains("no elevation file"));
    // Right by content, wrong by name.
    let renamed = folder.path().join("png.hgt");
    std::fs::copy(data("puget_sound_1025.png"), &renamed).unwrap();
    assert_eq!(read(&[renamed]).unwrap().info.format, "16-bit PNG");
}
