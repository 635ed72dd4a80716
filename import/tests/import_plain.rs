//! Plain numbers: with ESRI's and ENVI's labels, without any header, and as Netpbm. One ground, told by arithmetic.

mod import_support;

use import_support::{Grid, collect, data, read, refusal};
use std::path::{Path, PathBuf};
use tempfile::{TempDir, tempdir};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::dem::{HorizontalUnit, SampleType};
use terrasoar_layout::remedy::Remedy;

const SIDES: [usize; 2] = [7, 5];

/// A height of band `band` at a column and row from the north-west.
fn height(band: usize, col: usize, row: usize) -> i32 {
    (100 + 3 * col as i32 + 7 * row as i32) * (1 - 2 * (band as i32 % 2)) + 11 * band as i32
}

fn bytes_of(value: i32, kind: &str) -> Vec<u8> {
    let mut bytes = match kind.trim_end_matches(['l', 'b', 'e']) {
        "u8" | "i8" => vec![value as u8],
        "u16" | "i16" => (value as i16).to_le_bytes().to_vec(),
        "u32" | "i32" => value.to_le_bytes().to_vec(),
        "i64" | "u64" => i64::from(value).to_le_bytes().to_vec(),
        "f32" => (value as f32).to_le_bytes().to_vec(),
        _ => f64::from(value).to_le_bytes().to_vec(),
    };
    if kind.ends_with("be") {
        bytes.reverse();
    }
    bytes
}

/// The samples of `bands` bands in a layout, `gap` bytes after each row (of all bands), `skip` bytes before everything, `between` bands one after the other.
fn laid_out(kind: &str, bands: usize, layout: &str, [skip, gap, between]: [usize; 3]) -> Vec<u8> {
    let [wide, high] = SIDES;
    let mut bytes = vec![0xaa; skip];
    let row = |bytes: &mut Vec<u8>, band, row| {
        (0..wide).for_each(|col| bytes.extend(bytes_of(height(band, col, row), kind)))
    };
    match layout {
        "bsq" => (0..bands).for_each(|band| {
            (0..high).for_each(|r| {
                row(&mut bytes, band, r);
                bytes.extend(vec![0xbb; gap]);
            });
            bytes.extend(vec![0xcc; between]);
        }),
        "bil" => (0..high).for_each(|r| {
            (0..bands).for_each(|band| row(&mut bytes, band, r));
            bytes.extend(vec![0xbb; gap]);
        }),
        _ => (0..high).for_each(|r| {
            (0..wide).for_each(|col| {
                (0..bands).for_each(|band| bytes.extend(bytes_of(height(band, col, r), kind)))
            });
            bytes.extend(vec![0xbb; gap]);
        }),
    }
    bytes
}

fn pair(names: [&str; 2], bytes: &[u8], label: &str) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join(names[1]), label).unwrap();
    let path = folder.path().join(names[0]);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn with(path: &Path, options: OpenOptions) -> Result<Grid, terrasoar_layout::LayoutError> {
    collect(&*open_with(&[path.to_owned()], &options)?)
}

fn is_band(grid: &Grid, band: usize, shown: &str) {
    let [wide, high] = SIDES;
    assert_eq!([grid.info.samples_wide as usize, grid.info.samples_high as usize], SIDES, "{shown}");
    for (row, col) in (0..high).flat_map(|row| (0..wide).map(move |col| (row, col))) {
        assert_eq!(
            grid.at(col as u32, row as u32),
            f64::from(height(band, col, row)),
            "{shown}: {col} {row}"
        );
    }
}

const BILPLACE: &str = "ULXMAP 105\nULYMAP 245\nXDIM 10\nYDIM 10\n";
const PLACE: [f64; 6] = [105.0, 10.0, 0.0, 245.0, 0.0, -10.0];

