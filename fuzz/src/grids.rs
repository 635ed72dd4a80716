//! Elevation data of formats that are told by a name, by a label beside them or by what a person says; each a way in of its own.

use crate::import::read;
use crate::seeds::{Inputs, with_png_sums};
use std::io::Write;
use terrasoar_import::OpenOptions;

/// Inputs with names.
fn named<const N: usize>(inputs: [(&str, Vec<u8>); N]) -> Inputs {
    inputs.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect()
}

/// Heights of a little ground as text, with something between them.
fn heights(count: usize, between: &str) -> String {
    (0..count).map(|i| format!("{}{between}", 100 + i % 7 * 3)).collect()
}

/// Esri ASCII grids.
pub(crate) mod ascii_grid {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let corner = "ncols 6\nnrows 5\nxllcorner 100\nyllcorner 200\ncellsize 10\nNODATA_value -9999\n";
        let centre = "\u{feff}NROWS 5\r\nNCOLS 6\r\nXLLCENTER 1,5\r\nYLLCENTER 2,5\r\nDX 10\r\nDY 20\r\n";
        named([
            ("corner", format!("{corner}{}", heights(30, " ")).into_bytes()),
            ("centre", format!("{centre}{}", heights(30, "\r\n")).into_bytes()),
            ("voids", format!("{corner}{}", "-9999 nan 1.5 -1e3 7,25 1.#QNAN ".repeat(5)).into_bytes()),
            ("wide", format!("ncols 300\nnrows 20\n{}", heights(6000, "\n")).into_bytes()),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.asc", data)], &OpenOptions::default());
    }
}

/// Surfer grids, as text and binary.
pub(crate) mod surfer {
    use super::*;

    /// Counts and sides, then samples.
    fn binary_6() -> Vec<u8> {
        let mut bytes = b"DSBB\x06\0\x05\0".to_vec();
        bytes.extend([100.0f64, 150.0, 200.0, 240.0, 0.0, 9.0].iter().flat_map(|side| side.to_le_bytes()));
        bytes.extend((0..30).flat_map(|i| if i == 7 { 1.70141e38f32 } else { i as f32 }.to_le_bytes()));
        bytes
    }

    fn binary_7() -> Vec<u8> {
        let section = |name: &[u8; 4], content: Vec<u8>| {
            [&name[..], &(content.len() as u32).to_le_bytes(), &content].concat()
        };
        let counts = [5i32, 6].into_iter().flat_map(|count| count.to_le_bytes());
        let reals = [100.0f64, 200.0, 10.0, 10.0, 0.0, 9.0, 0.0, 1.70141e38];
        let grid = counts.chain(reals.iter().flat_map(|real| real.to_le_bytes())).collect();
        let data = (0..30).flat_map(|i| f64::from(i).to_le_bytes()).collect();
        [
            section(b"DSRB", vec![1, 0, 0, 0]),
            section(b"FLTI", vec![0; 8]),
            section(b"GRID", grid),
            section(b"DATA", data),
        ]
        .concat()
    }

