//! What GDAL's library opens beside the formats read here, with the feature `gdal`. Its files are made here, without its tools.

mod import_support;

use import_support::{Grid, collect, fixtures, read};
use std::io::Write;
use std::path::{Path, PathBuf};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::error::LayoutError;

fn with(path: impl AsRef<Path>, options: &OpenOptions) -> Result<Grid, LayoutError> {
    collect(&*open_with(&[path.as_ref().to_owned()], options)?)
}

/// A GRASS grid in text of 9 x 7 samples. Its own sign of no data, a star, is 0 to GDAL 3.6, so that it is stated.
fn grass() -> String {
    let rows =
        (0..7).rev().map(|row| (0..9).map(|col| format!("{} ", 100 + 3 * col + 7 * row)).collect::<String>());
    let rows = rows.collect::<Vec<_>>().join("\n").replace("127 ", "-9999 ");
    format!("north: 43.25\nsouth: 39.75\neast: 14.25\nwest: 9.75\nrows: 7\ncols: 9\nnull: -9999\n{rows}\n")
}

fn is_grass(grid: &Grid) {
    let [x0, a, _, y0, _, e] = grid.info.georeference.pixel_to_crs.unwrap();
    for (col, row) in (0..9u32).flat_map(|col| (0..7u32).map(move |row| (col, row))) {
        let at = [(10.0 + 0.5 * f64::from(col) - x0) / a, (40.0 + 0.5 * f64::from(row) - y0) / e];
        let wanted = f64::from(100 + 3 * col + 7 * row);
        let found = grid.at(at[0].round() as u32, at[1].round() as u32);
        assert!(found == wanted || (wanted == 127.0 && found.is_nan()), "{found} at {col}, {row}");
    }
    assert_eq!(grid.voids(), 1);
}

#[test]
fn a_format_of_gdal_alone_and_virtual_paths() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.asc");
    std::fs::write(&path, grass()).unwrap();
    let degrees = OpenOptions { crs: Some("EPSG:4326".into()), ..OpenOptions::default() };
    let grid = with(&path, &degrees).unwrap();
    assert!(grid.info.format.contains("by GDAL"), "{}", grid.info.format);
    is_grass(&grid);
    let packed = folder.path().join("b.asc.gz");
    let mut encoder =
        flate2::write::GzEncoder::new(std::fs::File::create(&packed).unwrap(), flate2::Compression::new(6));
    encoder.write_all(grass().as_bytes()).unwrap();
    encoder.finish().unwrap();
    is_grass(&with(format!("/vsigzip/{}", packed.display()), &degrees).unwrap());
}

/// A virtual raster of bands of our fixtures.
fn virtual_raster(folder: &Path, sources: &[&str]) -> PathBuf {
    let bands: String = (1..)
        .zip(sources)
        .map(|(number, name)| {
            format!(
                "<VRTRasterBand dataType=\"Int16\" band=\"{number}\"><Description>band {name}</Description><SimpleSource><SourceFilename>{}</SourceFilename>\
                 <SourceBand>1</SourceBand></SimpleSource></VRTRasterBand>",
                fixtures().join(name).display()
            )
        })
        .collect();
    let path = folder.join("a.vrt");
    let text = format!(
        "<VRTDataset rasterXSize=\"70\" rasterYSize=\"50\"><SRS>EPSG:26710</SRS><GeoTransform>565165.6371951220, 10.08128048780488, 0, 4756879.792682927, 0, -13.63902439024390</GeoTransform>{bands}</VRTDataset>"
    );
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn bands_of_a_virtual_raster_and_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let ours = read(&[fixtures().join("int16-strips.tif")]).unwrap();
    let path = virtual_raster(folder.path(), &["int16-strips.tif"]);
    let grid = with(&path, &OpenOptions::default()).unwrap();
    assert_eq!(grid.checksum(), ours.checksum());
    assert_eq!(grid.info.georeference.epsg, Some(26710));
    let (a, b) = (grid.info.georeference.pixel_to_crs.unwrap(), ours.info.georeference.pixel_to_crs.unwrap());
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    let path = virtual_raster(folder.path(), &["byte-strips.tif", "int16-strips.tif"]);
    let said = with(&path, &OpenOptions::default()).err().unwrap().to_string();
    assert!(said.contains("2 bands") && said.contains("2 \"band int16-strips.tif\""), "{said}");
    for word in ["2", "Band int16-strips.tif"] {
        let options = OpenOptions { band: Some(word.into()), ..OpenOptions::default() };
        assert_eq!(with(&path, &options).unwrap().checksum(), ours.checksum());
    }
}

/// GRIB of the second edition is read here; a grid that is not is GDAL's.
#[test]
fn grib_that_is_not_read_here_is_read_by_gdal() {
    let fixture = |name: &str| fixtures().with_file_name("grib_fixtures").join(name);
    let ours = with(fixture("simple.grib2"), &OpenOptions::default()).unwrap();
    assert!(!ours.info.format.contains("by GDAL"), "{}", ours.info.format);
    let theirs = with(fixture("rotated.grib2"), &OpenOptions::default()).unwrap();
    assert!(theirs.info.format.contains("by GDAL"), "{}", theirs.info.format);
    // Several fields are a question, which GDAL would not ask.
    let said = with(fixture("levels.grib2"), &OpenOptions::default()).err().unwrap().to_string();
    assert!(said.contains("at 500 hPa"), "{said}");
}

#[test]
fn what_gdal_does_not_open_either_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xyzzy");
    std::fs::write(&path, "no format at all").unwrap();
    let said = with(&path, &OpenOptions::default()).err().unwrap().to_string();
    assert!(said.contains("and all that GDAL opens"), "{said}");
    let said = with("/vsizip//no/such/file.zip/a.tif", &OpenOptions::default()).err().unwrap().to_string();
    assert!(said.contains("GDAL"), "{said}");
}