#[test]
fn esri_labels_of_every_layout_and_type() {
    for (kind, nbits, pixel_type) in [
        ("i16le", 16, "SIGNEDINT"),
        ("i16be", 16, "SIGNEDINT"),
        ("i32be", 32, "SIGNEDINT"),
        ("i64le", 64, "SIGNEDINT"),
        ("f32le", 32, "FLOAT"),
        ("f32be", 32, "FLOAT"),
        ("f64be", 64, "FLOAT"),
    ] {
        let order = if kind.ends_with("be") { "M" } else { "I" };
        for layout in ["bil", "bip", "bsq"] {
            for (skip, gap, between) in [(0, 0, 0), (128, 6, if layout == "bsq" { 10 } else { 0 })] {
                let size = nbits / 8;
                let row = SIDES[0] * size;
                let mut label = format!(
                    "BYTEORDER {order}\nLAYOUT {}\nNROWS {}\nNCOLS {}\nNBANDS 3\nNBITS {nbits}\nPIXELTYPE {pixel_type}\nSKIPBYTES {skip}\n{BILPLACE}",
                    layout.to_uppercase(),
                    SIDES[1],
                    SIDES[0]
                );
                if gap > 0 {
                    label += &match layout {
                        "bsq" => format!("BANDROWBYTES {}\nBANDGAPBYTES {between}\n", row + gap),
                        "bil" => format!("BANDROWBYTES {row}\nTOTALROWBYTES {}\n", 3 * row + gap),
                        _ => format!("TOTALROWBYTES {}\n", 3 * row + gap),
                    };
                }
                let (_folder, path) =
                    pair(["a.bil", "a.hdr"], &laid_out(kind, 3, layout, [skip, gap, between]), &label);
                for band in 0..3 {
                    let options =
                        OpenOptions { band: Some((band + 1).to_string()), ..OpenOptions::default() };
                    let grid = with(&path, options).unwrap_or_else(|error| panic!("{error}: {label}"));
                    is_band(&grid, band, &format!("{kind} {layout} {gap}"));
                    assert_eq!(grid.info.georeference.pixel_to_crs, Some(PLACE));
                }
                is_band(&read(&[path]).unwrap(), 0, kind);
            }
        }
    }
}

/// A table of text beside raw data of its name is no raw data, whatever the label says.
#[test]
fn tables_of_text_are_not_read_by_the_label_of_other_data() {
    let label = "nrows 5\nncols 7\nnbits 8\nulxmap 105\nulymap 245\nxdim 10\nydim 10\n";
    for name in ["a.xyz", "a.txt", "a.csv"] {
        let (folder, raw) = pair(["a.bil", "a.hdr"], &laid_out("u8", 1, "bil", [0; 3]), label);
        let lines = (0..SIDES[1]).flat_map(|row| {
            (0..SIDES[0])
                .map(move |col| format!("{} {} {}\n", 105 + 10 * col, 245 - 10 * row, height(0, col, row)))
        });
        let table = folder.path().join(name);
        std::fs::write(&table, lines.collect::<String>()).unwrap();
        let grid = read(&[table]).unwrap();
        is_band(&grid, 0, name);
        assert!(grid.info.format.contains("XYZ"), "{name}: {}", grid.info.format);
        assert!(read(&[raw]).is_ok());
    }
}

