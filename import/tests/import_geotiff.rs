//! GeoTIFF against what GDAL reads in the same files: `fixtures/expected.txt`, made with them by
//! `data-scripts/make-tiff-fixtures.py`.

mod import_support;

use import_support::{fixtures, read, refusal};
use terrasoar_layout::dem::HorizontalUnit;

#[test]
fn every_fixture_reads_as_gdal_reads_it() {
    let expected = std::fs::read_to_string(fixtures().join("expected.txt")).unwrap();
    let mut failures = Vec::new();
    for line in expected.lines() {
        let fields: Vec<&str> = line.split(' ').collect();
        let [name, width, height, voids, checksum, ..] = fields[..] else { panic!("{line}") };
        let grid = match read(&[fixtures().join(name)]) {
            Ok(grid) => grid,
            Err(error) => {
                failures.push(error.to_string());
                continue;
            }
        };
        let info = &grid.info;
        assert_eq!(
            (info.samples_wide.to_string().as_str(), info.samples_high.to_string().as_str()),
            (width, height),
            "{name}"
        );
        if grid.voids().to_string() != voids || format!("{:08x}", grid.checksum()) != checksum {
            failures.push(format!(
                "{name}: {} voids, {voids} expected; {:08x}",
                grid.voids(),
                grid.checksum()
            ));
        }
        match info.georeference.pixel_to_crs {
            None => assert_eq!(fields[5], "-", "{name}"),
            Some(map) => {
                for (value, text) in map.iter().zip(&fields[5..11]) {
                    let wanted: f64 = text.parse().unwrap();
                    assert!(
                        (value - wanted).abs() <= 1e-9 * wanted.abs().max(1e-6),
                        "{name}: {map:?}, {line}"
                    );
                }
            }
        }
        let epsg = info.georeference.epsg.map_or("-".to_owned(), |code| code.to_string());
        assert_eq!(epsg, fields[11], "{name}");
        assert_eq!(info.height_scale, fields[12].parse::<f64>().unwrap(), "{name}");
        assert_eq!(info.height_offset_m, fields[13].parse::<f64>().unwrap(), "{name}");
    }
    assert!(expected.lines().count() >= 61, "the list is cut short");
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn reference_systems_are_named() {
    let of = |name: &str| read(&[fixtures().join(name)]).unwrap().info;
    let utm = of("int16-strips.tif");
    assert_eq!(utm.georeference.unit, HorizontalUnit::Metre);
    assert_eq!(utm.georeference.crs_name, "NAD27 / UTM zone 10N");
    assert_eq!(utm.georeference.body_radius_m, None);
    assert_eq!(of("place-degrees.tif").georeference.unit, HorizontalUnit::Degree);
    assert_eq!(of("place-feet.tif").georeference.unit, HorizontalUnit::Foot);
    assert_eq!(of("place-us-feet.tif").georeference.unit, HorizontalUnit::UsSurveyFoot);
    assert_eq!(of("uint16-no-place.tif").georeference, Default::default());
    let moon = of("place-moon.tif");
    assert_eq!(moon.georeference.body_radius_m, Some(1_737_400.0));
    assert_eq!(moon.georeference.unit, HorizontalUnit::Degree);
    assert!(of("int16-strips-bigtiff-deflate.tif").format.starts_with("BigTIFF"));
}

#[test]
fn what_is_not_read_is_named_with_the_way_out() {
    for (name, words) in [
        ("two-bands", ["2 bands", "say which one holds the heights"]),
        ("rgb", ["colour picture", "mapbox"]),
        ("jpeg", ["JPEG", "COMPRESS=DEFLATE"]),
        ("lzma", ["LZMA", "COMPRESS=DEFLATE"]),
        ("complex", ["complex", "-ot Float32"]),
    ] {
        let message = refusal(&[fixtures().join(format!("refused-{name}.tif"))]);
        for word in words {
            assert!(message.contains(word), "{message}");
        }
    }
}
