//! What a replay of packed terrain takes: the memory that it was given, and what it takes over mapped terrain. Alone in its process, whose allocations it counts.

mod common;

use common::{frame, rugged};
use peak_alloc::PeakAlloc;
use terrasoar::flyover::{EngineKind, Quality, replay};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// What threads have at hand while they unpack, and tables of tiles.
const BESIDE: usize = 2 << 20;

#[test]
fn memory_follows_what_was_given() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, packed] = ["plain.iqt", "packed.iqt"].map(|name| folder.path().join(name));
    let dem = MemoryDem::from_fn([1537, 1537], SampleType::I16, |x, y| rugged(6, x, y));
    build(&dem, &plain, &BuildOptions::default().spacing_m([10.0, 12.0]), &Silent).unwrap();
    pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
    drop(dem);
    let mapped = Terrain::open(&plain).unwrap();
    let at = |i| frame(&mapped, [0.3, 0.1 + 0.1 * f64::from(i)], 1500.0, 10.0 * f64::from(i), -30.0);
    let flight: Vec<_> = (0..6).map(at).collect();
    let taken = |terrain: &Terrain, kind, quality| {
        ALLOCATOR.reset_peak_usage();
        let before = ALLOCATOR.current_usage();
        let frames = replay(terrain, &flight, quality, kind, &mut |_| {}).unwrap();
        assert!(frames[0].pages_touched > 100, "{}", frames[0].pages_touched);
        ALLOCATOR.peak_usage() - before
    };
    let quality = Quality::default().tolerance_px(2.0);
    for kind in [EngineKind::Kinetic, EngineKind::Soar] {
        let own = taken(&mapped, kind, quality);
        for cache_bytes in [1 << 20, 4 << 20] {
            let streamed = Terrain::open_unmapped(&packed).unwrap();
            let found = taken(&streamed, kind, quality.cache_bytes(cache_bytes));
            let most = own + cache_bytes as usize + BESIDE;
            assert!(
                found < most,
                "{kind:?}: {found} bytes, {own} of them over mapped terrain, {cache_bytes} given"
            );
        }
        let whole = Terrain::open(&packed).unwrap();
        assert!(taken(&whole, kind, quality) > whole.header().file_bytes as usize, "the whole takes more");
    }
}
