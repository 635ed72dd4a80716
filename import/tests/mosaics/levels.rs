//! What heights are measured from: kept where files agree, told where they do not.

use crate::damage::warnings;
use crate::ground::{at, inside};
use crate::priority::read;
use tempfile::tempdir;
use terrasoar_import::OpenOptions;

#[test]
fn unlike_levels_are_named_and_none_is_shifted() {
    let folder = tempdir().unwrap();
    let file = |name: &str, west: f64, system: &str| {
        at(west, 47.0, 0.001).write(inside(folder.path(), name), system, |_, _| 100.0)
    };
    let a = file("a.asc", 8.0, "EPSG:4326+5773");
    let b = file("b.asc", 8.1, "EPSG:4326+3855");
    let c = file("c.asc", 8.2, "EPSG:4326+3855");
    let plain = file("plain.asc", 8.3, "EPSG:4326");
    let zone = at(499_000.0, 5_220_000.0, 90.0).write(
        inside(folder.path(), "zone.asc"),
        "EPSG:32632+5783",
        |_, _| 100.0,
    );
    let told = |files: &[&std::path::PathBuf]| {
        let files: Vec<_> = files.iter().map(|path| (*path).clone()).collect();
        let said = warnings(&files, &OpenOptions::default());
        let said: Vec<String> = said.into_iter().filter(|words| words.contains("unlike levels")).collect();
        let grid = read(&files, &OpenOptions::default());
        assert!(grid.samples.iter().all(|height| height.is_nan() || *height == 100.0));
        (said, grid.info.about.vertical_name.clone())
    };
    let (said, kept) = told(&[&a, &b, &c]);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("EGM96 height (a.asc), EGM2008 height (b.asc and 1 more)"), "{said:?}");
    assert_eq!(kept, "EGM2008 height");
    // Of other systems as well.
    let (said, _) = told(&[&b, &zone]);
    assert!(said.len() == 1 && said[0].contains("DHHN92 height (zone.asc)"), "{said:?}");
    // What agrees, or is not said, is no matter.
    for files in [&[&b, &c][..], &[&b, &plain], &[&plain, &b], &[&plain]] {
        let (said, kept) = told(files);
        assert!(said.is_empty(), "{said:?}");
        assert_eq!(kept.is_empty(), files.len() == 1, "{kept}");
    }
    // By name what has no code is the same.
    let wkt = "COMPD_CS[\"a\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],\
               VERT_CS[\"EGM2008 height\",VERT_DATUM[\"EGM2008 geoid\",2005],UNIT[\"metre\",1]]]";
    let named = file("named.asc", 8.4, wkt);
    let (said, kept) = told(&[&b, &named]);
    assert!(said.is_empty() && kept == "EGM2008 height", "{said:?} {kept}");
    // Heights above the ellipsoid are of another level than those above the sea.
    let ellipsoid = file("ellipsoid.asc", 8.5, "EPSG:4979");
    let (said, _) = told(&[&b, &ellipsoid]);
    assert!(said.len() == 1 && said[0].contains("llipsoid"), "{said:?}");
}
