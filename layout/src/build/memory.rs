//! How a build's memory budget is spent: the largest tile that fits, and whether the samples may stay in memory.
//!
//! It estimates all that grows with the terrain, rather too high than too low. `benches/runs` has what was measured.

use super::land::{BLOCK, Land};
use super::options::{BuildOptions, LARGEST_TILE};
use crate::dem::SampleType;
use crate::error::LayoutError;
use crate::file::directory_shape::DirectoryShape;
use crate::grid::Grid;
use crate::grid::order::slot_count;
use crate::grid::record::RecordKind;
use crate::remedy::Remedy;

/// Mebibyte.
const MIB: u64 = 1 << 20;
/// Memory kept aside for decoders, threads and the program itself.
const RESERVED_BYTES: u64 = 24 * MIB;

/// How the budget is spent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct MemoryPlan {
    /// Side of a tile in steps, a power of two.
    pub(super) tile: u32,
    /// Bytes the spool may hold in memory.
    pub(super) spool_bytes: u64,
}

impl MemoryPlan {
    pub(super) fn new(
        grid: &Grid,
        land: &Land,
        sample_type: SampleType,
        options: &BuildOptions,
        threads: u64,
        reading_bytes: u64,
    ) -> Result<Self, LayoutError> {
        let memory_mib = options.memory_mib;
        let budget = memory_mib.saturating_mul(MIB);
        // While samples are read nothing is worked on yet, so this is beside the spool alone.
        let reading = RESERVED_BYTES.saturating_add(reading_bytes);
        if reading > budget {
            let enough_mib = reading.div_ceil(MIB);
            return Err(LayoutError::Usage(format!(
                "{memory_mib} MiB are too few to read this elevation model, whose compression needs {} MiB at once; allow at least {enough_mib}",
                reading_bytes.div_ceil(MIB)
            ))
            .mended_by(Remedy::Memory { enough_mib: Some(enough_mib) }));
        }
        let [wide, high] = grid.samples().map(u64::from);
        let n = grid.side_steps();
        let single = sample_type.fits_f32();
        // The widest record the samples may need; the range of 16-bit integers always fits the compact one.
        let record_bytes = match (sample_type.is_integer(), single) {
            (true, true) if options.record.is_none_or(RecordKind::has_height_codes) => 4,
            (_, true) => 8,
            (_, false) => 16,
        };
        let ([widest, runs], blocks, block) = (land.widest(), land.blocks(), u64::from(BLOCK));
        // Pages of the directory and their plan, some 34 bytes each. Around blocks with heights there are some that hold little.
        let slots = slot_count(grid.k());
        let near = (blocks + 64) * block * block * 5;
        // The root, which leads to leaves, or in the largest squares to nodes.
        let shape = DirectoryShape::new(grid.k(), slots * record_bytes / 4096);
        let root = shape.root_entries() * 44;
        let directory = slots.min(near) * record_bytes / 4096 * 34 + root;
        let fixed = RESERVED_BYTES + directory;
        let work = |tile: u32| {
            let tile = u64::from(tile);
            // What lies between blocks with heights takes nothing, but records on all sides of them do something.
            let wide_near = wide.min(widest * block + 8 * runs * tile);
            // A code, a void and an own error for every corner of a tile.
            let corners = (wide / tile + 2) * (high / tile + 2);
            let corners_near = (blocks + 64) * (block / tile + 1) * (block / tile + 1);
            // Codes and voids of some 3.5 tile rows, records and own errors beside them, rows of records that wait for their pages.
            wide_near * (7 * tile / 2 + 8) * (10 + 3 * record_bytes / 2)
                + wide_near * 128 * record_bytes
                + threads * (tile + 1) * (tile + 1) * 8
                + corners.min(corners_near) * 13
                + (high / tile + 2) * 256
        };
        let largest = n.min(options.largest_tile.clamp(2, LARGEST_TILE));
        let smallest = largest.min(16);
        let spool = wide * high * if single { 4 } else { 8 };
        let available = budget.saturating_sub(fixed);
        let tiles = || (0..=8).rev().map(|m| 1 << m).filter(|s| (smallest..=largest).contains(s));
        let largest_within = |bytes: u64| tiles().find(|s| work(*s) <= bytes);
        if let Some(tile) = largest_within(available.saturating_sub(spool))
            .filter(|t| *t >= largest.min(128) && reading + spool <= budget)
        {
            return Ok(Self { tile, spool_bytes: spool });
        }
        match largest_within(available) {
            Some(tile) => Ok(Self { tile, spool_bytes: 0 }),
            None => {
                let enough_mib = (fixed + tiles().map(work).min().unwrap_or(0)).div_ceil(MIB);
                Err(LayoutError::Usage(format!(
                    "{memory_mib} MiB are too few for an elevation model of {wide} x {high} samples; allow at least {enough_mib}"
                ))
                .mended_by(Remedy::Memory { enough_mib: Some(enough_mib) }))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(side: u32, sample_type: SampleType, memory_mib: u64) -> Result<MemoryPlan, LayoutError> {
        let grid = Grid::new([side, side - 1], [1.0, 1.0]).unwrap();
        let land = Land::in_windows(grid.samples(), None);
        MemoryPlan::new(&grid, &land, sample_type, &BuildOptions { memory_mib, ..Default::default() }, 2, 0)
    }

    #[test]
    fn the_largest_terrain_of_16_bits_fits_the_default_budget() {
        assert_eq!(plan(65_537, SampleType::I16, 512).unwrap(), MemoryPlan { tile: 32, spool_bytes: 0 });
        assert_eq!(plan(16_385, SampleType::U16, 512).unwrap(), MemoryPlan { tile: 256, spool_bytes: 0 });
        assert_eq!(plan(2049, SampleType::U16, 512).unwrap().spool_bytes, 2049 * 2048 * 4);
    }

    #[test]
    fn the_budget_that_a_refusal_names_is_the_least_that_is_enough() {
        for side in [4097, 16_385, 30_000, 65_537] {
            for sample_type in [SampleType::I16, SampleType::F32, SampleType::F64] {
                let refusal = plan(side, sample_type, 24).unwrap_err();
                let Some(Remedy::Memory { enough_mib: Some(named) }) = refusal.remedy() else {
                    panic!("{refusal}")
                };
                assert!(refusal.to_string().ends_with(&format!(" {named}")), "{refusal}");
                assert!(plan(side, sample_type, named).is_ok(), "{refusal}");
                assert!(plan(side, sample_type, named - 1).is_err(), "{refusal}");
            }
        }
    }

    #[test]
    fn what_reading_takes_counts() {
        let grid = Grid::new([2049; 2], [1.0; 2]).unwrap();
        let with = |memory_mib, reading_mib| {
            let options = BuildOptions { memory_mib, ..Default::default() };
            let land = Land::in_windows(grid.samples(), None);
            MemoryPlan::new(&grid, &land, SampleType::U16, &options, 2, reading_mib * MIB)
        };
        assert!(with(512, 10).unwrap().spool_bytes > 0);
        assert_eq!(with(512, 480).unwrap().spool_bytes, 0);
        let refusal = with(64, 128).unwrap_err();
        assert_eq!(refusal.remedy(), Some(Remedy::Memory { enough_mib: Some(152) }), "{refusal}");
        assert!(with(152, 128).is_ok());
    }
}
