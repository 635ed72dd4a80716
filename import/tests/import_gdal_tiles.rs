//! Pyramids of map tiles held against GDAL: tiles that it writes, and its reading of ours; heights, colours and places.
//!
//! Ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal_tiles -- --ignored`.

mod import_support;
#[path = "web_tiles/make.rs"]
mod make;
#[path = "import_support/tools.rs"]
mod tools;

use import_support::{Grid, Random, collect};
use make::{folder, hills, mapbox};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{
    OpenOptions, PictureOptions, TileOptions, open_file, open_image, open_images, open_with,
};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::imagery::ImageSource;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use tools::run;

/// A DEM of heights in tenths of metres, as a picture of colours that they are packed into, in EPSG:3857 off any tile's rim.
#[cfg(feature = "mbtiles")]
fn packed_tiff(folder_of: &Path, size: [u32; 2]) -> PathBuf {
    let path = folder_of.join("packed.ppm");
    let mut bytes = format!("P6\n{} {}\n255\n", size[0], size[1]).into_bytes();
    for i in 0..size[0] * size[1] {
        bytes.extend(&mapbox(hills(u64::from(i % size[0]), u64::from(i / size[0])))[..3]);
    }
    std::fs::write(&path, bytes).unwrap();
    let corners = ["823000", "5781000", "843000", "5764000"];
    let mut arguments = vec!["-q", "-a_srs", "EPSG:3857", "-a_ullr"];
    arguments.extend(corners);
    arguments.extend(["packed.ppm", "packed.tif"]);
    run(folder_of, "gdal_translate", &arguments);
    folder_of.join("packed.tif")
}

fn heights(path: &Path, tiles: TileOptions) -> Grid {
    let options = OpenOptions { decode: Some("mapbox".into()), tiles, ..OpenOptions::default() };
    let dem = open_with(&[path.to_owned()], &options).unwrap_or_else(|error| panic!("{error}"));
    collect(&*dem).unwrap_or_else(|error| panic!("{error}"))
}

/// Red, green, blue and alpha of a picture.
fn texels(image: &dyn ImageSource) -> Vec<[u8; 4]> {
    let mut all = vec![0; image.info().texels.iter().map(|side| *side as usize).product::<usize>() * 4];
    image.rows().unwrap().read(&mut all).unwrap();
    all.as_chunks::<4>().0.to_vec()
}

/// Bands of a file as GDAL reads them, and its place.
struct Truth {
    size: [u32; 2],
    bands: Vec<Vec<u8>>,
    origin: [f64; 2],
    step: [f64; 2],
}

fn truth(folder_of: &Path, name: &str) -> Truth {
    run(folder_of, "gdal_translate", &["-q", "-of", "ENVI", "-co", "INTERLEAVE=BSQ", name, "truth.img"]);
    let said = run(folder_of, "gdalinfo", &[name]);
    let pair = |key: &str| -> [f64; 2] {
        let line = said.lines().find(|line| line.trim().starts_with(key)).unwrap_or_else(|| panic!("{said}"));
        let inside = line.trim().trim_start_matches(key).trim().trim_start_matches('(').trim_end_matches(')');
        let numbers: Vec<f64> = inside.split(',').map(|word| word.trim().parse().unwrap()).collect();
        numbers.try_into().unwrap()
    };
    let size = pair("Size is").map(|side| side as u32);
    let bytes = std::fs::read(folder_of.join("truth.img")).unwrap();
    let bands = bytes.chunks_exact(size.iter().product::<u32>() as usize).map(<[u8]>::to_vec).collect();
    Truth { size, bands, origin: pair("Origin ="), step: pair("Pixel Size =") }
}

