//! A terrain to edit in a folder of its own, and what is seen of it.

use super::MemoryDem;
use std::path::PathBuf;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// A folder with a terrain in it.
pub struct Bench {
    pub folder: tempfile::TempDir,
}

impl Bench {
    pub fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        let dem = MemoryDem::from_fn([150, 120], SampleType::I16, |x, y| {
            f64::from((x * 7 + y * 13) % 100 + x / 3 + y / 2)
        });
        let options = BuildOptions::default().spacing_m([10.0; 2]);
        build(&dem, &bench.terrain(), &options, &Silent).unwrap();
        bench
    }

    /// The same, packed.
    pub fn packed() -> Self {
        let bench = Self::new();
        let plain = bench.path("plain.iqt");
        std::fs::rename(bench.terrain(), &plain).unwrap();
        pack(&SystemDisk, &plain, &bench.terrain(), &Silent).unwrap();
        std::fs::remove_file(&plain).unwrap();
        bench
    }

    /// Both ways to hold it, one after the other.
    pub fn both() -> impl Iterator<Item = Self> {
        [Self::new, Self::packed].into_iter().map(|make| make())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn terrain(&self) -> PathBuf {
        self.path("t.iqt")
    }
}

/// The `i`-th of edits at places that are far from each other.
pub fn set(i: u32) -> Edit {
    let (west, south) = (i * 37 % 120, i * 53 % 100);
    let rect = SampleRect { west, south, east: west + 12, north: south + 9 };
    Edit::Set { area: Area::Rect(rect), height_m: f64::from(20 + i % 60) }
}

/// All record pages.
pub fn pages(terrain: &Terrain) -> Vec<u8> {
    (0..terrain.header().record_pages()).flat_map(|i| terrain.checked_page(i).unwrap().to_vec()).collect()
}

/// All record pages as a session has them now.
pub fn session_pages(session: &mut EditSession) -> Vec<u8> {
    let pages = session.header().record_pages();
    (0..pages).flat_map(|i| session.editor_mut().page(i).unwrap().to_vec()).collect()
}
