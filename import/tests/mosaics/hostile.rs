//! Hostile virtual rasters: words, and memory in proportion to what is allowed.

use crate::ground::{at, inside};
use crate::import_support::collect;
use crate::peak::{alone, peak};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

struct Nothing;

impl SampleSink for Nothing {
    fn put(&self, _: Window, _: &[f64]) -> Result<(), LayoutError> {
        Ok(())
    }

    fn put_void(&self, _: Window) -> Result<(), LayoutError> {
        Ok(())
    }
}

fn options(folder: &Path) -> OpenOptions {
    OpenOptions { memory_mib: Some(48), scratch: Some(folder.to_owned()), ..OpenOptions::default() }
}

/// What is said of a text, and the memory in MiB that it took.
fn told(folder: &Path, text: &str) -> Result<usize, String> {
    let path = folder.join("hostile.vrt");
    std::fs::write(&path, text).unwrap();
    let (read, bytes) = peak(|| open_with(&[path], &options(folder)).and_then(|dem| dem.stream(&Nothing)));
    let took = bytes >> 20;
    assert!(took < 48, "{took} MiB");
    read.map(|()| took).map_err(|error| error.to_string())
}

fn vrt(size: [u64; 2], inside: &str) -> String {
    format!(
        "<VRTDataset rasterXSize=\"{}\" rasterYSize=\"{}\"><VRTRasterBand dataType=\"Float32\" band=\"1\">{inside}</VRTRasterBand></VRTDataset>",
        size[0], size[1]
    )
}

fn source(name: &str, to: &str) -> String {
    format!(
        "<SimpleSource><SourceFilename relativeToVRT=\"1\">{name}</SourceFilename><SourceBand>1</SourceBand>{to}</SimpleSource>"
    )
}

