//! Opening a terrain file takes a few plain reads, however many leaves its directory has.

mod common;

use common::{MemoryDem, build_bytes};
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::file::source::{CountingSource, MemorySource, Source};
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// A source that is still at hand after a terrain took it.
struct Shared(Arc<CountingSource<MemorySource>>);

impl Source for Shared {
    fn path(&self) -> &Path {
        self.0.path()
    }

    fn byte_count(&self) -> u64 {
        self.0.byte_count()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        self.0.read_at(offset, buffer)
    }
}

/// Reads, and bytes read, that opening takes.
fn counts(bytes: Vec<u8>) -> (u64, u64) {
    let source = Arc::new(CountingSource::new(MemorySource::new("counted", bytes)));
    let terrain = Terrain::from_source(Box::new(Shared(Arc::clone(&source)))).unwrap();
    assert!(terrain.page_count() > 1000);
    source.counts()
}

#[test]
fn opening_takes_few_reads() {
    let dem = MemoryDem::from_fn([1025, 900], SampleType::I16, |x, y| f64::from(x * 7 % 300 + y * 11 % 401));
    let bytes = build_bytes(&dem, &BuildOptions::default().spacing_m([10.0; 2])).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [plain, packed] = ["plain.iqt", "packed.iqt"].map(|name| folder.path().join(name));
    std::fs::write(&plain, &bytes).unwrap();
    pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
    let pages = Terrain::open(&plain).unwrap().header().stored_pages;

    let (reads, read) = counts(bytes);
    assert!(reads <= 4, "{reads}");
    assert!(read < 20 * pages + 64 * 1024, "{read}");
    let (reads, read) = counts(std::fs::read(&packed).unwrap());
    assert!(reads <= 3, "{reads}");
    assert!(read < 8 * pages + 96 * 1024, "{read}");
}
