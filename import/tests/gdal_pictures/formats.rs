//! Pictures of every format, kind of colours and depth, texel by texel against what GDAL reads of the same file, as bytes.

use super::chroma;
use super::made::{self, Band};
use super::shown::shown;
use super::tools;
use std::path::{Path, PathBuf};
use terrasoar_import::PictureOptions;

const SIZE: [usize; 2] = [61, 47];

/// What the bands are called.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Grey,
    GreyAlpha,
    Rgb,
    Rgba,
    Cmyk,
    /// Places in a palette of so many bits.
    Palette(u32),
    YCbCr,
    /// Colours in another order, which the file says.
    Bgr,
    Brga,
}

impl Kind {
    fn bands(self) -> &'static [&'static str] {
        match self {
            Self::Grey => &["Gray"],
            Self::GreyAlpha => &["Gray", "Alpha"],
            Self::Rgb | Self::YCbCr => &["Red", "Green", "Blue"],
            Self::Rgba => &["Red", "Green", "Blue", "Alpha"],
            Self::Cmyk => &["Cyan", "Magenta", "Yellow", "Black"],
            Self::Palette(_) => &["Palette"],
            Self::Bgr => &["Blue", "Green", "Red"],
            Self::Brga => &["Blue", "Red", "Green", "Alpha"],
        }
    }

    /// A number of a band, of 8 bits.
    fn value(self, band: usize, at: usize) -> u32 {
        let (col, row) = ((at % SIZE[0]) as u32, (at / SIZE[0]) as u32);
        let smooth = [20 + 3 * col + row, 30 + col + 3 * row, 230 - 2 * col - row, 10 + col + 2 * row][band];
        match self {
            Self::Palette(bits) => (col / 3 + row / 2) % (1 << bits),
            _ if self.bands()[band] == "Alpha" => {
                if col < 20 {
                    0
                } else {
                    255
                }
            }
            _ => smooth,
        }
    }
}

#[derive(Debug, Clone)]
struct Case {
    driver: &'static str,
    name: &'static str,
    kind: Kind,
    bits: u32,
    creation: &'static [&'static str],
    /// Most that a texel may be off.
    near: u8,
}

fn make(folder: &Path, case: &Case) -> Result<PathBuf, String> {
    let bytes = if case.bits > 8 { 2 } else { 1 };
    let band = |(band, name): (usize, &&str)| {
        let number = |at: usize| case.kind.value(band, at) << (case.bits.max(8) - 8);
        let number = |at: usize| {
            if *name == "Alpha" && number(at) > 0 { (1 << case.bits.max(8)) - 1 } else { number(at) }
        };
        let table = match case.kind {
            Kind::Palette(bits) => {
                let entry = |i: u32| {
                    let [r, g, b] = [i * 37 % 256, i * 91 % 256, 255 - i * 13 % 256];
                    format!("<Entry c1=\"{r}\" c2=\"{g}\" c3=\"{b}\" c4=\"255\"/>")
                };
                format!("<ColorTable>{}</ColorTable>", (0..1 << bits).map(entry).collect::<String>())
            }
            _ => String::new(),
        };
        Band {
            said: format!("<ColorInterp>{name}</ColorInterp>{table}"),
            numbers: (0..SIZE[0] * SIZE[1])
                .flat_map(|at| number(at).to_le_bytes()[..bytes].to_vec())
                .collect(),
        }
    };
    let bands: Vec<Band> = case.kind.bands().iter().enumerate().map(band).collect();
    let mut arguments = vec!["-of", case.driver];
    case.creation.iter().for_each(|option| arguments.extend(["-co", option]));
    let gdal = if case.bits > 8 { "UInt16" } else { "Byte" };
    made::make(folder, SIZE, (gdal, bytes), &bands, (case.name, &arguments))
}

/// What GDAL reads, as RGBA of bytes: colours it expands, inks it has as light or as inks.
fn theirs(folder: &Path, case: &Case) -> Result<Vec<u8>, String> {
    let mut arguments = vec!["-q", "-of", "ENVI", "-co", "INTERLEAVE=BIP"];
    if matches!(case.kind, Kind::Palette(_)) {
        arguments.extend(["-expand", "rgb"]);
    }
    arguments.extend([case.name, "read.img"]);
    tools::try_run(folder, "gdal_translate", &arguments, true)?;
    let bytes = std::fs::read(folder.join("read.img")).map_err(|error| error.to_string())?;
    let wide: Vec<u32> = match case.bits {
        ..=8 => bytes.iter().map(|byte| u32::from(*byte)).collect(),
        bits => bytes
            .as_chunks::<2>()
            .0
            .iter()
            .map(|pair| u32::from(u16::from_le_bytes(*pair)) >> (bits - 8))
            .collect(),
    };
    let channels = wide.len() / (SIZE[0] * SIZE[1]);
    Ok(wide
        .chunks_exact(channels)
        .map(|texel| match channels {
            1 => [texel[0], texel[0], texel[0], 255],
            2 => [texel[0], texel[0], texel[0], texel[1]],
            3 => [texel[0], texel[1], texel[2], 255],
            _ => [texel[0], texel[1], texel[2], texel[3]],
        })
        .flat_map(|[a, b, c, alpha]| match case.kind {
            Kind::Bgr => [c, b, a, alpha],
            Kind::Brga => [b, c, a, alpha],
            _ => [a, b, c, alpha],
        })
        .map(|number| number as u8)
        .collect())
}

