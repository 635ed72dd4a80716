//! Pictures of every kind that GDAL writes, brought onto a terrain, held against what gdalwarp makes of them on the same texels and against arithmetic.
//!
//! Ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal_pictures -- --ignored`. One by itself: `TERRASOAR_ONLY='JPEG'`.

#[path = "pictures/chroma.rs"]
mod chroma;
#[path = "gdal_pictures/formats.rs"]
mod formats;
#[path = "gdal_pictures/made.rs"]
mod made;
#[path = "gdal_pictures/shown.rs"]
mod shown;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;
#[path = "import_support/tools.rs"]
mod tools;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use terrasoar_import::{open_file, open_images_on};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::file::header::Header;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::testing::one_in;

/// Columns and rows of a picture.
const SIZE: [usize; 2] = [60, 50];

/// How what is not picture is told.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Hidden {
    Nothing,
    Alpha,
    InsideMask,
    MaskFile,
    Nodata,
}

/// What the bands are called.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Bands {
    Grey,
    Rgb,
    /// Three, of which nothing is said.
    Untagged,
}

#[derive(Debug, Clone)]
struct Case {
    driver: &'static str,
    name: &'static str,
    creation: Vec<&'static str>,
    bits: u32,
    bands: Bands,
    hidden: Hidden,
    /// Columns and rows to units of a texel, east and north.
    turn: [[f64; 2]; 2],
    system: &'static str,
    corner: [f64; 2],
    step: f64,
}

const NORTH_UP: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, -1.0]];
const TURNS: [[[f64; 2]; 2]; 5] = [
    NORTH_UP,
    [[1.0, 0.0], [0.0, 1.0]],
    [[-1.0, 0.0], [0.0, -1.0]],
    [[0.8, 0.6], [0.6, -0.8]],
    [[0.0, 1.0], [1.0, 0.0]],
];
/// Systems in which the picture may be, and a place there that is on the terrain.
const SYSTEMS: [(&str, [f64; 2], f64); 4] = [
    ("EPSG:32632", [500_060.0, 4_999_950.0], 4.0),
    ("EPSG:4326", [9.000_9, 45.153], 0.000_05),
    ("EPSG:3857", [1_001_980.0, 5_645_652.0], 6.0),
    ("EPSG:3035", [4_242_315.0, 2_449_535.0], 4.0),
];

impl Case {
    fn map(&self) -> [f64; 6] {
        let [[a, b], [c, d]] = self.turn.map(|row| row.map(|number| number * self.step));
        // The middle of the picture stays where it is.
        let [x, y] = [0.5 * SIZE[0] as f64, 0.5 * SIZE[1] as f64];
        let middle = [self.corner[0] + x * self.step, self.corner[1] - y * self.step];
        [middle[0] - a * x - b * y, a, b, middle[1] - c * x - d * y, c, d]
    }

    fn channels(&self) -> usize {
        if self.bands == Bands::Grey { 1 } else { 3 }
    }

    fn is_hidden(&self, col: usize, row: usize) -> bool {
        self.hidden != Hidden::Nothing && (20..31).contains(&col) && (10..22).contains(&row)
    }

    /// A number of 8 bits; of more bits it is as many times as large.
    fn number(&self, channel: usize, col: usize, row: usize) -> u32 {
        let plane = [20 + 3 * col + row, 30 + col + 3 * row, 230 - 2 * col - row][channel] as u32;
        plane << (self.bits - 8)
    }

    fn label(&self) -> String {
        let Self { bits, turn, system, bands, hidden, driver, creation, .. } = self;
        format!("{driver} {creation:?} {bits} bits {bands:?}, hidden by {hidden:?}, {system} {turn:?}")
    }

