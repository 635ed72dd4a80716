//! How fast formats are read, and in how much memory: a table for a look, and a bound on memory for the test.
//!
//! `TERRASOAR_SIDE=16384 cargo test -p terrasoar-import --test import_speeds -- --ignored --nocapture`; 4096 samples a side where nothing is said.

#[path = "import_support/gdal.rs"]
mod gdal;
mod import_support;
#[path = "import_support/peak.rs"]
mod peak;

use gdal::run;
use peak::{alone, peak};
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Counts samples.
struct Count(AtomicU64);

impl SampleSink for Count {
    fn put(&self, _: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.0.fetch_add(samples.len() as u64, Ordering::Relaxed);
        Ok(())
    }
}

/// Rough ground of `side` samples a side, in degrees.
fn source(folder: &Path, side: u32) {
    let mut file = std::io::BufWriter::new(std::fs::File::create(folder.join("source.raw")).unwrap());
    for row in 0..side {
        for col in 0..side {
            let noise = (col.wrapping_mul(2_654_435_761) ^ row.wrapping_mul(40_503)) >> 27;
            let height = ((col / 8) % 700 + (row / 5) % 900 + noise) as i16;
            file.write_all(&height.to_le_bytes()).unwrap();
        }
    }
    file.flush().unwrap();
    let vrt = format!(
        "<VRTDataset rasterXSize=\"{side}\" rasterYSize=\"{side}\"><SRS>EPSG:4326</SRS><GeoTransform>10, 0.0001, 0, 50, 0, -0.0001</GeoTransform>\
         <VRTRasterBand dataType=\"Int16\" band=\"1\" subClass=\"VRTRawRasterBand\"><SourceFilename relativetoVRT=\"1\">source.raw</SourceFilename>\
         <ByteOrder>LSB</ByteOrder><PixelOffset>2</PixelOffset><LineOffset>{}</LineOffset></VRTRasterBand></VRTDataset>",
        2 * side
    );
    std::fs::write(folder.join("source.vrt"), vrt).unwrap();
}

#[test]
#[ignore = "needs GDAL's tools, and time"]
fn formats_are_read_in_little_memory() {
    let _alone = alone();
    let side: u32 = std::env::var("TERRASOAR_SIDE").map_or(4096, |side| side.parse().expect("a number"));
    let folder = tempfile::tempdir().unwrap();
    source(folder.path(), side);
    let formats: [(&str, &str, &[&str]); 9] = [
        ("classic.nc", "netCDF", &["-co", "FORMAT=NC2"]),
        ("nc4.nc", "netCDF", &["-co", "FORMAT=NC4"]),
        ("nc4-deflate.nc", "netCDF", &["-co", "FORMAT=NC4", "-co", "COMPRESS=DEFLATE"]),
        ("raw.tif", "GTiff", &["-co", "TILED=YES"]),
        ("deflate.tif", "GTiff", &["-co", "TILED=YES", "-co", "COMPRESS=DEFLATE", "-co", "PREDICTOR=2"]),
        ("lerc.tif", "GTiff", &["-co", "TILED=YES", "-co", "COMPRESS=LERC"]),
        ("lerc-zstd.tif", "GTiff", &["-ot", "Float32", "-co", "TILED=YES", "-co", "COMPRESS=LERC_ZSTD"]),
        ("bits-12.tif", "GTiff", &["-ot", "UInt16", "-co", "NBITS=12", "-co", "TILED=YES"]),
        (
            "one-strip.tif",
            "GTiff",
            &["-co", "COMPRESS=DEFLATE", "-co", &format!("BLOCKYSIZE={side}")]
                .map(|o| &*String::leak(o.to_owned())),
        ),
    ];
    for (name, driver, options) in formats {
        run(
            folder.path(),
            "gdal_translate",
            &[&["-q", "-of", driver][..], options, &["source.vrt", name]].concat(),
        );
        let path = folder.path().join(name);
        let dem = terrasoar_import::open(std::slice::from_ref(&path)).unwrap();
        let told = dem.memory_bytes();
        let count = Count(AtomicU64::new(0));
        let begun = Instant::now();
        let (done, bytes) = peak(|| dem.stream(&count));
        done.unwrap();
        let seconds = begun.elapsed().as_secs_f64();
        let samples = count.0.into_inner();
        assert_eq!(samples, u64::from(side) * u64::from(side), "{name}");
        println!(
            "{name:16} {:7.1} million samples a second, {:5.1} MiB at the peak, {:5.1} of them told",
            samples as f64 / seconds / 1e6,
            bytes as f64 / f64::from(1 << 20),
            told as f64 / f64::from(1 << 20)
        );
        // A megabyte or two a thread, and what all readers may take.
        let allowed = told + (rayon::current_num_threads() as u64) * (4 << 20) + (24 << 20);
        assert!((bytes as u64) < allowed, "{name}: {bytes} bytes, {allowed} allowed");
        std::fs::remove_file(&path).unwrap();
    }
}