/// Our heights at every texel of GDAL's that has one; how many heights and voids were compared.
fn holds(grid: &Grid, truth: &Truth, shown: &str) -> (usize, usize) {
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    assert!((map[1] / truth.step[0] - 1.0).abs() < 1e-9, "{shown}: {map:?} and {:?}", truth.step);
    let off = [
        ((truth.origin[0] + truth.step[0] / 2.0 - map[0]) / map[1]).round() as i64,
        ((truth.origin[1] + truth.step[1] / 2.0 - map[3]) / map[5]).round() as i64,
    ];
    let (mut seen, mut voids) = (0, 0);
    for i in 0..truth.bands[0].len() {
        let [col, row] = [i as u32 % truth.size[0], i as u32 / truth.size[0]];
        let [red, green, blue, alpha] = [0, 1, 2, 3].map(|band| truth.bands[band][i]);
        let at = [i64::from(col) + off[0], i64::from(row) + off[1]];
        let is_in = at[0] >= 0
            && at[1] >= 0
            && at[0] < i64::from(grid.info.samples_wide)
            && at[1] < i64::from(grid.info.samples_high);
        if !is_in {
            // Tiles may hold more than the bounds that are stated; GDAL cuts them as well, but for this comparison.
            assert!(
                alpha == 0 || ["bounds", "overview"].contains(&shown),
                "{shown}: ({col}, {row}) is not read"
            );
            continue;
        }
        let got = grid.at(at[0] as u32, at[1] as u32);
        if alpha == 0 {
            assert!(got.is_nan(), "{shown}: ({col}, {row}) is {got}, GDAL has no data");
            voids += 1;
        } else {
            let number = f64::from(red) * 65_536.0 + f64::from(green) * 256.0 + f64::from(blue);
            assert_eq!(got, (number - 100_000.0) / 10.0, "{shown}: ({col}, {row})");
            seen += 1;
        }
    }
    assert!(seen > 10_000, "{shown}: {seen} heights and {voids} voids compared");
    (seen, voids)
}

#[cfg(feature = "mbtiles")]
#[test]
#[ignore = "needs gdal-bin"]
fn mbtiles_that_gdal_writes_have_the_heights_that_gdal_reads() {
    let folder_of = tempdir().unwrap();
    let at = folder_of.path();
    packed_tiff(at, [300, 260]);
    for (name, options) in [
        ("near", &["-co", "RESAMPLING=NEAREST"][..]),
        ("lower", &["-co", "RESAMPLING=NEAREST", "-co", "ZOOM_LEVEL_STRATEGY=LOWER"]),
        ("bounds", &["-co", "RESAMPLING=NEAREST", "-co", "BOUNDS=7.42,45.92,7.52,45.98"]),
        ("large", &["-co", "RESAMPLING=NEAREST", "-co", "BLOCKSIZE=512"]),
    ] {
        let file = format!("{name}.mbtiles");
        let mut arguments = vec!["-q", "-of", "MBTILES", "-co", "TILE_FORMAT=PNG"];
        arguments.extend(options);
        arguments.extend(["packed.tif", &file]);
        run(at, "gdal_translate", &arguments);
        holds(&heights(&at.join(&file), TileOptions::default()), &whole(at, &file), name);
    }
    // Coarser zooms, which GDAL calls overviews.
    run(at, "gdaladdo", &["-q", "-r", "nearest", "near.mbtiles", "2", "4"]);
    let deepest = zooms(&at.join("near.mbtiles"));
    run(
        at,
        "gdal_translate",
        &[
            "-q",
            "-oo",
            "USE_BOUNDS=NO",
            "-oo",
            &format!("ZOOM_LEVEL={}", deepest - 1),
            "near.mbtiles",
            "coarse.tif",
        ],
    );
    let coarse = TileOptions { zoom: Some(deepest - 1), ..TileOptions::default() };
    holds(&heights(&at.join("near.mbtiles"), coarse), &truth(at, "coarse.tif"), "overview");
    assert_eq!(
        zooms(&at.join("near.mbtiles")),
        deepest,
        "the deepest of all is read without being asked for"
    );
}

/// All tiles of a file, whatever bounds it states.
#[cfg(feature = "mbtiles")]
fn whole(at: &Path, file: &str) -> Truth {
    run(at, "gdal_translate", &["-q", "-oo", "USE_BOUNDS=NO", file, "whole.tif"]);
    truth(at, "whole.tif")
}

/// The zoom that is read when nothing is asked for.
#[cfg(feature = "mbtiles")]
fn zooms(path: &Path) -> u8 {
    let format = heights(path, TileOptions::default()).info.format;
    format.rsplit(' ').next().unwrap().parse().unwrap()
}

