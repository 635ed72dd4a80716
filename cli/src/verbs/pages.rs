//! Memory for pages that a verb reads as it needs them, and words for frames that it is too small for.

use super::output::grouped;
use super::terrain::TerrainArgs;
use anyhow::Result;
use serde::Serialize;
use std::time::Duration;
use terrasoar::stats::FrameStats;
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::read::store::PagesRead;
use terrasoar_layout::read::terrain::Terrain;

/// Memory for pages.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct CacheArgs {
    /// Read pages when they are needed, into so much memory; without it packed terrain has 128 MiB, and other terrain is mapped
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..=1 << 24))]
    cache: Option<u64>,
}

impl CacheArgs {
    /// Opens a terrain: mapped, or to be read into the memory that is given too.
    pub(super) fn open(self, args: &TerrainArgs) -> Result<(Terrain, Option<u64>)> {
        let mut terrain = args.open()?;
        if self.cache.is_some() && terrain.lends_records() {
            terrain = terrain.open_again_unmapped()?;
        }
        let cache_bytes = terrain.cache_bytes(self.cache.map(|mib| mib << 20));
        Ok((terrain, cache_bytes))
    }
}

/// What was read for a mesh, in the words of `replay`; nothing where records were taken where they lie.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub(super) struct ReadForIt {
    cache_mib: Option<u64>,
    pages_read: Option<u64>,
    tiles_unpacked: Option<u64>,
    tile_bytes_read: Option<u64>,
    read_ms: Option<f64>,
    unpack_ms: Option<f64>,
}

impl ReadForIt {
    pub(super) fn of(read: Option<PagesRead>, cache_bytes: Option<u64>) -> Self {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let unpacked = read.and_then(|read| read.unpacked);
        Self {
            cache_mib: cache_bytes.map(|bytes| bytes >> 20),
            pages_read: read.map(|read| read.pages),
            tiles_unpacked: unpacked.map(|unpacked| unpacked.tiles),
            tile_bytes_read: unpacked.map(|unpacked| unpacked.bytes),
            read_ms: read.map(|read| ms(read.time)),
            unpack_ms: unpacked.map(|unpacked| ms(unpacked.time)),
        }
    }

    /// In a line.
    pub(super) fn words(&self) -> Option<String> {
        let pages = format!("{} pages read as needed", grouped(self.pages_read?));
        let tiles = self.tiles_unpacked.zip(self.tile_bytes_read).map(|(tiles, bytes)| {
            format!(", from {} tiles of {} bytes in all", grouped(tiles), grouped(bytes))
        });
        let unpacking = self.unpack_ms.map(|ms| format!(", {ms:.1} ms of it for unpacking"));
        Some(format!(
            "{pages}{}; waited {:.1} ms for them{}",
            tiles.unwrap_or_default(),
            self.read_ms?,
            unpacking.unwrap_or_default()
        ))
    }
}

/// In words, that a frame reads more pages than the memory holds.
pub(super) fn too_few(frames: &[FrameStats], cache_bytes: Option<u64>) -> Option<String> {
    let cache_mib = cache_bytes? >> 20;
    let most = frames.iter().max_by_key(|frame| frame.pages_touched)?;
    // A quarter may be for what pages are unpacked from.
    let bytes = (most.pages_touched * PAGE_BYTES as u64).saturating_mul(4).div_ceil(3);
    let mib = bytes.div_ceil(1 << 20);
    (mib > cache_mib).then(|| {
        format!(
            "note: frame {} reads {} pages, for which {} MiB are too few, so that pages are read more than once; --cache {mib} holds them",
            most.frame,
            grouped(most.pages_touched),
            grouped(cache_mib)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_that_is_too_small_for_a_frame_is_told_with_what_would_do() {
        let frames = [900, 1000, 300].map(|pages_touched| FrameStats {
            frame: pages_touched / 100,
            pages_touched,
            ..FrameStats::default()
        });
        assert_eq!(too_few(&frames, None), None);
        assert_eq!(too_few(&frames, Some(6 << 20)), None);
        assert_eq!(too_few(&[], Some(1 << 20)), None);
        let words = too_few(&frames, Some(2 << 20)).unwrap();
        assert!(words.contains("frame 10 reads 1,000 pages, for which 2 MiB are too few"), "{words}");
        assert!(words.ends_with("--cache 6 holds them"), "{words}");
    }
}
