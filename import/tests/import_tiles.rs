//! `.hgt` tiles of unlike shapes, packed ones, archives and folders of them.

mod import_support;

use import_support::{Grid, collect, read, refusal};
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, open_with};

/// Bytes of a tile whose height at (col, row) is given.
fn tile(sides: [u32; 2], height: impl Fn(u32, u32) -> i16) -> Vec<u8> {
    (0..sides[0] * sides[1]).flat_map(|i| height(i % sides[0], i / sides[0]).to_be_bytes()).collect()
}

fn ground(col: u32, row: u32) -> i16 {
    (col % 1000) as i16 * 3 + (row % 1000) as i16 * 7 - 500
}

fn is_ground(grid: &Grid, sides: [u32; 2], shown: &str) {
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], sides, "{shown}");
    for (i, sample) in grid.samples.iter().enumerate() {
        assert_eq!(*sample, f64::from(ground(i as u32 % sides[0], i as u32 / sides[0])), "{shown}: {i}");
    }
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(bytes).unwrap();
    packer.finish().unwrap()
}

/// An archive of files; `is_packed` for each.
fn zipped(files: &[(&str, &[u8], bool)]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = zip::ZipWriter::new(&mut bytes);
    for (name, data, is_packed) in files {
        let method =
            if *is_packed { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
        writer
            .start_file(*name, zip::write::SimpleFileOptions::default().compression_method(method))
            .unwrap();
        writer.write_all(data).unwrap();
    }
    writer.finish().unwrap();
    bytes.into_inner()
}

fn put(path: PathBuf, bytes: &[u8]) -> PathBuf {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn shapes_and_packings_of_one_tile() {
    let folder = tempdir().unwrap();
    for sides in [[1201, 1201], [1801, 3601], [601, 1201], [601, 601], [33, 33]] {
        let bytes = tile(sides, ground);
        let files = [
            ("N60E010.hgt", bytes.clone()),
            ("N60E010.SRTMGL1.hgt", bytes.clone()),
            ("N60E010.hgt.gz", gzipped(&bytes)),
            ("N60E010.SRTMGL1.hgt.zip", zipped(&[("N60E010.hgt", &bytes, true)])),
            ("any.zip", zipped(&[("readme.txt", b"see", true), ("a/N60E010.hgt", &bytes, false)])),
        ];
        for (name, bytes) in files {
            let path = put(folder.path().join(name), &bytes);
            let grid = read(&[path]).unwrap_or_else(|error| panic!("{error}"));
            is_ground(&grid, sides, name);
            let [across, down] = sides.map(|side| 1.0 / f64::from(side - 1));
            assert_eq!(
                grid.info.georeference.pixel_to_crs,
                Some([10.0, across, 0.0, 61.0, 0.0, -down]),
                "{name}"
            );
        }
    }
    // Both borders of a degree make an odd number of heights a side.
    let warnings = |side: u32| {
        let path = put(folder.path().join("N61E010.hgt"), &tile([side; 2], ground));
        open_with(&[path], &OpenOptions::default()).unwrap().warnings()
    };
    let is_told = |side| warnings(side).iter().any(|warning| warning.words.contains("both borders"));
    assert!(is_told(40) && !is_told(41));
    // A shape that no tile has must be stated.
    let path = put(folder.path().join("N60E010.hgt"), &tile([50, 40], ground));
    assert!(refusal(std::slice::from_ref(&path)).contains("state its shape"));
    let stated = |shape: &str| {
        let options = OpenOptions { raw: Some(shape.into()), ..OpenOptions::default() };
        collect(&*open_with(std::slice::from_ref(&path), &options)?)
    };
    let grid = stated("50x40:i16be").unwrap();
    is_ground(&grid, [50, 40], "stated");
    assert_eq!(grid.info.georeference.pixel_to_crs.unwrap()[0], 10.0);
    assert!(stated("50x40:u16le").err().unwrap().to_string().contains("i16be"));
    assert!(stated("50x41:i16be").err().unwrap().to_string().contains("no tile"));
}

/// Four tiles whose ground goes on over their borders, and a hole.
fn four(folder: &Path, file: impl Fn(&Path, &str, &[u8])) {
    for (name, col, row) in [("N01E010", 0, 0), ("N01E011", 20, 0), ("N00E010", 0, 20)] {
        let bytes =
            tile(
                [21, 21],
                |c, r| if (c, r) == (0, 0) && col > 0 { -32768 } else { ground(c + col, r + row) },
            );
        file(folder, name, &bytes);
    }
}

fn is_four(grid: &Grid, shown: &str) {
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [41, 41], "{shown}");
    for (i, sample) in grid.samples.iter().enumerate() {
        let (col, row) = (i as u32 % 41, i as u32 / 41);
        if col > 20 && row > 20 {
            assert!(sample.is_nan(), "{shown}: {col} {row}");
        } else {
            assert_eq!(*sample, f64::from(ground(col, row)), "{shown}: {col} {row}");
        }
    }
}

#[test]
fn folders_and_archives_of_tiles() {
    let folder = tempdir().unwrap();
    let plain = folder.path().join("plain");
    four(&plain, |folder, name, bytes| {
        put(folder.join(format!("{name}.hgt")), bytes);
        put(folder.join(format!("{name}.html")), b"<html>");
    });
    is_four(&read(std::slice::from_ref(&plain)).unwrap(), "plain");
    let mixed = folder.path().join("mixed");
    four(&mixed, |folder, name, bytes| {
        let (name, bytes) = match name {
            "N01E010" => ("deep/er/N01E010.hgt.zip", zipped(&[("N01E010.hgt", bytes, true)])),
            "N01E011" => ("N01E011.SRTMGL1.hgt.gz", gzipped(bytes)),
            _ => {
                put(folder.join("N00E010.hgt.gz"), &gzipped(&tile([21, 21], |_, _| 1)));
                ("N00E010.hgt", bytes.to_vec())
            }
        };
        put(folder.join(name), &bytes);
    });
    is_four(&read(&[mixed]).unwrap(), "mixed");
    let mut files = Vec::new();
    let names = std::sync::Mutex::new(&mut files);
    four(folder.path(), |_, name, bytes| {
        names.lock().unwrap().push((format!("M32/{name}.hgt"), bytes.to_vec()))
    });
    let listed: Vec<(&str, &[u8], bool)> =
        files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice(), true)).collect();
    is_four(&read(&[put(folder.path().join("M32.zip"), &zipped(&listed))]).unwrap(), "archive");
    // What is no folder of tiles.
    let empty = folder.path().join("empty");
    put(empty.join("notes.md"), b"x");
    for more in ["notes.txt", "a.tif", "b.tif"] {
        put(empty.join(more), b"x");
        let said = refusal(std::slice::from_ref(&empty));
        assert!(
            said.contains("no elevation data in this folder that says where it lies; name the file"),
            "{said}"
        );
    }
    put(empty.join("hdr.adf"), b"x");
    assert!(refusal(&[empty]).contains("ARC/INFO"));
}