#[test]
fn float_grids_and_what_their_labels_leave_out() {
    let corner = "ncols 7\r\nnrows 5\r\nxllcorner 100\r\nyllcorner 200\r\ncellsize 10\r\nNODATA_value -9999\r\nbyteorder LSBFIRST\r\n";
    let (_folder, path) = pair(["a.flt", "a.hdr"], &laid_out("f32le", 1, "bil", [0; 3]), corner);
    let grid = read(&[path]).unwrap();
    is_band(&grid, 0, "flt");
    assert_eq!((grid.info.georeference.pixel_to_crs, grid.info.sample_type), (Some(PLACE), SampleType::F32));
    let centre = "NCOLS 7\nNROWS 5\nXLLCENTER 105,0\nYLLCENTER 205,0\nCELLSIZE 10\nBYTEORDER MSBFIRST\n";
    let (_folder, path) = pair(["A.FLT", "A.HDR"], &laid_out("f32be", 1, "bil", [0; 3]), centre);
    let grid = read(std::slice::from_ref(&path)).unwrap();
    is_band(&grid, 0, "FLT");
    assert_eq!(grid.info.georeference.pixel_to_crs, Some(PLACE));
    // A person may name the label.
    is_band(&read(&[path.with_extension("HDR")]).unwrap(), 0, "by its label");
    // GTOPO30: 16 bits with a sign, which the label does not say but by the value for no data.
    for (name, nodata, kind, wanted) in [
        ("a.dem", "NODATA -9999\n", "i16be", SampleType::I16),
        ("a.bil", "NODATA -9999\n", "i16be", SampleType::I16),
        ("a.bil", "", "u16be", SampleType::U16),
    ] {
        let label = format!("BYTEORDER M\nNROWS 5\nNCOLS 7\nNBITS 16\n{nodata}");
        let (_folder, path) = pair([name, "a.hdr"], &laid_out(kind, 1, "bil", [0; 3]), &label);
        let grid = read(&[path]).unwrap();
        is_band(&grid, 0, name);
        assert_eq!(grid.info.sample_type, wanted, "{name} {nodata}");
    }
    // Without NBITS the file's length says how many.
    for (kind, wanted) in [("f32le", SampleType::F32), ("f64le", SampleType::F64), ("u16le", SampleType::U16)]
    {
        let (_folder, path) =
            pair(["a.bil", "a.bil.hdr"], &laid_out(kind, 1, "bil", [0; 3]), "nrows 5\nncols 7\n");
        let grid = read(&[path]).unwrap();
        assert_eq!(grid.info.sample_type, wanted);
        is_band(&grid, 0, kind);
    }
}

#[test]
fn wrong_labels_are_told() {
    let bytes = laid_out("i16le", 1, "bil", [0; 3]);
    let head = "NROWS 5\nNCOLS 7\nPIXELTYPE SIGNEDINT\n";
    for (label, wanted) in [
        (format!("{head}NBITS 12\n"), "12 bits"),
        (format!("{head}NBITS 32\n"), "cut short"),
        (format!("{head}NBITS 16\nNBANDS 0\n"), "0 bands"),
        (format!("{head}NBITS 16\nNBANDS -3\n"), "no number of bytes or bands"),
        (format!("{head}NBITS 16\nLAYOUT XYZ\n"), "BIL, BIP or BSQ"),
        (format!("{head}NBITS 16\nBYTEORDER vms\n"), "byte order"),
        (format!("{head}NBITS 16\nSKIPBYTES 18446744073709551615\n"), "cut short"),
        (format!("{head}NBITS 16\nNBANDS 4294967295\nLAYOUT BIP\n"), "cut short"),
        (format!("{head}NBITS 16\nBANDROWBYTES 3\n"), "rows of 3 bytes"),
        (format!("{head}NBITS 16\nXDIM 0\nYDIM 1\nULXMAP 1\nULYMAP 1\n"), "not above 0"),
        (format!("{head}NBITS 16\nXDIM 1\nYDIM 1\nULXMAP x\nULYMAP 1\n"), "ulxmap x is no number"),
        ("NROWS 4000000000\nNCOLS 4000000000\nNBITS 16\n".into(), "cut short"),
        ("NROWS 1\nNCOLS 7\n".into(), "2 x 2"),
    ] {
        let (_folder, path) = pair(["a.bil", "a.hdr"], &bytes, &label);
        let said = refusal(&[path]);
        assert!(said.contains(wanted), "{label:?}: {said}");
    }
    let (_folder, path) = pair(["a.bil", "a.hdr"], &bytes, "something else");
    assert!(refusal(&[path]).contains("unknown"));
}

