//! Sound files to begin from, made once a process.

use std::sync::LazyLock;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{Georeference, HorizontalUnit, MemoryDem, SampleType};
use terrasoar_layout::edit::{Area, Crater, Edit, SampleRect};
use terrasoar_layout::imagery::{Paint, Scorch};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::testing::{Seed, packed_seeds, seeds};

/// A terrain of 60 x 50 samples that lies somewhere: its south-west sample at 1000, 4000 of EPSG 32610, 10 m a sample. With some voids.
pub(crate) static PLAIN: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let hill = |x: u32, y: u32| {
        if x.abs_diff(20) + y.abs_diff(11) < 5 {
            return f64::NAN;
        }
        let wave = 60.0 * (f64::from(x) * 0.21).sin() * (f64::from(y) * 0.17).cos();
        (150.0 + wave).round() + f64::from((x * 31 + y * 57) % 13)
    };
    let mut dem = MemoryDem::from_fn([60, 50], SampleType::I16, hill);
    dem.info_mut().georeference = Georeference {
        epsg: Some(32610),
        unit: HorizontalUnit::Metre,
        pixel_to_crs: Some([1000.0, 10.0, 0.0, 4490.0, 0.0, -10.0]),
        ..Georeference::default()
    };
    let folder = crate::scratch::folder();
    let path = folder.path().join("plain.iqt");
    let options = BuildOptions::default().memory_mib(48);
    build(&dem, &path, &options, &Silent)
        .unwrap_or_else(|error| panic!("a sound terrain is not built: {error}"));
    std::fs::read(&path).unwrap_or_else(|error| panic!("{error}"))
});

/// Sound files of all kinds, those without an overlay.
pub(crate) static TERRAINS: LazyLock<Vec<Seed>> =
    LazyLock::new(|| seeds().into_iter().filter(|seed| seed.files.overlay.is_none()).collect());

/// Sound files of all kinds with an overlay.
pub(crate) static OVERLAYS: LazyLock<Vec<Seed>> =
    LazyLock::new(|| seeds().into_iter().filter(|seed| seed.files.overlay.is_some()).collect());

/// Sound packed files.
pub(crate) static PACKED: LazyLock<Vec<Seed>> = LazyLock::new(packed_seeds);

/// Makes them now, so that their memory is not counted as a body's.
pub(crate) fn make_all() {
    LazyLock::force(&PLAIN);
    LazyLock::force(&TERRAINS);
    LazyLock::force(&OVERLAYS);
    LazyLock::force(&PACKED);
}

/// A crater at a place in metres.
pub(crate) fn dent(centre_m: [f64; 2]) -> Edit {
    Edit::Crater(Crater { centre_m, direction_deg: 30.0, radius_m: 35.0, depth_m: 6.0 })
}

/// A rectangle from a sample on, of one height.
pub(crate) fn level(west: u32, south: u32, height_m: f64) -> Edit {
    let rect = SampleRect { west, south, east: west.saturating_add(6), north: south.saturating_add(4) };
    Edit::Set { area: Area::Rect(rect), height_m }
}

/// Burnt ground at a place in metres.
pub(crate) fn burn(centre_m: [f64; 2]) -> Paint {
    Paint::Scorch(Scorch { centre_m, radius_m: 50.0, direction_deg: 30.0, strength: 0.8 })
}