fn check(case: &Case) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let path = make(folder.path(), case)?;
    let (ours, _) = shown(&[path], &PictureOptions::default())?;
    let theirs = theirs(folder.path(), case)?;
    if ours[0].len() != theirs.len() {
        return Err(format!("{} bytes here, {} of GDAL", ours[0].len(), theirs.len()));
    }
    let texels = ours[0].as_chunks::<4>().0.iter().zip(theirs.as_chunks::<4>().0);
    for (at, (ours, theirs)) in texels.enumerate() {
        // What nobody sees may be anything.
        let count = if ours[3] == 0 && theirs[3] == 0 { 0 } else { 4 };
        if ours.iter().zip(theirs).take(count).any(|(a, b)| a.abs_diff(*b) > case.near) {
            return Err(format!(
                "texel {}, {}: {ours:?} here, {theirs:?} of GDAL",
                at % SIZE[0],
                at / SIZE[0]
            ));
        }
    }
    Ok(())
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut add = |driver, name, kind, bits, creation, near| {
        cases.push(Case { driver, name, kind, bits, creation, near });
    };
    for kind in [Kind::Rgb, Kind::Rgba] {
        add("WEBP", "p.webp", kind, 8, &["LOSSLESS=YES"], 0);
        add("WEBP", "p.webp", kind, 8, &["QUALITY=95"], 3);
    }
    let exact: [&[&str]; 5] = [
        &["REVERSIBLE=YES", "QUALITY=100"],
        &["REVERSIBLE=YES", "QUALITY=100", "BLOCKXSIZE=32", "BLOCKYSIZE=32"],
        &[
            "REVERSIBLE=YES",
            "QUALITY=100",
            "BLOCKXSIZE=32",
            "BLOCKYSIZE=32",
            "PROGRESSION=RPCL",
            "RESOLUTIONS=3",
        ],
        &[
            "REVERSIBLE=YES",
            "QUALITY=100",
            "BLOCKXSIZE=64",
            "BLOCKYSIZE=64",
            "SOP=YES",
            "EPH=YES",
            "PRECINCTS={32,32},{16,16}",
        ],
        &["REVERSIBLE=YES", "QUALITY=100", "CODEC=J2K", "PLT=YES"],
    ];
    for kind in [Kind::Grey, Kind::GreyAlpha, Kind::Rgb, Kind::Rgba] {
        for (bits, creation) in
            [8, 12, 16].into_iter().flat_map(|bits| exact.map(|creation| (bits, creation)))
        {
            let is_bare = creation.contains(&"CODEC=J2K");
            if is_bare && kind.bands().contains(&"Alpha") {
                continue;
            }
            // The bits in use are those of the brightest texel, so alpha beside 12 bits would be of other bits.
            if bits == 12 && kind.bands().contains(&"Alpha") {
                continue;
            }
            add("JP2OpenJPEG", if is_bare { "p.j2k" } else { "p.jp2" }, kind, bits, creation, 0);
        }
    }
    for (kind, creation) in
        [Kind::Bgr, Kind::Brga].into_iter().flat_map(|kind| [exact[0], exact[1]].map(|c| (kind, c)))
    {
        add("JP2OpenJPEG", "p.jp2", kind, 8, creation, 0);
    }
    add("JP2OpenJPEG", "p.jp2", Kind::Rgb, 8, &["QUALITY=60"], 2);
    add(
        "JP2OpenJPEG",
        "p.jp2",
        Kind::Rgb,
        8,
        &["QUALITY=60", "YCBCR420=YES", "BLOCKXSIZE=32", "BLOCKYSIZE=32"],
        4,
    );
    add("JP2OpenJPEG", "p.jp2", Kind::Palette(8), 8, &["REVERSIBLE=YES", "QUALITY=100"], 0);
    add(
        "JP2OpenJPEG",
        "p.jp2",
        Kind::Palette(4),
        8,
        &["REVERSIBLE=YES", "QUALITY=100", "BLOCKXSIZE=32", "BLOCKYSIZE=32"],
        0,
    );
    add("JPEG", "p.jpg", Kind::Cmyk, 8, &["QUALITY=100"], 3);
    for creation in [
        &["PHOTOMETRIC=CMYK"][..],
        &["PHOTOMETRIC=CMYK", "INTERLEAVE=BAND", "COMPRESS=LZW"],
        &[
            "PHOTOMETRIC=CMYK",
            "TILED=YES",
            "BLOCKXSIZE=16",
            "BLOCKYSIZE=16",
            "COMPRESS=DEFLATE",
            "PREDICTOR=2",
        ],
    ] {
        add("GTiff", "p.tif", Kind::Cmyk, 8, creation, 1);
    }
    for bits in [1, 2, 4, 8] {
        let creation: &[&str] = match bits {
            1 => &["NBITS=1"],
            2 => &["NBITS=2", "COMPRESS=LZW"],
            4 => &["NBITS=4", "COMPRESS=DEFLATE", "TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=16"],
            _ => &["COMPRESS=PACKBITS"],
        };
        add("GTiff", "p.tif", Kind::Palette(bits), 8, creation, 0);
    }
    add("PNG", "p.png", Kind::Palette(4), 8, &[], 0);
    for kind in [Kind::Grey, Kind::GreyAlpha, Kind::Rgb, Kind::Rgba] {
        for (bits, creation) in [8, 16].into_iter().flat_map(|bits| {
            [
                &["INTERLEAVE=BAND"][..],
                &["INTERLEAVE=BAND", "COMPRESS=ZSTD", "TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=16"],
            ]
            .map(|creation| (bits, creation))
        }) {
            add("GTiff", "p.tif", kind, bits, creation, 0);
        }
        add("PNG", "p.png", kind, 16, &[], 0);
    }
    add("GTiff", "p.tif", Kind::Rgb, 8, &["INTERLEAVE=BAND", "COMPRESS=JPEG", "JPEG_QUALITY=100"], 4);
    for creation in [
        &["PHOTOMETRIC=YCBCR", "COMPRESS=JPEG", "JPEG_QUALITY=100"][..],
        &[
            "PHOTOMETRIC=YCBCR",
            "COMPRESS=JPEG",
            "JPEG_QUALITY=100",
            "TILED=YES",
            "BLOCKXSIZE=32",
            "BLOCKYSIZE=32",
        ],
    ] {
        add("GTiff", "p.tif", Kind::YCbCr, 8, creation, 4);
    }
    for (kind, creation, near) in [
        (Kind::Rgb, &["COMPRESS=WEBP", "WEBP_LOSSLESS=YES"][..], 0),
        (
            Kind::Rgba,
            &["COMPRESS=WEBP", "WEBP_LOSSLESS=YES", "TILED=YES", "BLOCKXSIZE=32", "BLOCKYSIZE=32"],
            0,
        ),
        (Kind::Rgb, &["COMPRESS=WEBP", "WEBP_LEVEL=95", "TILED=YES", "BLOCKXSIZE=32", "BLOCKYSIZE=32"], 3),
    ] {
        add("GTiff", "p.tif", kind, 8, creation, near);
    }
    cases
}