#[test]
#[ignore = "needs gdal-bin"]
fn folders_are_read_as_gdal_reads_them_from_a_server() {
    let folder_of = tempdir().unwrap();
    let at = folder_of.path();
    let made = make::tiles(12, 2130..2133, 1450..1453, 256, |col, row| {
        if (col / 7 + row / 5) % 11 == 0 { [0; 4] } else { mapbox(hills(col, row)) }
    });
    folder(&at.join("xyz"), &made, ".png", false);
    let description = format!(
        "<GDAL_WMS><Service name=\"TMS\"><ServerUrl>file://{}/xyz/${{z}}/${{x}}/${{y}}.png</ServerUrl></Service><DataWindow>\
         <UpperLeftX>-20037508.342789244</UpperLeftX><UpperLeftY>20037508.342789244</UpperLeftY><LowerRightX>20037508.342789244</LowerRightX>\
         <LowerRightY>-20037508.342789244</LowerRightY><TileLevel>12</TileLevel><TileCountX>1</TileCountX><TileCountY>1</TileCountY>\
         <YOrigin>top</YOrigin></DataWindow><Projection>EPSG:3857</Projection><BlockSizeX>256</BlockSizeX><BlockSizeY>256</BlockSizeY>\
         <BandsCount>4</BandsCount><MaxConnections>1</MaxConnections></GDAL_WMS>",
        at.display()
    );
    std::fs::write(at.join("xyz.xml"), description).unwrap();
    let window = ["-srcwin", "545280", "371200", "768", "768"];
    let mut arguments = vec!["-q"];
    arguments.extend(window);
    arguments.extend(["xyz.xml", "window.tif"]);
    run(at, "gdal_translate", &arguments);
    let (_, voids) =
        holds(&heights(&at.join("xyz"), TileOptions::default()), &truth(at, "window.tif"), "XYZ");
    assert!(voids > 10_000);
}

#[test]
#[ignore = "needs gdal-bin"]
fn a_terrain_has_the_heights_that_gdalwarp_brings_out_of_the_tiles() {
    let folder_of = tempdir().unwrap();
    let at = folder_of.path();
    let made = make::tiles(12, 2130..2132, 1450..1452, 256, |col, row| {
        mapbox(((col % 4096) * 3 + (row % 4096) * 2) as i64 / 4 + hills(col, row) / 8)
    });
    let path = folder(&at.join("xyz"), &made, ".png", false);
    // The same as numbers, placed by arithmetic.
    let grid = heights(&path, TileOptions::default());
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    let bytes: Vec<u8> = grid.samples.iter().flat_map(|height| (*height as f32).to_le_bytes()).collect();
    std::fs::write(at.join("plain.img"), bytes).unwrap();
    let header = format!(
        "ENVI\nsamples = 512\nlines = 512\nbands = 1\ndata type = 4\nbyte order = 0\ninterleave = bsq\nheader offset = 0\nmap info = {{Arbitrary, 1, 1, {}, {}, {}, {}}}\n",
        map[0] - map[1] / 2.0,
        map[3] - map[5] / 2.0,
        map[1],
        -map[5]
    );
    std::fs::write(at.join("plain.hdr"), header).unwrap();
    run(
        at,
        "gdalwarp",
        &[
            "-q",
            "-s_srs",
            "EPSG:3857",
            "-t_srs",
            "EPSG:32632",
            "-r",
            "bilinear",
            "-tr",
            "25",
            "25",
            "-et",
            "0",
            "-dstnodata",
            "-9999",
            "plain.img",
            "utm.tif",
        ],
    );
    let options = OpenOptions {
        decode: Some("mapbox".into()),
        reproject: Some("EPSG:32632".into()),
        resolution: Some(25.0),
        ..OpenOptions::default()
    };
    let ours = collect(&*open_with(&[path], &options).unwrap()).unwrap();
    let theirs = collect(&*open_file(&at.join("utm.tif")).unwrap()).unwrap();
    let [a, b] = [&ours, &theirs].map(|grid| grid.info.georeference.pixel_to_crs.unwrap());
    // Each chooses its own corner; places are asked by coordinates, and heights between samples interpolated.
    let mut random = Random(7);
    let (mut compared, mut most) = (0, 0.0f64);
    while compared < 300 {
        let [col, row] = [ours.info.samples_wide, ours.info.samples_high]
            .map(|side| 20 + random.below(u64::from(side) - 40) as u32);
        let (x, y) = (a[0] + a[1] * f64::from(col), a[3] + a[5] * f64::from(row));
        let (u, v) = ((x - b[0]) / b[1], (y - b[3]) / b[5]);
        let (left, top) = (u.floor(), v.floor());
        let is_in = left >= 0.0
            && top >= 0.0
            && left + 1.0 < f64::from(theirs.info.samples_wide)
            && top + 1.0 < f64::from(theirs.info.samples_high);
        if !is_in {
            continue;
        }
        let at = |dx: u32, dy: u32| theirs.at(left as u32 + dx, top as u32 + dy);
        let (du, dv) = (u - left, v - top);
        let wanted = (at(0, 0) * (1.0 - du) + at(1, 0) * du) * (1.0 - dv)
            + (at(0, 1) * (1.0 - du) + at(1, 1) * du) * dv;
        if wanted.is_nan() || ours.at(col, row).is_nan() {
            continue;
        }
        most = most.max((ours.at(col, row) - wanted).abs());
        compared += 1;
    }
    // Both interpolate; where the corners differ theirs is interpolated twice.
    assert!(most < 0.6, "{most} m off");
}

