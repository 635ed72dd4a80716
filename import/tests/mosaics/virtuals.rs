//! Virtual rasters written by hand: pieces, scales, tables, masks, nesting, refusals. Those that GDAL writes are compared with it in `import_gdal_mosaics`.

use crate::ground::{at, inside};
use crate::import_support::collect;
use crate::priority::{height, read};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::dem::SampleType;

/// Writes a virtual raster of 100 x 100 samples of 10 m with this inside its band.
fn written(folder: &Path, name: &str, band: &str, inside: &str) -> PathBuf {
    let path = folder.join(name);
    let text = format!(
        "<VRTDataset rasterXSize=\"100\" rasterYSize=\"100\">\n<SRS>EPSG:32632</SRS>\n<GeoTransform>0, 10, 0, 1000, 0, -10</GeoTransform>\n\
         <VRTRasterBand {band} band=\"1\">{inside}</VRTRasterBand></VRTDataset>\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn source(kind: &str, name: &str, rest: &str) -> String {
    format!(
        "<{kind}><SourceFilename relativeToVRT=\"1\">{name}</SourceFilename><SourceBand>1</SourceBand>{rest}</{kind}>"
    )
}

fn refusal(path: &Path) -> String {
    let read =
        open_with(&[path.to_owned()], &OpenOptions::default()).and_then(|dem| collect(&*dem).map(|_| ()));
    read.expect_err("it was read").to_string()
}

#[test]
fn pieces_are_laid_scaled_and_looked_up() {
    let folder = tempdir().unwrap();
    at(0.0, 1000.0, 10.0).write(inside(folder.path(), "a.asc"), "EPSG:32632", |x, _| (x / 10.0).floor());
    let all = source("SimpleSource", "a.asc", "");
    let part = |kind, more: &str| {
        source(
            kind,
            "a.asc",
            &format!(
                "<SrcRect xOff=\"10\" yOff=\"0\" xSize=\"20\" ySize=\"20\"/><DstRect xOff=\"50\" yOff=\"50\" xSize=\"40\" ySize=\"40\"/>{more}"
            ),
        )
    };
    let values = |name: &str, inside: &str| {
        let grid =
            read(&[written(folder.path(), name, "dataType=\"Int16\"", inside)], &OpenOptions::default());
        assert_eq!(grid.info.sample_type, SampleType::I16);
        [(5.0, 995.0), (505.0, 495.0), (515.0, 495.0), (525.0, 495.0), (895.0, 105.0)]
            .map(|(x, y)| height(&grid, x, y))
    };
    assert_eq!(values("all.vrt", &all), [0.0, 50.0, 51.0, 52.0, 89.0]);
    // Two for one.
    assert_eq!(
        values("part.vrt", &format!("{all}{}", part("SimpleSource", ""))),
        [0.0, 10.0, 10.0, 11.0, 29.0]
    );
    let scaled = part(
        "ComplexSource",
        "<ScaleOffset>1000</ScaleOffset><ScaleRatio>0.5</ScaleRatio><NODATA>11</NODATA>",
    );
    assert_eq!(values("scaled.vrt", &format!("{all}{scaled}")), [0.0, 1005.0, 1005.0, 52.0, 1015.0]);
    let table = part("ComplexSource", "<LUT>10:100,20:200,30:-300</LUT>");
    assert_eq!(values("table.vrt", &format!("{all}{table}")), [0.0, 100.0, 100.0, 110.0, -250.0]);
    // Alone, what it does not cover is void; a mark is void, unless it is hidden.
    let grid = read(
        &[written(folder.path(), "alone.vrt", "dataType=\"Int16\"", &part("SimpleSource", ""))],
        &OpenOptions::default(),
    );
    assert_eq!(grid.voids(), 10_000 - 1600);
    let marked = format!("<NoDataValue>50</NoDataValue>{all}");
    let grid =
        read(&[written(folder.path(), "marked.vrt", "dataType=\"Int16\"", &marked)], &OpenOptions::default());
    assert_eq!(grid.voids(), 100);
    let hidden = format!("<HideNoDataValue>1</HideNoDataValue>{marked}");
    let grid =
        read(&[written(folder.path(), "hidden.vrt", "dataType=\"Int16\"", &hidden)], &OpenOptions::default());
    assert_eq!(grid.voids(), 0);
    // Feet, a scale, and a number that the type does not hold.
    let units = format!("<UnitType>ft</UnitType><Scale>0.1</Scale><Offset>5</Offset>{all}");
    let grid =
        read(&[written(folder.path(), "units.vrt", "dataType=\"Int16\"", &units)], &OpenOptions::default());
    assert!(
        (grid.info.height_scale - 0.03048).abs() < 1e-12 && (grid.info.height_offset_m - 1.524).abs() < 1e-12
    );
    let large = source("ComplexSource", "a.asc", "<ScaleRatio>1000</ScaleRatio>");
    assert_eq!(values("large.vrt", &large), [0.0, 32_767.0, 32_767.0, 32_767.0, 32_767.0]);
}

#[test]
fn virtual_rasters_in_each_other_and_lost_files() {
    let folder = tempdir().unwrap();
    at(0.0, 1000.0, 10.0).write(inside(folder.path(), "a.asc"), "EPSG:32632", |_, _| 7.0);
    written(folder.path(), "inner.vrt", "dataType=\"Int16\"", &source("SimpleSource", "a.asc", ""));
    let lost = source(
        "SimpleSource",
        "none.asc",
        "<DstRect xOff=\"0\" yOff=\"0\" xSize=\"50\" ySize=\"50\"/><SrcRect xOff=\"0\" yOff=\"0\" xSize=\"50\" ySize=\"50\"/>",
    );
    let inner = source("SimpleSource", "inner.vrt", "");
    let outer = written(folder.path(), "outer.vrt", "dataType=\"Int16\"", &format!("{inner}{lost}"));
    let dem = open_with(std::slice::from_ref(&outer), &OpenOptions::default()).unwrap();
    let grid = collect(&*dem).unwrap();
    assert!(grid.samples.iter().all(|h| *h == 7.0));
    let said: Vec<String> = dem.warnings().into_iter().map(|warning| warning.words).collect();
    assert!(said.len() == 1 && said[0].contains("none.asc") && said[0].contains("left out"), "{said:?}");
    let strict = OpenOptions { strict: true, ..OpenOptions::default() };
    let error = open_with(std::slice::from_ref(&outer), &strict)
        .and_then(|dem| collect(&*dem).map(|_| ()))
        .unwrap_err();
    assert!(error.to_string().contains("none.asc"), "{error}");
    // As one file of several.
    let more = at(1000.0, 1000.0, 10.0).write(inside(folder.path(), "more.asc"), "EPSG:32632", |_, _| 9.0);
    let dem = open_with(&[outer, more], &OpenOptions::default()).unwrap();
    let grid = collect(&*dem).unwrap();
    assert_eq!([grid.at(0, 0), grid.at(199, 0)], [7.0, 9.0]);
    assert!(dem.warnings().iter().any(|warning| warning.words.contains("none.asc")));
    let alone = written(folder.path(), "alone.vrt", "dataType=\"Int16\"", &lost);
    assert!(refusal(&alone).contains("none of them can be read"));
    if cfg!(feature = "gdal") {
        // That is GDAL's.
        return;
    }
    let far = "<SimpleSource><SourceFilename>/vsicurl/https://example.org/a.tif</SourceFilename><SourceBand>1</SourceBand></SimpleSource>";
    assert!(refusal(&written(folder.path(), "far.vrt", "", far)).contains("gdal_translate far.vrt"));
}

#[test]
#[cfg_attr(feature = "gdal", ignore = "GDAL's library reads these")]
fn what_gdal_computes_is_refused_with_the_command() {
    let folder = tempdir().unwrap();
    at(0.0, 1000.0, 10.0).write(inside(folder.path(), "a.asc"), "EPSG:32632", |_, _| 7.0);
    let all = source("SimpleSource", "a.asc", "");
    let derived = "subClass=\"VRTDerivedRasterBand\"";
    let function = format!("<PixelFunctionType>sum</PixelFunctionType>{all}");
    let said = refusal(&written(folder.path(), "sum.vrt", derived, &function));
    assert!(
        said.contains("pixel function sum") && said.contains("gdal_translate sum.vrt heights.tif"),
        "{said}"
    );
    for (band, inside, wanted) in [
        ("subClass=\"VRTRawRasterBand\"", String::new(), "VRTRawRasterBand"),
        ("", source("KernelFilteredSource", "a.asc", ""), "KernelFilteredSource"),
        (
            "",
            source("ComplexSource resampling=\"mode\"", "a.asc", "")
                .replace("</ComplexSource resampling=\"mode\">", "</ComplexSource>"),
            "resampling mode",
        ),
        ("dataType=\"CFloat32\"", all.clone(), "CFloat32"),
        ("", source("SimpleSource", "a.asc", "<SrcRect xOff=\"a\"/>"), "SrcRect xOff"),
        ("", source("ComplexSource", "a.asc", "<LUT>2:1,1:2</LUT>"), "LUT"),
        ("", source("ComplexSource", "a.asc", "<NODATA>none</NODATA>"), "NODATA"),
    ] {
        let said = refusal(&written(folder.path(), "x.vrt", band, &inside));
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
    let several = folder.path().join("two.vrt");
    let band =
        |number: u32| format!("<VRTRasterBand band=\"{number}\" dataType=\"Int16\">{all}</VRTRasterBand>");
    std::fs::write(
        &several,
        format!("<VRTDataset rasterXSize=\"100\" rasterYSize=\"100\">{}{}</VRTDataset>", band(1), band(2)),
    )
    .unwrap();
    assert!(refusal(&several).contains("-separate"));
    let options = OpenOptions { band: Some("2".into()), ..OpenOptions::default() };
    assert_eq!(read(&[several], &options).at(5, 5), 7.0);
    for (text, wanted) in [
        (
            "<VRTDataset subClass=\"VRTWarpedDataset\" rasterXSize=\"9\" rasterYSize=\"9\"/>",
            "VRTWarpedDataset",
        ),
        ("<VRTDataset rasterXSize=\"0\" rasterYSize=\"9\"/>", "rasterXSize"),
        ("<VRTDataset rasterXSize=\"9\" rasterYSize=\"99999999999\"/>", "rasterYSize"),
        ("<VRTDataset rasterXSize=\"9\" rasterYSize=\"9\"/>", "no band"),
        ("<VRTDataset rasterXSize=\"9\" rasterYSize=\"9\">", "line 1"),
    ] {
        let path = folder.path().join("y.vrt");
        std::fs::write(&path, text).unwrap();
        let said = refusal(&path);
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
}

#[test]
fn masks_hide() {
    let folder = tempdir().unwrap();
    at(0.0, 1000.0, 10.0)
        .write(inside(folder.path(), "a.asc"), "EPSG:32632", |x, _| if x < 300.0 { f64::NAN } else { 7.0 });
    at(0.0, 1000.0, 10.0)
        .write(inside(folder.path(), "m.asc"), "EPSG:32632", |_, y| if y < 500.0 { 0.0 } else { 255.0 });
    let path = folder.path().join("masked.vrt");
    let text = |mask: &str| {
        format!(
            "<VRTDataset rasterXSize=\"100\" rasterYSize=\"100\"><MaskBand><VRTRasterBand dataType=\"Byte\">{mask}</VRTRasterBand></MaskBand>\
             <VRTRasterBand dataType=\"Float32\" band=\"1\">{}</VRTRasterBand></VRTDataset>",
            source("SimpleSource", "a.asc", "")
        )
    };
    std::fs::write(&path, text(&source("SimpleSource", "m.asc", ""))).unwrap();
    let grid = read(std::slice::from_ref(&path), &OpenOptions::default());
    assert!(grid.at(50, 10) == 7.0 && grid.at(50, 60).is_nan());
    let own = "<SimpleSource><SourceFilename relativeToVRT=\"1\">a.asc</SourceFilename><SourceBand>mask,1</SourceBand></SimpleSource>";
    std::fs::write(&path, text(own)).unwrap();
    let grid = read(&[path], &OpenOptions::default());
    assert!(grid.at(50, 10) == 7.0 && grid.at(10, 10).is_nan());
}
