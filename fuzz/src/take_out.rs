//! Ground taken out of a terrain file again: heights, meshes, differences.
//!
//! Whatever the file, each ends in a file or in words. What was exported is a GeoTIFF that opens; a terrain does not differ from itself.

use crate::words::{refused, told};
use std::io;
use std::path::Path;
use terrasoar::simplify::{SimplifyOptions, simplify};
use terrasoar_import::difference::Difference;
use terrasoar_import::export::export_heights;
use terrasoar_lab::mesh_file::{Format, MeshFile, Texture};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

/// Largest terrain that is written: 2^7 + 1 samples a side.
const MOST_K: u32 = 7;

/// Takes out what can be taken out.
pub(crate) fn takes_out(terrain: &Terrain, folder: &Path, is_sound: bool) {
    meshes(terrain, is_sound);
    if terrain.grid().k() > MOST_K {
        return;
    }
    let out = folder.join("out.tif");
    let whole = SampleWindow::of(terrain.grid());
    match export_heights(terrain, &whole, None, &out, &Silent) {
        Ok(written) => {
            let length = std::fs::metadata(&out).unwrap_or_else(|error| panic!("{error}")).len();
            assert_eq!(written.bytes, length, "another length than was told");
            let dem = told(terrasoar_import::open_file(&out));
            assert!(dem.is_some() || !is_sound, "exported and does not open");
        }
        Err(error) => {
            refused(&error);
            assert!(!is_sound, "called sound, and cannot be exported: {error}");
            assert!(!out.exists(), "refused, and something was published: {error}");
        }
    }
    let difference = told(Difference::new(terrain, terrain, &whole));
    if let Some((summary, _)) = difference.and_then(|difference| told(difference.survey(128, &Silent))) {
        assert_eq!((summary.changed, summary.alone), (0, [0; 2]), "a terrain differs from itself");
    }
}

/// Meshes in every format.
fn meshes(terrain: &Terrain, is_sound: bool) {
    let [east, north] = terrain.grid().extent_m();
    let texture = told(Texture::of(terrain, [0.0, 0.0, 0.7 * east, 0.6 * north], 64));
    assert!(texture.is_some() || !is_sound, "called sound, and its picture cannot be read");
    let corner = SampleWindow::within(terrain.grid(), [1.0, 1.0, 9.0, 6.0], 1);
    for (max_error_m, window) in [(0.0, corner), (3.0, None)] {
        let options =
            SimplifyOptions::default().max_error_m(max_error_m).window(window).max_triangles(50_000);
        let Some(mesh) = told(simplify(terrain, &options)) else { continue };
        let file = MeshFile::new(&mesh).texture(texture.as_ref().and_then(Option::as_ref));
        for format in [Format::PlyBinary, Format::PlyText, Format::Obj, Format::Stl, Format::Glb] {
            file.write(format, &mut io::sink()).unwrap_or_else(|error| panic!("{format:?}: {error}"));
        }
    }
}