#[cfg(feature = "mbtiles")]
#[test]
#[ignore = "needs gdal-bin"]
fn pictures_of_every_format_have_the_colours_that_gdal_reads() {
    let folder_of = tempdir().unwrap();
    let at = folder_of.path();
    packed_tiff(at, [300, 260]);
    for (format, options, off) in [
        ("PNG", &[][..], 0),
        ("PNG8", &[], 0),
        // Decoders of JPEG and of lossy WebP round in their own ways.
        ("JPEG", &["-co", "QUALITY=90"], 6),
        ("WEBP", &["-co", "QUALITY=90"], 8),
    ] {
        let file = format!("{format}.mbtiles");
        let tile_format = format!("TILE_FORMAT={format}");
        let mut arguments = vec!["-q", "-of", "MBTILES", "-co", &tile_format];
        arguments.extend(options);
        arguments.extend(["packed.tif", &file]);
        run(at, "gdal_translate", &arguments);
        let truth = whole(at, &file);
        let image = open_image(&at.join(&file)).unwrap_or_else(|error| panic!("{error}"));
        let [wide, high] = image.info().texels;
        let map = image.info().georeference.pixel_to_crs.unwrap();
        let shift = [
            ((truth.origin[0] + truth.step[0] / 2.0 - map[0]) / map[1]).round() as i64,
            ((truth.origin[1] + truth.step[1] / 2.0 - map[3]) / map[5]).round() as i64,
        ];
        let ours = texels(&*image);
        let mut compared = 0;
        for i in 0..truth.bands[0].len() {
            let col = i64::from(i as u32 % truth.size[0]) + shift[0];
            let row = i64::from(i as u32 / truth.size[0]) + shift[1];
            if !(0..i64::from(wide)).contains(&col) || !(0..i64::from(high)).contains(&row) {
                // Tiles of JPEG have no alpha, and what lies beyond the bounds that are stated is not read.
                assert!(format == "JPEG" || truth.bands[3][i] == 0, "{format}: ({col}, {row}) is not read");
                continue;
            }
            let got = ours[(row * i64::from(wide) + col) as usize];
            let wanted = [0, 1, 2, 3].map(|band| truth.bands.get(band).map_or(255, |band| band[i]));
            assert_eq!(got[3], wanted[3], "{format}: ({col}, {row})");
            if wanted[3] != 0 {
                for (got, wanted) in got.iter().zip(wanted) {
                    assert!(got.abs_diff(wanted) <= off, "{format}: ({col}, {row}): {got} is not {wanted}");
                }
                compared += 1;
            }
        }
        assert!(compared > 10_000, "{format}: {compared}");
        let is_exact = format.starts_with("PNG");
        let opened = open_with(
            &[at.join(&file)],
            &OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() },
        );
        match opened {
            Ok(_) => assert!(is_exact, "{format} as heights"),
            Err(error) => assert!(!is_exact && error.to_string().contains("changes colours"), "{error}"),
        }
    }
}