    fn make(&self, folder: &Path) -> Result<PathBuf, String> {
        let kind = if self.bits > 8 { "UInt16" } else { "Byte" };
        let bytes = if self.bits > 8 { 2 } else { 1 };
        let mut vrt = format!(
            "<VRTDataset rasterXSize=\"{}\" rasterYSize=\"{}\">\n<SRS dataAxisToSRSAxisMapping=\"{}\">{}</SRS>\n<GeoTransform>{}</GeoTransform>\n",
            SIZE[0],
            SIZE[1],
            if matches!(self.system, "EPSG:4326" | "EPSG:3035") { "2,1" } else { "1,2" },
            self.system,
            self.map().map(|number| format!("{number:.17e}")).join(", ")
        );
        let band = |kind: &str, bytes: usize, number: usize, inner: &str| {
            format!(
                "<VRTRasterBand dataType=\"{kind}\" band=\"{number}\" subClass=\"VRTRawRasterBand\">{inner}<SourceFilename relativetoVRT=\"1\">{number}.raw</SourceFilename>\
                 <ImageOffset>0</ImageOffset><PixelOffset>{bytes}</PixelOffset><LineOffset>{}</LineOffset><ByteOrder>LSB</ByteOrder></VRTRasterBand>\n",
                bytes * SIZE[0]
            )
        };
        let put = |number: usize, bytes: usize, of: &dyn Fn(usize, usize) -> u32| {
            let places = (0..SIZE[1]).flat_map(|row| (0..SIZE[0]).map(move |col| (col, row)));
            let raw: Vec<u8> =
                places.flat_map(|(col, row)| of(col, row).to_le_bytes()[..bytes].to_vec()).collect();
            std::fs::write(folder.join(format!("{number}.raw")), raw).map_err(|error| error.to_string())
        };
        let colours = if self.bands == Bands::Rgb {
            ["Red", "Green", "Blue"]
        } else {
            ["Gray", "Undefined", "Undefined"]
        };
        let channels = self.channels();
        for (channel, colour) in colours.into_iter().enumerate().take(channels) {
            let is_void = self.hidden == Hidden::Nodata;
            put(channel + 1, bytes, &|col, row| {
                if is_void && self.is_hidden(col, row) { 0 } else { self.number(channel, col, row) }
            })?;
            let nodata = if is_void { "<NoDataValue>0</NoDataValue>" } else { "" };
            let inner = format!("{nodata}<ColorInterp>{colour}</ColorInterp>");
            vrt += &band(kind, bytes, channel + 1, &inner);
        }
        let full = (1 << self.bits.max(8)) - 1;
        let shown = |col, row| if self.is_hidden(col, row) { 0 } else { full };
        match self.hidden {
            Hidden::Alpha => {
                put(channels + 1, bytes, &shown)?;
                vrt += &band(kind, bytes, channels + 1, "<ColorInterp>Alpha</ColorInterp>");
            }
            Hidden::InsideMask | Hidden::MaskFile => {
                put(9, 1, &|col, row| shown(col, row).min(255))?;
                let mask = band("Byte", 1, 9, "").replace(" band=\"9\"", "");
                let _ = write!(vrt, "<MaskBand>{mask}</MaskBand>");
            }
            _ => {}
        }
        vrt += "</VRTDataset>";
        std::fs::write(folder.join("source.vrt"), vrt).map_err(|error| error.to_string())?;
        let inside = if self.hidden == Hidden::InsideMask { "YES" } else { "NO" };
        let mut arguments = vec!["-q", "-of", self.driver, "--config", "GDAL_TIFF_INTERNAL_MASK", inside];
        for option in &self.creation {
            arguments.extend(["-co", option]);
        }
        arguments.extend(["source.vrt", self.name]);
        tools::try_run(folder, "gdal_translate", &arguments, true)?;
        Ok(folder.join(self.name))
    }