    pub(crate) fn seeds() -> Inputs {
        let head = "DSAA\r\n6 5\r\n100 150\r\n200 240\r\n0 9\r\n";
        named([
            ("text", format!("{head}{}", heights(30, " ")).into_bytes()),
            ("blanks", format!("{head}{}", "1.70141e+038 1,5 -1e3 7.25 2 nan\n".repeat(5)).into_bytes()),
            ("binary 6", binary_6()),
            ("binary 7", binary_7()),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.grd", data)], &OpenOptions::default());
    }
}

/// XYZ grids.
pub(crate) mod xyz {
    use super::*;

    fn points(line: impl Fn(usize, usize) -> String) -> Vec<u8> {
        (0..30).map(|i| line(i % 6, i / 6)).collect::<String>().into_bytes()
    }

    pub(crate) fn seeds() -> Inputs {
        let shuffled =
            (0..30).map(|i| i * 7 % 30).map(|i| format!("{} {} {}\n", i % 6, i / 6, i)).collect::<String>();
        named([
            ("rows", points(|x, y| format!("{} {} {}\n", 10 * x, 500 - 10 * y, x + y))),
            ("columns", points(|x, y| format!("{};{};{}\r\n", y, x, x * y).replace('.', ","))),
            (
                "header",
                [b"lon,lat,depth\n".to_vec(), points(|x, y| format!("{}.5,{}.25,{}\n", x, y, x + 1))]
                    .concat(),
            ),
            ("any order", shuffled.into_bytes()),
            (
                "gaps",
                points(|x, y| {
                    if (x * y) % 3 == 1 { "# none\n".into() } else { format!("{x} {y} nan\n{x} {y} 5\n") }
                }),
            ),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.xyz", data)], &OpenOptions::default());
    }
}

/// Labels, and data behind the first byte of zero.
pub(crate) mod labelled {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let data: Vec<u8> = (0..600u16).flat_map(|i| (i % 37 * 3).to_le_bytes()).collect();
        let with = |label: &str| [label.as_bytes(), &[0], &data].concat();
        named([
            (
                "bil",
                with(
                    "BYTEORDER I\nLAYOUT BIL\nNROWS 15\nNCOLS 20\nNBANDS 2\nNBITS 16\nPIXELTYPE SIGNEDINT\nULXMAP 5\nULYMAP 9\nXDIM 1\nYDIM 1\nNODATA 0\n",
                ),
            ),
            (
                "flt",
                with(
                    "ncols 20\nnrows 15\nxllcorner 1\nyllcorner 2\ncellsize 3\nbyteorder LSBFIRST\nnbits 32\npixeltype float\n",
                ),
            ),
            (
                "gaps",
                with(
                    "nrows 10\nncols 10\nnbits 16\nskipbytes 8\nlayout bsq\nbandrowbytes 24\nbandgapbytes 4\nnbands 2\n",
                ),
            ),
            (
                "envi",
                with(
                    "ENVI\nsamples = 20\nlines = 15\nbands = 2\ndata type = 2\ninterleave = bip\nbyte order = 1\nmap info = {UTM, 1, 1, 5, 9, 1, 1, 33, North, WGS-84, rotation=30}\nband names = {a,\n b}\n",
                ),
            ),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        let ends = data.iter().position(|byte| *byte == 0).unwrap_or(data.len());
        let (label, numbers) = data.split_at(ends);
        read(
            &[("dem.bil", numbers.get(1..).unwrap_or_default()), ("dem.hdr", label)],
            &OpenOptions::default(),
        );
    }
}

/// Netpbm pictures.
pub(crate) mod netpbm {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let bytes: Vec<u8> = (0..120).collect();
        let with = |head: &str| [head.as_bytes(), &bytes].concat();
        named([
            ("bytes", with("P5\n# a remark\n12 10\n255\n")),
            ("words", with("P5 10 6 65535\n")),
            ("text", format!("P2 6 5 255\n{}", heights(30, "\n")).into_bytes()),
            ("reals", with("Pf\n6 5\n-1.0\n")),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.pnm", data)], &OpenOptions::default());
    }
}

/// A line with a shape, and the data.
pub(crate) mod raw {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let bytes: Vec<u8> = (0..128u8).collect();
        let with = |shape: &str| [shape.as_bytes(), b"\n", &bytes].concat();
        named([
            ("bytes", with("16x8:u8")),
            ("words", with("8x8:u16be")),
            ("reals", with("8x4:f32le")),
            ("doubles", with("4x4:f64be")),
            ("square", with("")),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        let ends = data.iter().position(|byte| *byte == b'\n').unwrap_or(data.len());
        let (shape, numbers) = data.split_at(ends);
        let shape = String::from_utf8_lossy(shape).into_owned();
        let options = OpenOptions { raw: (!shape.is_empty()).then_some(shape), ..OpenOptions::default() };
        read(&[("dem.r16", numbers.get(1..).unwrap_or_default())], &options);
    }
}

/// Tiles: packed, archived or plain, by how they begin.
pub(crate) mod tiles {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let tile: Vec<u8> = (0..144i16).flat_map(|i| (i % 12 * (i / 12)).to_be_bytes()).collect();
        let gzipped = {
            let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
            packer.write_all(&tile).and_then(|()| packer.finish()).unwrap_or_default()
        };
        named([
            ("plain", tile.clone()),
            ("gzip", gzipped),
            ("zip", zipped(&["N10E010.hgt"], &tile).unwrap_or_default()),
            ("several", zipped(&["a/N10E010.hgt", "a/N11E010.hgt", "readme"], &tile).unwrap_or_default()),
        ])
    }

    fn zipped(names: &[&str], tile: &[u8]) -> Option<Vec<u8>> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut writer = zip::ZipWriter::new(&mut bytes);
        for name in names {
            writer.start_file(*name, zip::write::SimpleFileOptions::default()).ok()?;
            writer.write_all(tile).ok()?;
        }
        writer.finish().ok()?;
        Some(bytes.into_inner())
    }

    pub(crate) fn body(data: &[u8]) {
        let name = if data.starts_with(b"\x1f\x8b") {
            "N10E010.hgt.gz"
        } else if data.starts_with(b"PK") {
            "N10E010.hgt.zip"
        } else {
            "N10E010.hgt"
        };
        read(&[(name, data)], &OpenOptions::default());
    }
}

/// Colours that are heights, by a packing that the first byte chooses; and PNG in seven passes.
pub(crate) mod packed_png {
    use super::*;

    const PACKINGS: [Option<&str>; 4] = [None, Some("mapbox"), Some("terrarium"), Some("1,2,3,-4")];

    /// A PNG of 9 x 7 pixels of a colour type.
    fn png(color: u8, depth: u8, is_interlaced: bool) -> Option<Vec<u8>> {
        let size = match color {
            2 => 3,
            6 => 4,
            _ => usize::from(depth / 8),
        };
        // As many bytes as any order of rows needs: of seven passes those of 9 x 7 are eighteen rows.
        let rows: Vec<u8> =
            (0..9 * 7 * size + 18).map(|i| if i % (9 * size + 1) == 0 { 0 } else { (i % 3) as u8 }).collect();
        let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        packer.write_all(&rows).ok()?;
        let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
        let mut chunk = |name: &[u8; 4], data: &[u8]| {
            png.extend((data.len() as u32).to_be_bytes());
            png.extend(name);
            png.extend(data);
            png.extend([0; 4]);
        };
        chunk(b"IHDR", &[0, 0, 0, 9, 0, 0, 0, 7, depth, color, 0, 0, u8::from(is_interlaced)]);
        chunk(b"IDAT", &packer.finish().ok()?);
        chunk(b"IEND", &[]);
        Some(with_png_sums(&png))
    }

    pub(crate) fn seeds() -> Inputs {
        let with = |packing: u8, png: Option<Vec<u8>>| [vec![packing], png.unwrap_or_default()].concat();
        named([
            ("mapbox", with(1, png(2, 8, false))),
            ("terrarium", with(2, png(6, 8, false))),
            ("factors", with(3, png(2, 8, true))),
            ("found", with(0, png(6, 8, true))),
            ("grey", with(0, png(0, 16, true))),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        let Some((packing, png)) = data.split_first() else { return };
        let decode = PACKINGS[usize::from(*packing) % PACKINGS.len()].map(str::to_owned);
        read(&[("dem.png", &with_png_sums(png))], &OpenOptions { decode, ..OpenOptions::default() });
    }
}