#[test]
fn envi_labels_of_every_layout_and_type() {
    for (kind, code) in [("i16le", 2), ("i32be", 3), ("f32le", 4), ("f64be", 5), ("i64le", 14)] {
        for layout in ["bil", "bip", "bsq"] {
            let order = i32::from(kind.ends_with("be"));
            let label = format!(
                "ENVI\ndescription = {{\n a test = 5\n}}\nsamples = 7\nlines   = 5\nbands   = 2\nheader offset = 9\nfile type = ENVI Standard\ndata type = {code}\n\
                 interleave = {layout}\nbyte order = {order}\nmap info = {{UTM, 1.5, 1.5, 105, 245, 10, 10, 33, South, WGS-84, units=Meters}}\n\
                 band names = {{\n ground, water}}\ndata ignore value = -9999\n"
            );
            let (_folder, path) = pair(["a", "a.hdr"], &laid_out(kind, 2, layout, [9, 0, 0]), &label);
            is_band(&read(std::slice::from_ref(&path)).unwrap(), 0, kind);
            let options = OpenOptions { band: Some("Water".into()), ..OpenOptions::default() };
            let grid = with(&path, options).unwrap();
            is_band(&grid, 1, kind);
            assert_eq!(grid.info.georeference.pixel_to_crs, Some(PLACE));
        }
    }
    let label = "ENVI\nsamples = 7\nlines = 5\ndata type = 4\nmap info = {Geographic Lat/Lon, 1, 1, 10, 50, 0.5, 0.25, WGS-84, units=Degrees}\n\
                 data gain values = {0.5}\ndata offset values = {-3}\n";
    let (_folder, path) = pair(["a.img", "a.hdr"], &laid_out("f32le", 1, "bsq", [0; 3]), label);
    let grid = read(&[path]).unwrap();
    assert_eq!(grid.info.georeference.pixel_to_crs, Some([10.25, 0.5, 0.0, 49.875, 0.0, -0.25]));
    assert_eq!((grid.info.height_scale, grid.info.height_offset_m), (0.5, -3.0));
    // Longitudes and latitudes in parts of degrees; places by gdalinfo.
    for (unit, place) in [
        ("Minutes", [0.1875, 0.025, 0.0, 0.8375, 0.0, -0.0125]),
        ("Seconds", [0.003_125, 1.5 / 3600.0, 0.0, 50.25 / 3600.0, 0.0, -0.75 / 3600.0]),
    ] {
        let label = format!(
            "ENVI\nsamples = 7\nlines = 5\ndata type = 4\nmap info = {{Geographic Lat/Lon, 1, 1, 10.5, 50.625, 1.5, 0.75, WGS-84, units={unit}}}\n"
        );
        let (_folder, path) = pair(["a.img", "a.hdr"], &laid_out("f32le", 1, "bsq", [0; 3]), &label);
        let found = read(&[path]).unwrap().info.georeference;
        let map = found.pixel_to_crs.unwrap();
        assert!(map.iter().zip(place).all(|(a, b)| (a - b).abs() < 1e-12), "{unit}: {map:?}");
        assert_eq!(found.unit, HorizontalUnit::Degree, "{unit}");
    }
    // GDAL writes half a turn for rows from the south, and reads it so.
    let label = "ENVI\nsamples = 7\nlines = 5\ndata type = 4\nmap info = {UTM, 1, 1, 100, 200, 10, 10, 33, North, WGS-84, rotation=180}\n";
    let (_folder, path) = pair(["a.img", "a.hdr"], &laid_out("f32le", 1, "bsq", [0; 3]), label);
    assert_eq!(
        read(std::slice::from_ref(&path)).unwrap().info.georeference.pixel_to_crs,
        Some([105.0, 10.0, 0.0, 205.0, 0.0, 10.0])
    );
    let told = open_with(&[path], &OpenOptions::default()).unwrap().warnings();
    assert!(told.iter().any(|warning| warning.words.contains("rows from the south")), "{told:?}");
    for (line, wanted) in [
        ("data type = 6", "real or whole numbers"),
        ("data type = 4\nfile compression = 1", "compressed"),
        ("data type = 4\nmajor frame offsets = {4, 4}", "frames"),
        ("data type = 4\nmap info = {UTM, x, 1, 1, 1, 1, 1}", "no number"),
        ("data type = 5", "cut short"),
    ] {
        let label = format!("ENVI\nsamples = 7\nlines = 5\n{line}\n");
        let (_folder, path) = pair(["a.img", "a.hdr"], &laid_out("f32le", 1, "bsq", [0; 3]), &label);
        let said = refusal(&[path]);
        assert!(said.contains(wanted), "{line}: {said}");
    }
}

