//! Kin of the files in fixtures/cases, made here: every way a grid can lie, every type's "no data", other units, codes and masks, files beside files.

mod cases_support;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;

use cases_support::{Built, built, refused};
use std::path::PathBuf;
use terrasoar_import::{Direction, OpenOptions};
use terrasoar_layout::Remedy;
use tiff::{DATA_AT, Tag, append, longs, reals, shorts, text, tiff};

const WIDE: u32 = 7;
const HIGH: u32 = 5;

/// A folder with one file in it.
struct Bench {
    folder: tempfile::TempDir,
    path: PathBuf,
}

impl Bench {
    fn new(bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        std::fs::write(&path, bytes).unwrap();
        Self { folder, path }
    }

    fn with(self, name: &str, content: impl AsRef<[u8]>) -> Self {
        std::fs::write(self.folder.path().join(name), content).unwrap();
        self
    }

    fn built(&self) -> Built {
        built(&self.path, &OpenOptions::default(), None).unwrap()
    }
}

/// Tags of one strip of samples of `bits` bits and the TIFF sample format `format`.
fn strip([wide, high]: [u32; 2], bits: u16, format: u16, bytes: usize) -> Vec<Tag> {
    vec![
        longs(256, &[wide]),
        longs(257, &[high]),
        shorts(258, &[bits]),
        shorts(259, &[1]),
        shorts(262, &[1]),
        longs(273, &[DATA_AT]),
        shorts(277, &[1]),
        longs(278, &[high]),
        longs(279, &[bytes as u32]),
        shorts(339, &[format]),
    ]
}

/// GeoTIFF keys: model, then (key, value).
fn keys(model: u16, more: &[(u16, u16)]) -> Tag {
    let mut all = vec![(1024, model), (1025, 1)];
    all.extend_from_slice(more);
    let mut values = vec![1, 1, 0, all.len() as u16];
    values.extend(all.iter().flat_map(|(key, value)| [*key, 0, 1, *value]));
    shorts(34735, &values)
}

