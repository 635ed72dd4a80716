//! Terrain for tests of packed files, and both files of it.

use super::MemoryDem;
use std::path::{Path, PathBuf};
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// Hills with voids, as rough as asked.
pub fn dem(size: [u32; 2], roughness: u32, voids: u32) -> MemoryDem {
    MemoryDem::from_fn(size, SampleType::I16, move |x, y| {
        if voids > 0 && x + y > 0 && (x / 13 + 3 * (y / 17)) % 7 < voids {
            return f64::NAN;
        }
        let (u, v) = (f64::from(x), f64::from(y));
        let rough = f64::from((x * 31 + y * 57) ^ (x * y)) % f64::from(1 + roughness);
        (900.0 + 200.0 * (u * 0.031).sin() + 150.0 * (v * 0.043).cos() + rough).round()
    })
}

pub fn options() -> BuildOptions {
    BuildOptions::default().record(Some(RecordKind::Compact)).spacing_m([20.0, 25.0])
}

/// Whether no error exceeds what is told of it before its record is read; how many are told.
pub fn assert_bounded(terrain: &Terrain) -> usize {
    let grid = terrain.grid();
    let per_page = terrain.header().records_per_page();
    let n = grid.side_steps();
    let points = (0..=n).flat_map(|y| (0..=n).map(move |x| GridPoint::new(x, y)));
    let told = points.filter(|p| {
        let bound_m = terrain.error_bound_m(slot_of(grid.k(), *p) / per_page, *p);
        // One vertex in a few: each is read by itself.
        if (p.x() + 7 * p.y()) % 23 == 0 && !grid.is_corner(*p) {
            let vertex = terrain.checked_vertex(*p).unwrap();
            assert!(vertex.error_m <= bound_m, "{p:?}: {vertex:?} {bound_m}");
        }
        bound_m < f64::INFINITY
    });
    told.count()
}

/// Whether every page of two terrains is the same.
pub fn assert_same(a: &Terrain, b: &Terrain) {
    assert_eq!(a.header(), b.header());
    assert!(a.present_pages().unwrap().eq(b.present_pages().unwrap()));
    // From the last to the first, so that tiles are asked for in another order than they were written in.
    for page in (0..a.page_count()).rev() {
        assert!(a.checked_page(page).unwrap() == b.checked_page(page).unwrap(), "page {page}");
    }
}

pub struct Bench {
    _folder: tempfile::TempDir,
    pub plain: PathBuf,
    pub packed: PathBuf,
}

impl Bench {
    pub fn of(bytes: &[u8]) -> Result<Self, LayoutError> {
        let folder = tempfile::tempdir().unwrap();
        let (plain, packed) = (folder.path().join("plain.iqt"), folder.path().join("packed.iqt"));
        std::fs::write(&plain, bytes).unwrap();
        pack(&SystemDisk, &plain, &packed, &Silent)?;
        Ok(Self { _folder: folder, plain, packed })
    }

    pub fn bytes(&self, path: &Path) -> Vec<u8> {
        std::fs::read(path).unwrap()
    }
}