#[test]
#[ignore = "needs gdal-bin"]
fn a_picture_lies_on_a_terrain_as_gdalwarp_lays_it() {
    let folder_of = tempdir().unwrap();
    let at = folder_of.path();
    // Smooth colours, so that a tenth of a texel is a step of one or two.
    let colour = |col: u64, row: u64| {
        let wave = |at: u64, length: f64| (127.0 + 120.0 * (at as f64 / length).sin()).round() as u8;
        [wave(col, 31.0), wave(row, 37.0), wave(col + row, 43.0), 255]
    };
    let made = make::tiles(13, 4261..4264, 2901..2904, 256, colour);
    let path = folder(&at.join("xyz"), &made, ".png", false);
    let image = open_image(&path).unwrap();
    let map = image.info().georeference.pixel_to_crs.unwrap();
    let mut bytes = format!("P6\n{} {}\n255\n", image.info().texels[0], image.info().texels[1]).into_bytes();
    bytes.extend(texels(&*image).iter().flat_map(|texel| [texel[0], texel[1], texel[2]]));
    std::fs::write(at.join("mosaic.ppm"), bytes).unwrap();
    let [west, north] = [map[0] - map[1] / 2.0, map[3] - map[5] / 2.0];
    let [east, south] = [west + 768.0 * map[1], north + 768.0 * map[5]];
    let corners = [west, north, east, south].map(|side| format!("{side:.9}"));
    let mut arguments = vec!["-q", "-a_srs", "EPSG:3857", "-a_ullr"];
    arguments.extend(corners.iter().map(String::as_str));
    arguments.extend(["mosaic.ppm", "mosaic.tif"]);
    run(at, "gdal_translate", &arguments);
    // A terrain in UTM inside the picture.
    run(
        at,
        "gdalwarp",
        &["-q", "-t_srs", "EPSG:32632", "-tr", "40", "40", "-ot", "Float32", "mosaic.tif", "warped.tif"],
    );
    run(
        at,
        "gdal_translate",
        &["-q", "-b", "1", "-srcwin", "30", "30", "150", "150", "warped.tif", "land.tif"],
    );
    let dem = open_file(&at.join("land.tif")).unwrap();
    build(&*dem, &at.join("land.iqt"), &BuildOptions::default(), &Silent).unwrap();
    let terrain = Terrain::open(&at.join("land.iqt")).unwrap();
    let laid = open_images(&[path], Some(terrain.header()), &PictureOptions::default()).unwrap().remove(0);
    let [wide, high] = laid.info().texels;
    let placed = laid.info().georeference.pixel_to_crs.unwrap();
    let extent = [
        placed[0] - placed[1] / 2.0,
        placed[3] + placed[5] * (f64::from(high) - 0.5),
        placed[0] + placed[1] * (f64::from(wide) - 0.5),
        placed[3] - placed[5] / 2.0,
    ]
    .map(|side| format!("{side:.9}"));
    let (width, height) = (wide.to_string(), high.to_string());
    let mut arguments = vec!["-q", "-t_srs", "EPSG:32632", "-r", "bilinear", "-et", "0", "-te"];
    arguments.extend(extent.iter().map(String::as_str));
    arguments.extend(["-ts", &width, &height, "-dstalpha", "mosaic.tif", "laid.tif"]);
    run(at, "gdalwarp", &arguments);
    let truth = truth(at, "laid.tif");
    let ours = texels(&*laid);
    let (mut compared, mut most) = (0, 0);
    for (i, got) in ours.iter().enumerate() {
        if truth.bands[3][i] != 255 || got[3] != 255 {
            continue;
        }
        compared += 1;
        most = (0..3).map(|band| got[band].abs_diff(truth.bands[band][i])).fold(most, u8::max);
    }
    assert!(compared * 10 > ours.len() * 8, "{compared} of {} compared", ours.len());
    // A texel's step of colour is 4 at most; a tenth of it, and rounding.
    assert!(most <= 2, "{most} off");
}