/// Towards the poles tiles have fewer columns. Between the columns of the narrower one heights are on straight lines, which `ground` is not, so a plane is laid out.
#[test]
fn tiles_of_unlike_shape_become_one_grid() {
    let folder = tempdir().unwrap();
    let plane = |across: u32, down: u32| move |col: u32, row: u32| (col * across + row * down) as i16;
    let wide = put(folder.path().join("N49E010.hgt"), &tile([1201, 1201], plane(2, 3)));
    let narrow = put(folder.path().join("N50E010.hgt"), &tile([601, 1201], plane(4, 3)));
    let grid = read(&[wide.clone(), narrow.clone()]).unwrap();
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [1201, 2401]);
    for (col, row) in [(0, 0), (3, 0), (777, 500), (1200, 1199), (600, 2), (1199, 700)] {
        assert_eq!(grid.at(col, row), f64::from(col * 2 + row * 3), "{col} {row}");
        assert_eq!(grid.at(col, row + 1200), f64::from(col * 2 + row * 3), "{col} {row}");
    }
    assert_eq!(grid.voids(), 0);
    assert!(grid.info.format.starts_with("mosaic of 2 files"), "{}", grid.info.format);
    let small = put(folder.path().join("N48E010.hgt"), &tile([601, 601], ground));
    assert_eq!(read(&[wide, small, narrow]).unwrap().info.samples_high, 3601);
}