#[test]
fn heightmaps_without_a_header() {
    let folder = tempdir().unwrap();
    let square = |name: &str, kind: &str, side: i32| {
        let path = folder.path().join(name);
        let heights = (0..side * side).map(|i| 1000 + 5 * (i % side) + 3 * (i / side));
        std::fs::write(&path, heights.flat_map(|h| bytes_of(h, kind)).collect::<Vec<u8>>()).unwrap();
        path
    };
    for (name, kind) in [("a.r16", "u16le"), ("A.R32", "f32le")] {
        let grid = read(&[square(name, kind, 65)]).unwrap();
        assert_eq!(
            (grid.info.samples_wide, grid.info.samples_high, grid.at(2, 1)),
            (65, 65, 1013.0),
            "{name}"
        );
    }
    // .raw says nothing: what would fit is named, and works.
    let raw = square("a.raw", "u16be", 65);
    let refused = terrasoar_import::open(std::slice::from_ref(&raw)).err().unwrap();
    assert_eq!(refused.remedy(), Some(Remedy::RawShape));
    assert!(refused.to_string().contains("65x65:u16le"), "{refused}");
    let shaped = |path: &Path, shape: &str| {
        with(path, OpenOptions { raw: Some(shape.into()), ..OpenOptions::default() })
    };
    assert_eq!(shaped(&raw, "65x65:u16be").unwrap().at(2, 1), 1013.0);
    assert_eq!(shaped(&raw, "25 x 169 : U16BE").unwrap().info.samples_high, 169);
    for kind in ["u8", "i16le", "u32be", "i32le", "i64be", "u64le", "f32be", "f64le"] {
        let path = square("any.name", kind, 20);
        let wanted = if kind == "u8" { f64::from(1013u16 as u8) } else { 1013.0 };
        assert_eq!(shaped(&path, &format!("20x20:{kind}")).unwrap().at(2, 1), wanted, "{kind}");
    }
    for (shape, wanted) in [
        ("64x65:u16be", "8320 bytes and the file has 8450"),
        ("4294967295x4294967295:f64le", "and the file has 8450"),
        ("65x65", "no colon"),
    ] {
        let said = shaped(&raw, shape).err().unwrap();
        assert!(said.to_string().contains(wanted) && said.remedy() == Some(Remedy::RawShape), "{said}");
    }
    let odd = folder.path().join("b.r16");
    std::fs::write(&odd, [0; 7]).unwrap();
    assert!(refusal(&[odd]).contains("no square"));
    assert!(
        shaped(&data("puget_sound_1025.png"), "5x5:u8")
            .err()
            .unwrap()
            .to_string()
            .contains("this is a PNG file")
    );
}