fn matrix([x, a, b, y, d, e]: [f64; 6]) -> Tag {
    reals(34264, &[a, b, 0.0, x, d, e, 0.0, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
}

/// A file of singles: the plane over the ground, through the map of the corners of samples.
fn plane(samples: [u32; 2], map: [f64; 6], more: &[Tag]) -> Vec<u8> {
    let [x, a, b, y, d, e] = map;
    let data: Vec<u8> = (0..samples[1])
        .flat_map(|row| (0..samples[0]).map(move |col| (f64::from(col) + 0.5, f64::from(row) + 0.5)))
        .flat_map(|(c, r)| height(x + a * c + b * r, y + d * c + e * r).to_le_bytes())
        .collect();
    let mut tags = strip(samples, 32, 3, data.len());
    tags.push(matrix(map));
    tags.extend_from_slice(more);
    tiff(false, tags, &data)
}

fn height(x: f64, y: f64) -> f32 {
    (100.0 + 0.3 * (x - 500_000.0) + 0.7 * (y - 5_000_000.0)) as f32
}

#[test]
fn every_way_a_grid_can_lie_gives_the_same_terrain() {
    let mut first = None;
    for way in 0..8 {
        let (transpose, mirror, flip) = (way & 4 != 0, way & 1 != 0, way & 2 != 0);
        let [dx, dy] = [10.0, 20.0];
        let (x0, sx) = if mirror { (500_000.0 + dx * f64::from(WIDE), -dx) } else { (500_000.0, dx) };
        let (y0, sy) = if flip { (5_000_000.0 - dy * f64::from(HIGH), dy) } else { (5_000_000.0, -dy) };
        let (samples, map) = match transpose {
            false => ([WIDE, HIGH], [x0, sx, 0.0, y0, 0.0, sy]),
            true => ([HIGH, WIDE], [x0, 0.0, sx, y0, sy, 0.0]),
        };
        let built = Bench::new(&plane(samples, map, &[keys(1, &[(3072, 32632)])])).built();
        assert_eq!((built.terrain.grid().samples(), built.spacing_m()), ([WIDE, HIGH], [dx, dy]), "{way}");
        let found = (built.heights_m(), built.terrain.header().sample_to_crs);
        assert_eq!(
            found.1.unwrap().map(|m| m + 0.0),
            [500_005.0, 10.0, 0.0, 4_999_910.0, 0.0, 20.0],
            "{way}"
        );
        let wanted = f64::from(height(500_005.0, 4_999_910.0));
        assert!((found.0[0].unwrap() - wanted).abs() < 1e-3, "{way}");
        assert_eq!(*first.get_or_insert(found.clone()), found, "{way}");
    }
}

#[test]
fn axes_to_the_west_and_south_are_understood() {
    // EPSG:2046: x grows to the west, y to the south. GDAL writes such a file north-up in its own coordinates.
    let file =
        plane([WIDE, HIGH], [50_000.0, -10.0, 0.0, 3_000_000.0, 0.0, 20.0], &[keys(1, &[(3072, 2046)])]);
    let built = Bench::new(&file).built();
    // The first sample lies in the north-west: smallest y is the northernmost.
    let north_west = built.height_m([0, HIGH - 1]).unwrap();
    assert!((north_west - f64::from(height(49_995.0, 3_000_010.0))).abs() < 0.1, "{north_west}");
}

#[test]
fn sheared_grids_are_resampled() {
    let sheared = Bench::new(&plane(
        [40, 40],
        [500_000.0, 10.0, 4.0, 5_000_000.0, 0.0, -10.0],
        &[keys(1, &[(3072, 32632)])],
    ))
    .built();
    let header = sheared.terrain.header();
    let map = header.sample_to_crs.unwrap();
    let mut seen = 0;
    for (i, found) in sheared.heights_m().into_iter().enumerate() {
        let wide = header.grid.samples()[0] as usize;
        let (x, y) = (map[0] + map[1] * (i % wide) as f64, map[3] + map[5] * (i / wide) as f64);
        let row = (5_000_000.0 - y) / 10.0 - 0.5;
        let col = (x - 500_000.0 - 4.0 * (row + 0.5)) / 10.0 - 0.5;
        if (0.0..39.0).contains(&col) && (0.0..39.0).contains(&row) {
            assert!((found.unwrap() - f64::from(height(x, y))).abs() < 0.02, "{col} {row}");
            seen += 1;
        }
    }
    assert!(seen > 1300, "{seen}");
}

#[test]
fn voids_are_declared_in_every_type() {
    let values: [(u16, u16, Vec<u8>, &str); 11] = [
        (8, 1, vec![255], "255"),
        (8, 2, vec![(-128i8) as u8], "-128"),
        (16, 1, 65_535u16.to_le_bytes().to_vec(), "65535.0"),
        (16, 2, (-32_768i16).to_le_bytes().to_vec(), "-32768"),
        (16, 3, half_bits(-65_504.0).to_le_bytes().to_vec(), "-65504"),
        (32, 1, u32::MAX.to_le_bytes().to_vec(), "4294967295"),
        (32, 2, i32::MIN.to_le_bytes().to_vec(), "-2147483648"),
        (32, 3, (-3.402_823_5e38f32).to_le_bytes().to_vec(), "-3.4028234663852886e+38"),
        (64, 1, u64::MAX.to_le_bytes().to_vec(), "18446744073709551615"),
        (64, 2, i64::MIN.to_le_bytes().to_vec(), "-9223372036854775808"),
        (64, 3, f64::NAN.to_le_bytes().to_vec(), "nan"),
    ];
    for (bits, format, void, declared) in values {
        let bytes = usize::from(bits / 8);
        // Zeros, and one void at column 2, row 1; a one beside it, so that heights differ.
        let mut data = vec![0; bytes * (WIDE * HIGH) as usize];
        data[(WIDE as usize + 2) * bytes..][..bytes].copy_from_slice(&void);
        for how in ["declared", "asked", "neither"] {
            let mut tags = strip([WIDE, HIGH], bits, format, data.len());
            tags.push(matrix([500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -10.0]));
            tags.push(keys(1, &[(3072, 32632)]));
            if how == "declared" {
                tags.push(text(42113, declared));
            }
            let nodata = if how == "asked" { vec!["7".into(), declared.into()] } else { Vec::new() };
            let bench = Bench::new(&tiff(false, tags, &data));
            let options = OpenOptions { nodata, ..OpenOptions::default() };
            let found = built(&bench.path, &options, None);
            let is_void = how != "neither" || declared == "nan";
            match found {
                Ok(found) => {
                    assert_eq!(found.height_m([2, HIGH - 2]).is_none(), is_void, "{bits} {format} {how}");
                    assert_eq!(
                        found.terrain.header().nodata_samples,
                        u64::from(is_void),
                        "{bits} {format} {how}"
                    );
                    let idle =
                        found.warnings.iter().filter(|w| w.words.starts_with("no sample is 7,")).count();
                    assert_eq!(
                        idle,
                        usize::from(how == "asked"),
                        "{bits} {format} {how}: {:?}",
                        found.warnings
                    );
                }
                // A height of 1e38 m is refused with the way out.
                Err(error) => {
                    assert!(how == "neither" && error.to_string().contains("no-data value"), "{error}")
                }
            }
        }
    }
}

/// A power of two or the largest half, as bits.
fn half_bits(value: f32) -> u16 {
    assert_eq!(value, -65_504.0);
    0xfbff
}

#[test]
fn angular_units_are_those_of_the_keys() {
    // 10 E, 45 N in each unit; a step of 0.001 degrees: 78.85 x 111.13 m.
    let degree = 1f64.to_radians();
    for (code, size) in [
        (9101, 1.0),
        (9102, degree),
        (9103, degree / 60.0),
        (9104, degree / 3600.0),
        (9105, degree * 0.9),
        (9106, degree * 0.9),
    ] {
        let unit = degree / size;
        let file = plane(
            [3, 3],
            [10.0 * unit, 0.001 * unit, 0.0, 45.0015 * unit, 0.0, -0.001 * unit],
            &[keys(2, &[(2048, 4326), (2054, code)])],
        );
        let [east, north] = Bench::new(&file).built().spacing_m();
        assert!((east - 78.847).abs() < 0.01 && (north - 111.132).abs() < 0.01, "{code}: {east} {north}");
    }
}

#[test]
fn units_win_in_the_order_of_their_nearness() {
    let at = [500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -10.0];
    let of = |more: &[(u16, u16)], extra: &[Tag]| {
        let tags: Vec<Tag> = [keys(1, more)].into_iter().chain(extra.iter().cloned()).collect();
        Bench::new(&plane([WIDE, HIGH], at, &tags)).built()
    };
    let low = f64::from(height(500_005.0, 4_999_955.0));
    let first = |built: &Built| built.height_m([0, 0]).unwrap() / low;
    let near = |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 1e-6, "{found} {wanted}");
    let feet = 1200.0 / 3937.0;
    // The unit of the key before that of the code; the vertical system's before none; the key's before that; the band's before all.
    near(of(&[(3072, 32632), (3076, 9002)], &[]).spacing_m()[0], 3.048);
    near(first(&of(&[(3072, 32632), (4096, 6360)], &[])), feet);
    near(first(&of(&[(3072, 32632), (4096, 6360), (4099, 9001)], &[])), 1.0);
    let band = text(
        42112,
        "<GDALMetadata><Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">fathoms</Item></GDALMetadata>",
    );
    near(first(&of(&[(3072, 32632), (4096, 6360), (4099, 9003)], &[band])), 1.8288);
    // Depths by the vertical system; a compound code alone; a unit that is none.
    near(first(&of(&[(3072, 32632), (4096, 5715)], &[])), -1.0);
    let compound = of(&[(3072, 7415)], &[]);
    assert_eq!(compound.terrain.header().epsg, Some(28992));
    assert_eq!(compound.terrain.header().about.vertical_epsg, Some(5709));
    let odd = text(
        42112,
        "<GDALMetadata><Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">K</Item></GDALMetadata>",
    );
    let warned = of(&[(3072, 32632)], &[odd]);
    assert!(warned.warnings.iter().any(|w| w.words.contains("\"K\"")), "{:?}", warned.warnings);
    let unknown = of(&[(3072, 20000)], &[]);
    assert!(
        unknown.warnings.iter().any(|w| w.words.contains("EPSG:20000 is not in the registry")),
        "{:?}",
        unknown.warnings
    );
}

#[test]
fn negative_scales_and_typed_directions() {
    let scaled = text(
        42112,
        "<GDALMetadata><Item name=\"SCALE\" sample=\"0\" role=\"scale\">-2</Item><Item name=\"OFFSET\" sample=\"0\" role=\"offset\">7</Item></GDALMetadata>",
    );
    let bench = Bench::new(&plane(
        [WIDE, HIGH],
        [500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -10.0],
        &[keys(1, &[(3072, 32632)]), scaled],
    ));
    let low = f64::from(height(500_005.0, 4_999_955.0));
    assert!((bench.built().height_m([0, 0]).unwrap() - (7.0 - 2.0 * low)).abs() < 1e-3);
    let typed = OpenOptions {
        positive: Some(Direction::Down),
        height_unit: Some("dm".into()),
        ..OpenOptions::default()
    };
    let found = built(&bench.path, &typed, None).unwrap();
    assert!((found.height_m([0, 0]).unwrap() + 0.1 * (7.0 - 2.0 * low)).abs() < 1e-4);
    assert!(found.terrain.header().height_range_m[0] < found.terrain.header().height_range_m[1]);
}

#[test]
fn what_stands_beside_a_file_is_found_by_either_case_and_wins_where_it_should() {
    let data: Vec<u8> = (0..WIDE * HIGH).flat_map(|i| (100 + i as i16).to_le_bytes()).collect();
    let bare = || Bench::new(&tiff(false, strip([WIDE, HIGH], 16, 2, data.len()), &data));
    let world = "10\n0\n0\n-10\n500005\n4999995\n";
    for name in ["a.tfw", "a.TFW", "a.tifw", "a.wld"] {
        assert_eq!(bare().with(name, world).built().spacing_m(), [10.0; 2], "{name}");
    }
    let utm = "PROJCS[\"WGS_1984_UTM_Zone_32N\",GEOGCS[\"GCS_WGS_1984\",DATUM[\"D_WGS_1984\",SPHEROID[\"WGS_1984\",6378137.0,298.257223563]],\
               PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"False_Easting\",500000.0],\
               PARAMETER[\"False_Northing\",0.0],PARAMETER[\"Central_Meridian\",9.0],PARAMETER[\"Scale_Factor\",0.9996],\
               PARAMETER[\"Latitude_Of_Origin\",0.0],UNIT[\"Foot_US\",0.3048006096012192]],VERTCS[\"NAVD_1988\",VDATUM[\"x\"],\
               PARAMETER[\"Vertical_Shift\",0.0],PARAMETER[\"Direction\",-1.0],UNIT[\"Foot\",0.3048]]";
    let found = bare().with("a.tfw", world).with("a.PRJ", utm).built();
    assert!((found.spacing_m()[0] - 3.048_006).abs() < 1e-5, "{:?}", found.spacing_m());
    assert_eq!(found.terrain.header().crs_name, "WGS 1984 UTM Zone 32N");
    // Depths in feet by the vertical part.
    let south_west = f64::from(100 + (HIGH - 1) * WIDE);
    assert!(
        (found.height_m([0, 0]).unwrap() + 0.3048 * south_west).abs() < 1e-6,
        "{:?}",
        found.height_m([0, 0])
    );
    let old = "Projection    UTM\nZone          10\nDatum         NAD27\nUnits         METERS\n";
    assert_eq!(
        bare().with("a.tfw", world).with("a.prj", old).built().terrain.header().crs_name,
        "UTM zone 10N"
    );
    // GDAL's file beside a TIFF wins over the file and over a world file.
    let pam = "<PAMDataset><SRS>EPSG:2263</SRS><GeoTransform>0, 5, 0, 0, 0, -5</GeoTransform><PAMRasterBand band=\"1\">\
               <UnitType>cm</UnitType></PAMRasterBand></PAMDataset>";
    let found = bare().with("a.tfw", world).with("a.tif.aux.xml", pam).built();
    assert!((found.spacing_m()[0] - 1.524_003).abs() < 1e-5, "{:?}", found.spacing_m());
    assert!((found.height_m([0, 0]).unwrap() - 0.01 * south_west).abs() < 1e-9);
    let (words, _) = refused(&bare().with("a.tfw", "1 2 3").path, &OpenOptions::default());
    assert!(words.contains("a.tfw") && words.contains("six numbers"), "{words}");
}

#[test]
fn masks_of_other_sizes_are_passed_over_aloud() {
    let data: Vec<u8> = (0..WIDE * HIGH).flat_map(|i| (100 + i as i16).to_le_bytes()).collect();
    let image = || Bench::new(&tiff(false, strip([WIDE, HIGH], 16, 2, data.len()), &data));
    let mask =
        |size: [u32; 2], bytes: &[u8], bits: u16| tiff(false, strip(size, bits, 1, bytes.len()), bytes);
    // The mask of one bit: rows of a byte; the first column is void.
    let bits = [0b0111_1111u8; HIGH as usize];
    for file in [
        mask([WIDE, HIGH], &bits, 1),
        mask([WIDE, HIGH], &[0, 255, 255, 255, 1, 7, 9].repeat(HIGH as usize), 8),
    ] {
        let found = image().with("a.tif.msk", file).built();
        assert_eq!(found.terrain.header().nodata_samples, u64::from(HIGH));
        assert_eq!((found.height_m([0, 2]), found.height_m([1, HIGH - 1])), (None, Some(101.0)));
    }
    let found = image().with("a.tif.msk", mask([4, 4], &[0; 16], 8)).built();
    assert_eq!(found.terrain.header().nodata_samples, 0);
    assert!(found.warnings.iter().any(|w| w.words.contains("4 x 4")), "{:?}", found.warnings);
    // Inside the file, after the image.
    let mut bytes = tiff(false, strip([WIDE, HIGH], 16, 2, data.len()), &data);
    let at = bytes.len() as u32;
    bytes.extend_from_slice(&bits);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    let mut tags = strip([WIDE, HIGH], 1, 1, bits.len());
    tags.extend([longs(254, &[4]), shorts(262, &[4]), longs(273, &[at])]);
    let second = append(&mut bytes, &tags, 0);
    let first = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let count = usize::from(u16::from_le_bytes(bytes[first..first + 2].try_into().unwrap()));
    bytes[first + 2 + 12 * count..][..4].copy_from_slice(&second.to_le_bytes());
    assert_eq!(Bench::new(&bytes).built().terrain.header().nodata_samples, u64::from(HIGH));
}

#[test]
fn the_poles_and_the_date_line() {
    let at = |x: f64, y: f64, step: f64| {
        plane([20, 20], [x, step, 0.0, y, 0.0, -step], &[keys(2, &[(2048, 4326)])])
    };
    // 0 to 360 and across the date line are degrees like any.
    for x in [355.0, 179.9, -180.0, 190.0] {
        let found = Bench::new(&at(x, 45.01, 0.001)).built();
        assert!((found.spacing_m()[0] - 78.847).abs() < 0.02, "{x}: {:?}", found.spacing_m());
        let metric = OpenOptions { reproject: Some("utm".into()), ..OpenOptions::default() };
        let bench = Bench::new(&at(x, 45.01, 0.001));
        let found = built(&bench.path, &metric, None).unwrap();
        let name = &found.terrain.header().crs_name;
        let zone = if x == 355.0 || x == 190.0 {
            [30, 2][usize::from(x == 190.0)]
        } else {
            [60, 1][usize::from(x == -180.0)]
        };
        assert!(name.contains(&format!("zone {zone}N")), "{x}: {name}");
        assert!(
            found.terrain.header().nodata_samples < 150,
            "{x}: {}",
            found.terrain.header().nodata_samples
        );
    }
    let (words, remedy) = refused(&Bench::new(&at(0.0, 90.0, 0.001)).path, &OpenOptions::default());
    assert!(words.contains("no useful length") && remedy == Some(Remedy::Spacing), "{words}");
    let wide = Bench::new(&at(0.0, 60.0, 1.0)).built();
    assert!(
        wide.warnings.iter().any(|w| w.mended_by == Some((Remedy::Reproject, "utm".into()))),
        "{:?}",
        wide.warnings
    );
}