    /// Brings the picture onto the terrain and compares. What is wrong, in words.
    fn check(&self, folder: &Path, header: &Header) -> Result<usize, String> {
        let path = self.make(folder)?;
        let image = open_images_on(&[path], header).map_err(|error| format!("refused: {error}"))?.remove(0);
        let [wide, high] = image.info().texels.map(|side| side as usize);
        let map = image.info().georeference.pixel_to_crs.ok_or("it has no place")?;
        let mut ours = vec![0; wide * high * 4];
        let mut rows = image.rows().map_err(|error| error.to_string())?;
        rows.read(&mut ours).map_err(|error| error.to_string())?;
        let (west, north) = (map[0] - 0.5 * map[1], map[3] - 0.5 * map[5]);
        let sides = [west, north + map[5] * high as f64, west + map[1] * wide as f64, north];
        let sides = sides.map(|side| format!("{side:.10}"));
        let size = [wide, high].map(|side| side.to_string());
        let arguments = [
            "-q",
            "-overwrite",
            "-et",
            "0",
            "-t_srs",
            "EPSG:32632",
            "-r",
            "bilinear",
            "-dstalpha",
            "-of",
            "ENVI",
            "-te",
            &sides[0],
            &sides[1],
            &sides[2],
            &sides[3],
            "-ts",
            &size[0],
            &size[1],
            self.name,
            "warped.img",
        ];
        tools::try_run(folder, "gdalwarp", &arguments, true)?;
        let theirs = std::fs::read(folder.join("warped.img")).map_err(|error| error.to_string())?;
        let bytes = if self.bits > 8 { 2 } else { 1 };
        let planes = theirs.len() / (wide * high * bytes);
        let sample = |plane: usize, at: usize| {
            let at = (plane * wide * high + at) * bytes;
            theirs[at..at + bytes].iter().rev().fold(0u32, |sum, byte| sum << 8 | u32::from(*byte))
        };
        if planes != self.channels() + 1 {
            return Err(format!("gdalwarp made {planes} bands"));
        }
        // A tenth of a texel, a rounding, and what decoders of JPEG do differently.
        let near = 2 + if self.driver == "JPEG" || self.creation.contains(&"COMPRESS=JPEG") { 4 } else { 0 };
        let (mut same, mut rim) = (0, 0);
        for at in 0..wide * high {
            let [r, g, b, a] = [0, 1, 2, 3].map(|channel| u32::from(ours[4 * at + channel]));
            let alpha = sample(planes - 1, at);
            if (a < 128) != (alpha < 1 << (self.bits.max(8) - 1)) {
                rim += 1;
            } else if a >= 128 {
                let wanted: Vec<u32> =
                    (0..planes - 1).map(|plane| sample(plane, at) >> (self.bits - 8)).collect();
                let wanted =
                    if wanted.len() == 1 { [wanted[0]; 3] } else { [wanted[0], wanted[1], wanted[2]] };
                let off = [r, g, b].iter().zip(wanted).map(|(ours, theirs)| ours.abs_diff(theirs)).max();
                if off > Some(near) {
                    return Err(format!(
                        "texel {}, {}: {r} {g} {b}, gdalwarp has {wanted:?}",
                        at % wide,
                        at / wide
                    ));
                }
                same += 1;
            }
        }
        if rim * 20 > wide * high || same * 4 < SIZE[0] * SIZE[1] {
            return Err(format!(
                "{rim} of {} texels are picture on one side alone, {same} agree",
                wide * high
            ));
        }
        Ok(same)
    }
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let tiff: [&[&str]; 4] = [
        &[],
        &["TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=16", "COMPRESS=DEFLATE"],
        &["COMPRESS=LZW", "PREDICTOR=2"],
        &["COMPRESS=JPEG", "JPEG_QUALITY=100"],
    ];
    let files: Vec<(&str, &str, &[&str])> = tiff
        .into_iter()
        .map(|creation| ("GTiff", "p.tif", creation))
        .chain([
            ("PNG", "p.png", &["WORLDFILE=YES"][..]),
            ("JPEG", "p.jpg", &["WORLDFILE=YES", "QUALITY=100"][..]),
            ("WEBP", "p.webp", &["LOSSLESS=YES"][..]),
            ("JP2OpenJPEG", "p.jp2", &["REVERSIBLE=YES", "QUALITY=100", "GMLJP2=NO"][..]),
            (
                "JP2OpenJPEG",
                "p.jp2",
                &["REVERSIBLE=YES", "QUALITY=100", "GeoJP2=NO", "BLOCKXSIZE=32", "BLOCKYSIZE=32"][..],
            ),
        ])
        .collect();
    for (driver, name, creation) in files {
        let is_jpeg = driver == "JPEG" || creation.contains(&"COMPRESS=JPEG");
        for bits in [8, 12, 16] {
            // Of 16 bits the darkest picture must reach the highest bit, or it is of fewer.
            if bits > 8 && (is_jpeg || driver == "WEBP") {
                continue;
            }
            for bands in [Bands::Grey, Bands::Rgb, Bands::Untagged] {
                if bands == Bands::Untagged && (driver != "GTiff" || is_jpeg)
                    || bands == Bands::Grey && driver == "WEBP"
                {
                    continue;
                }
                for hidden in
                    [Hidden::Nothing, Hidden::Alpha, Hidden::InsideMask, Hidden::MaskFile, Hidden::Nodata]
                {
                    let fits = match hidden {
                        Hidden::Nothing => true,
                        Hidden::Alpha => !is_jpeg && bands != Bands::Untagged && bits != 12,
                        Hidden::InsideMask => driver == "GTiff",
                        Hidden::MaskFile => driver != "PNG",
                        Hidden::Nodata => !is_jpeg && driver == "GTiff",
                    };
                    for (i, turn) in TURNS.into_iter().enumerate().filter(|_| fits) {
                        // GDAL writes a box of a GeoTIFF without the sign of rows that go north.
                        if creation.contains(&"GMLJP2=NO") && turn == TURNS[1] {
                            continue;
                        }
                        let (system, corner, step) = SYSTEMS[(cases.len() + i) % SYSTEMS.len()];
                        cases.push(Case {
                            driver,
                            name,
                            creation: creation.to_vec(),
                            bits,
                            bands,
                            hidden,
                            turn,
                            system,
                            corner,
                            step,
                        });
                    }
                }
            }
        }
    }
    // Every second: of five turns each comes to every kind.
    cases.into_iter().step_by(4).collect()
}