#[test]
fn netpbm_as_text_bytes_and_reals() {
    let folder = tempdir().unwrap();
    let file = |name: &str, head: &str, body: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, [head.as_bytes(), body].concat()).unwrap();
        path
    };
    let heights = |kind: &str| laid_out(kind, 1, "bil", [0; 3]);
    let text: String = (0..35)
        .map(|i| format!("{}{}", height(0, i % 7, i / 7), if i % 4 == 3 { "\n" } else { " " }))
        .collect();
    for (path, wanted) in [
        (file("a.pgm", "P5\n# a remark\n7 5\n255\n", &heights("u8")), SampleType::U8),
        (file("b.pgm", "P5 7 5 65535\n", &heights("u16be")), SampleType::U16),
        (file("c.pgm", "P5 7 5 1000 ", &heights("u16be")), SampleType::U16),
        (file("d.pgm", "P2\n7 5\n# a remark\n255\n", text.as_bytes()), SampleType::U8),
        (file("e.pnm", "P2 7 5 65535 ", format!("{text} and more").as_bytes()), SampleType::U16),
    ] {
        let grid = read(std::slice::from_ref(&path)).unwrap_or_else(|error| panic!("{error}"));
        is_band(&grid, 0, &path.display().to_string());
        assert_eq!(grid.info.sample_type, wanted);
    }
    // PFM has its southern row first.
    for (name, head, kind) in [("f.pfm", "Pf\n7 5\n-1.0\n", "f32le"), ("g.pfm", "Pf 7 5 1\n", "f32be")] {
        let bytes = heights(kind);
        let turned: Vec<u8> = bytes.chunks(7 * 4).rev().flatten().copied().collect();
        is_band(&read(&[file(name, head, &turned)]).unwrap(), 0, name);
    }
    for (head, body, wanted) in [
        ("P6 7 5 255 ", &heights("u8")[..], "colours"),
        ("P4 7 5 ", &heights("u8"), "black and white"),
        ("P5 7 6 255 ", &heights("u8"), "cut short"),
        ("P5 4000000000 4000000000 255 ", &heights("u8"), "cut short"),
        ("P5 7 5 99999 ", &heights("u8"), "largest value"),
        ("P2 7 5 255 ", b"1 2 3", "do not fit"),
        ("P2 2 2 255 ", b"10 20 30     ", "ends before its samples"),
        ("P2 2 2 255 ", b"10 20 300 40", "row 1, column 0: 300 is no whole number"),
        ("P2 2 2 255 ", b"10 -2 30 40", "row 0, column 1"),
    ] {
        let said = refusal(&[file("x.pnm", head, body)]);
        assert!(said.contains(wanted), "{head}: {said}");
    }
}

/// Data that another program's header describes is not read by a label that has its name by chance: SAGA's rows begin in the south.
#[test]
fn data_of_another_header_is_refused() {
    let envi = "ENVI\nsamples = 7\nlines = 5\nbands = 1\ndata type = 4\ninterleave = bsq\nbyte order = 0\n";
    let grid = laid_out("f32le", 1, "bsq", [0; 3]);
    for (data, header) in [("a.sdat", "a.sgrd"), ("a.rst", "a.RDC"), ("a.gri", "a.grd"), ("a.ptf", "a.mrf")] {
        let (folder, path) = pair([data, "a.hdr"], &grid, envi);
        assert_eq!(read(std::slice::from_ref(&path)).unwrap().samples.len(), 35, "{data}");
        std::fs::write(folder.path().join(header), "x").unwrap();
        let said = refusal(std::slice::from_ref(&path));
        assert!(said.contains("beside it describes") && said.contains("gdal_translate"), "{said}");
        // A person knows better.
        let options = OpenOptions { raw: Some("7x5:f32le".into()), ..OpenOptions::default() };
        assert_eq!(open_with(&[path], &options).unwrap().info().samples_wide, 7, "{data}");
    }
}

#[test]
fn a_label_that_says_less_than_the_file_has_is_told() {
    let warnings = |bytes: &[u8], label: &str| {
        let (_folder, path) = pair(["a.bsq", "a.hdr"], bytes, label);
        format!("{:?}", open_with(&[path], &OpenOptions::default()).unwrap().warnings())
    };
    let label = "nrows 5\nncols 7\nnbands 2\nlayout bsq\nnbits 16\npixeltype signedint\nskipbytes 4\nbandrowbytes 16\nbandgapbytes 6\n";
    let mut bytes = laid_out("i16le", 2, "bsq", [4, 2, 6]);
    assert!(!warnings(&bytes, label).contains("bytes more"));
    bytes.extend([0; 20]);
    assert!(warnings(&bytes, label).contains("20 bytes more than a.hdr says"));
}