#[test]
#[ignore = "needs gdal_translate"]
fn every_format_and_kind_of_colours_is_shown_as_gdal_reads_it() {
    let only = std::env::var("TERRASOAR_ONLY").ok();
    let cases: Vec<Case> = cases()
        .into_iter()
        .filter(|case| only.as_ref().is_none_or(|only| format!("{case:?}").contains(only)))
        .collect();
    assert!(!cases.is_empty(), "{only:?} names no picture");
    let wrong: Vec<String> =
        cases.iter().filter_map(|case| check(case).err().map(|words| format!("{case:?}: {words}"))).collect();
    println!("{} of {} pictures agree", cases.len() - wrong.len(), cases.len());
    assert!(wrong.is_empty(), "{} of {} differ:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}

/// GDAL hands these to libtiff, which cuts luma and chroma to whole numbers before it makes colours of them.
#[test]
#[ignore = "needs gdal_translate"]
fn luma_and_chroma_are_shown_as_gdal_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let mut compared = 0;
    for case in chroma::all() {
        // In tiles that reach beyond the picture libtiff loses its way in units of 4 x 4.
        if case.is_tiled() && case.steps == [4, 4] {
            continue;
        }
        std::fs::write(&path, chroma::file(case)).unwrap();
        let (ours, _) = shown(std::slice::from_ref(&path), &PictureOptions::default()).unwrap();
        let arguments = [
            "-q",
            "-of",
            "ENVI",
            "-co",
            "INTERLEAVE=BIP",
            "-b",
            "1",
            "-b",
            "2",
            "-b",
            "3",
            "a.tif",
            "read.img",
        ];
        // Not everything that TIFF allows is read by libtiff.
        if tools::try_run(folder.path(), "gdal_translate", &arguments, true).is_err() {
            continue;
        }
        compared += 1;
        let theirs = std::fs::read(folder.path().join("read.img")).unwrap();
        let count = (chroma::SIZE[0] * chroma::SIZE[1]) as usize;
        assert!(ours[0].len() == 4 * count && theirs.len() == 3 * count, "{case:?}");
        for (at, (ours, theirs)) in
            ours[0].as_chunks::<4>().0.iter().zip(theirs.as_chunks::<3>().0).enumerate()
        {
            let off = (0..3).map(|i| ours[i].abs_diff(theirs[i])).max();
            assert!(off <= Some(4), "{case:?}, texel {at}: {ours:?} here, {theirs:?} of GDAL");
        }
    }
    println!("{compared} of {} agree", chroma::all().len());
    assert!(compared > 12, "{compared}");
}