#[test]
fn sources_without_end_sizes_without_sense_and_rings() {
    let _alone = alone();
    let folder = tempdir().unwrap();
    let here = folder.path();
    at(0.0, 1000.0, 10.0).write(inside(here, "a.asc"), "EPSG:32632", |_, _| 7.0);
    let many = vrt([100, 100], &source("a.asc", "").repeat(100_000));
    let said = told(here, &many).unwrap_err();
    assert!(said.contains("longer than") || said.contains("elements"), "{said}");
    let said = told(here, &vrt([100, 100], &"<SimpleSource/>".repeat(70_000))).unwrap_err();
    assert!(said.contains("SourceFilename"), "{said}");
    // The same file again and again is read once.
    told(here, &vrt([100, 100], &source("a.asc", "").repeat(5000))).unwrap();
    // A grid that no memory or file holds, and one whose bytes are few modulo 2^64, by itself, within another one, and brought elsewhere.
    for size in [[2_147_483_647, 2_147_483_647], [1_518_494_220, 1_518_506_280]] {
        let text = vrt(size, &source("a.asc", "")).replace("Float32", "Float64");
        let text = text.replace(
            "<VRTRasterBand",
            "<GeoTransform>0,1,0,0,0,-1</GeoTransform><SRS>EPSG:32632</SRS><VRTRasterBand",
        );
        let wanted = format!("{} x {} samples", size[0], size[1]);
        let said = told(here, &text).unwrap_err();
        assert!(said.contains(&wanted), "{said}");
        std::fs::write(here.join("inner.vrt"), text).unwrap();
        let said = told(here, &vrt([100, 100], &source("inner.vrt", ""))).unwrap_err();
        assert!(said.contains(&wanted) && said.contains("none of them can be read"), "{said}");
        let elsewhere =
            OpenOptions { reproject: Some("EPSG:32633".into()), resolution: Some(1e6), ..options(here) };
        let opened = open_with(&[here.join("inner.vrt")], &elsewhere).and_then(|dem| dem.stream(&Nothing));
        let said = opened.unwrap_err().to_string();
        assert!(said.contains(&wanted), "{said}");
    }
    for to in [
        "<DstRect xOff=\"-1e11\" yOff=\"-1e11\" xSize=\"9e11\" ySize=\"9e11\"/>",
        "<DstRect xOff=\"0\" yOff=\"0\" xSize=\"1e-9\" ySize=\"1e-9\"/>",
        "<SrcRect xOff=\"99\" yOff=\"99\" xSize=\"1e-9\" ySize=\"1e-9\"/><DstRect xOff=\"0\" yOff=\"0\" xSize=\"100\" ySize=\"100\"/>",
    ] {
        told(here, &vrt([100, 100], &source("a.asc", to))).unwrap();
    }
    for to in [
        "<DstRect xOff=\"nan\"/>",
        "<DstRect xOff=\"1e300\" yOff=\"0\" xSize=\"1\" ySize=\"1\"/>",
        "<SrcRect xOff=\"0\" yOff=\"0\" xSize=\"-1\" ySize=\"1\"/>",
    ] {
        let said = told(here, &vrt([100, 100], &source("a.asc", to))).unwrap_err();
        assert!(said.contains("Rect"), "{said}");
    }
    let said = told(here, &vrt([100, 100], &source("hostile.vrt", ""))).unwrap_err();
    assert!(said.contains("made of itself"), "{said}");
    std::fs::write(here.join("other.vrt"), vrt([100, 100], &source("hostile.vrt", ""))).unwrap();
    let said = told(here, &vrt([100, 100], &source("other.vrt", ""))).unwrap_err();
    assert!(said.contains("made of itself"), "{said}");
    for number in 0..12 {
        std::fs::write(
            here.join(format!("{number}.vrt")),
            vrt([100, 100], &source(&format!("{}.vrt", number + 1), "")),
        )
        .unwrap();
    }
    let said = told(here, &vrt([100, 100], &source("0.vrt", ""))).unwrap_err();
    assert!(said.contains("lie in each other"), "{said}");
    #[cfg(unix)]
    for name in ["/dev/zero", "/proc/self/mem", "/"] {
        let said = told(
            here,
            &vrt(
                [100, 100],
                &format!("<SimpleSource><SourceFilename>{name}</SourceFilename></SimpleSource>"),
            ),
        )
        .unwrap_err();
        assert!(said.contains("none of them can be read"), "{said}");
    }
    let bomb = "<!DOCTYPE a [<!ENTITY x \"haha\"><!ENTITY y \"&x;&x;&x;&x;\">]>".to_owned()
        + &vrt([100, 100], "&y;");
    let said = told(here, &format!("<!-- <VRTDataset -->{bomb}")).unwrap_err();
    assert!(said.contains("entities"), "{said}");
}

/// A thousand files as one mosaic take the memory of a few, and are opened one at a time.
#[test]
fn a_thousand_files_take_little_memory() {
    let _alone = alone();
    let folder = tempdir().unwrap();
    let files: Vec<PathBuf> = (0..1000u32)
        .map(|number| {
            let (x, y) = (f64::from(number % 40) * 1000.0, f64::from(number / 40) * 1000.0);
            let height = |x: f64, y: f64| (x + 2.0 * y).round() % 1000.0;
            at(x, 100_000.0 - y, 10.0).write(
                inside(folder.path(), &format!("{number:04}.asc")),
                "EPSG:32632",
                height,
            )
        })
        .collect();
    let (warnings, bytes) = peak(|| {
        let dem = open_with(&files, &options(folder.path())).unwrap();
        dem.stream(&Nothing).unwrap();
        dem.warnings()
    });
    println!("{bytes} bytes for a thousand files");
    assert!(bytes < 20 << 20, "{bytes} bytes");
    assert!(warnings.is_empty(), "{warnings:?}");
    let few = collect(&*open_with(&files[..3], &options(folder.path())).unwrap()).unwrap();
    assert_eq!(few.info.samples_wide, 300);
}