/// A packed tile is read whole or not at all.
#[test]
fn a_damaged_tile_of_several_is_void_and_named() {
    let folder = tempdir().unwrap();
    let west = put(folder.path().join("N00E010.hgt"), &tile([33, 33], |_, _| 5));
    let mut packed = gzipped(&tile([33, 33], ground));
    let middle = packed.len() / 2;
    packed[middle..middle + 8].fill(0xff);
    let east = put(folder.path().join("N00E011.hgt.gz"), &packed);
    let open = |strict| {
        let options = OpenOptions { strict, ..OpenOptions::default() };
        terrasoar_import::open_with(&[west.clone(), east.clone()], &options).unwrap()
    };
    let dem = open(false);
    let grid = collect(&*dem).unwrap();
    assert!((0..33).all(|row| {
        (0..33).all(|col| grid.at(col, row) == 5.0 && grid.at(col + 32, row).is_nan() == (col > 0))
    }));
    let said: Vec<String> = dem.warnings().into_iter().map(|warning| warning.words).collect();
    assert!(said.len() == 1 && said[0].contains("N00E011.hgt.gz") && said[0].contains("void"), "{said:?}");
    assert!(collect(&*open(true)).err().unwrap().to_string().contains("N00E011.hgt.gz"));
}

#[test]
fn packed_tiles_that_lie_are_told() {
    let folder = tempdir().unwrap();
    let bytes = tile([33, 33], ground);
    let lie = |name: &str, bytes: &[u8]| refusal(&[put(folder.path().join(name), bytes)]);
    let packed = gzipped(&bytes);
    let mut longer = packed.clone();
    let at = longer.len() - 4;
    longer[at..].copy_from_slice(&(2 * 34 * 34u32).to_le_bytes());
    assert!(lie("N01E001.hgt.gz", &longer).contains("packed heights"));
    longer[at..].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(lie("N01E001.hgt.gz", &longer).contains("more than can be packed"));
    let mut padded = vec![0; 5 << 20];
    padded[..longer.len()].copy_from_slice(&longer);
    padded.extend(u32::MAX.to_le_bytes());
    assert!(lie("N01E001.hgt.gz", &padded).contains("more than any tile"));
    longer[at..].copy_from_slice(&7u32.to_le_bytes());
    assert!(lie("N01E001.hgt.gz", &longer).contains("no tile"));
    let said = lie("N01E001.hgt.gz", &packed[..packed.len() / 2]);
    assert!(said.contains("no tile") || said.contains("more than"), "{said}");
    let twice = [packed.clone(), packed].concat();
    assert!(lie("N01E001.hgt.gz", &twice).contains("packed heights"));
    let archive = zipped(&[("N01E001.hgt", &bytes, true)]);
    assert!(lie("N01E001.zip", &archive[..archive.len() - 30]).contains("zip archive"));
    let mut flipped = archive.clone();
    flipped[60] ^= 0x55;
    assert!(lie("N01E001.zip", &flipped).contains("unpacked"));
    assert!(lie("b.zip", &zipped(&[("readme.txt", b"see", true)])).contains("unpack it"));
    // A directory that is said to be long.
    let mut long = archive;
    let end = long.len() - 22;
    long[end + 10..end + 12].copy_from_slice(&u16::MAX.to_le_bytes());
    assert!(lie("c.zip", &long).contains("zip archive"));
}