/// A terrain in UTM, 400 by 300 m.
fn terrain(folder: &Path) -> Header {
    let grid = folder.join("land.asc");
    let rows = format!("{}\n", "7 ".repeat(41)).repeat(31);
    std::fs::write(
        &grid,
        format!("ncols 41\nnrows 31\nxllcenter 500000\nyllcenter 4999700\ncellsize 10\n{rows}"),
    )
    .unwrap();
    std::fs::write(folder.join("land.prj"), "EPSG:32632").unwrap();
    build(&*open_file(&grid).unwrap(), &folder.join("land.iqt"), &BuildOptions::default(), &Silent).unwrap()
}

#[test]
#[ignore = "needs gdalwarp"]
fn pictures_lie_where_gdalwarp_puts_them() {
    let folder = tempfile::tempdir().unwrap();
    let header = terrain(folder.path());
    let only = std::env::var("TERRASOAR_ONLY").ok();
    let all = cases();
    assert!(all.len() >= 150, "{}", all.len());
    let cases: Vec<Case> = match &only {
        Some(only) => all.into_iter().filter(|case| case.label().contains(only)).collect(),
        None => one_in(3, all).collect(),
    };
    let (next, wrong, texels) = (AtomicUsize::new(0), Mutex::new(Vec::new()), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let folder = tempfile::tempdir().unwrap();
                    match case.check(folder.path(), &header) {
                        Ok(same) => drop(texels.fetch_add(same, Ordering::Relaxed)),
                        Err(words) => wrong.lock().unwrap().push(format!("{}: {words}", case.label())),
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    println!("{} pictures, {} texels agree", cases.len() - wrong.len(), texels.into_inner());
    assert!(wrong.is_empty(), "{} of {} differ:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}
