//! The measurements that make up an `iobench`, one after the other: counts, times over the map, scratch files, flights over a pool.

use super::Args;
use crate::verbs::cap::Standing;
use crate::verbs::progress::Meter;
use crate::verbs::terrain;
use anyhow::Result;
use std::path::Path;
use terrasoar::stream::ExtendedView;
use terrasoar::view::View;
use terrasoar_lab::iobench::scratch::{Access, ScratchFile};
use terrasoar_lab::iobench::{
    CountOptions, LayoutKind, PoolOptions, Pooled, Prefetch, Reader, Run, ScratchCost, Timed, count,
    fly_pooled, time,
};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::read::terrain::Terrain;

/// The counting run of all readers, and the block length it used.
pub(super) fn counted(args: &Args, views: &[View], progress: &Meter) -> Result<(Vec<Run>, f64)> {
    let terrain = terrain::open_for_pages(&args.file)?;
    let block_m = args.block.unwrap_or_else(|| ExtendedView::block_m(terrain.grid()));
    let options = CountOptions::default()
        .layouts(args.layouts.clone())
        // What is counted has no deadlines; the mesh is what flights over the pool are measured by.
        .preloads(counted_preloads(args))
        .cache_pages(usize::try_from(args.cache * (1 << 20) / PAGE_BYTES as u64).unwrap_or(usize::MAX))
        .disk_pages(usize::try_from(args.disk_pages).unwrap_or(usize::MAX))
        .block_m(block_m)
        .trace(args.scratch.is_some())
        // Of a packed file no more is unpacked than so much.
        .cache_bytes((!terrain.lends_records()).then_some(args.cache << 20));
    let culling = args.quality.quality().culling;
    let mut runs = Vec::new();
    for reader in args.readers() {
        progress.begin(format!("{}, counting", reader.name()), views.len() as u64);
        runs.extend(count(&terrain, views, culling, reader, &options, &mut |done| progress.set(done))?);
    }
    Ok((runs, block_m))
}

fn counted_preloads(args: &Args) -> Vec<Prefetch> {
    let without: Vec<Prefetch> = args.prefetch.iter().copied().filter(|p| *p != Prefetch::Deadline).collect();
    if without.is_empty() { vec![Prefetch::None] } else { without }
}

/// Flights over a pool, a way of preloading each.
pub(super) fn streamed(
    args: &Args,
    views: &[View],
    counted: &[(Run, Option<Timed>)],
    standing: &Standing,
    progress: &Meter,
) -> Result<Vec<(Run, Pooled)>> {
    if !args.flies_pooled() {
        return Ok(Vec::new());
    }
    let mesh = counted
        .iter()
        .map(|(run, _)| run)
        .find(|run| run.reader == Reader::Mesh && run.layout == LayoutKind::Ours);
    let mesh_pages: Vec<u64> = mesh.map_or(Vec::new(), |run| run.frames.iter().map(|f| f.pages).collect());
    let terrain = Terrain::open_unmapped(&args.file)?;
    let flight = |prefetch: &Prefetch| {
        let options = PoolOptions::default()
            .cache_bytes(args.cache << 20)
            .prefetch(*prefetch)
            .culling(args.quality.quality().culling)
            .block_m(args.block)
            .read_by(args.reads)
            .frames_per_second(args.fps);
        progress.begin(format!("pool, {}", prefetch.name()), 2 * views.len() as u64);
        let pooled = standing
            .within(|| Ok(fly_pooled(&args.file, views, options, &mut |done| progress.set(done))?))?;
        Ok((pooled.run(&terrain, *prefetch, &mesh_pages), pooled))
    };
    args.prefetch.iter().map(flight).collect()
}

/// Whether a run is one of the file as it is, without preloading.
pub(super) fn is_plain(run: &Run) -> bool {
    run.layout == LayoutKind::Ours && run.preload == Prefetch::None
}

/// Times each engine over the file as it is; the file must not be mapped meanwhile. A packed one has no map to be timed.
pub(super) fn measured(
    args: &Args,
    views: &[View],
    standing: &Standing,
    progress: &Meter,
) -> Result<Vec<(Reader, Timed)>> {
    if !args.layouts.contains(&LayoutKind::Ours) || !args.prefetch.contains(&Prefetch::None) {
        return Ok(Vec::new());
    }
    if Terrain::open_unmapped(&args.file)?.source().packed_bytes().is_some() {
        return Ok(Vec::new());
    }
    let culling = args.quality.quality().culling;
    let engines = args.readers().filter(|reader| *reader != Reader::Mesh);
    engines
        .map(|reader| {
            progress.begin(format!("{}, timing", reader.name()), 2 * views.len() as u64);
            let timed = standing
                .within(|| Ok(time(&args.file, views, culling, reader, &mut |done| progress.set(done))?))?;
            Ok((reader, timed))
        })
        .collect()
}

/// Replays what was traced against a scratch file a layout: number of the run, by map, by plain reads.
pub(super) fn replayed(
    folder: &Path,
    runs: &[(Run, Option<Timed>)],
    standing: &Standing,
    progress: &Meter,
) -> Result<Vec<(usize, ScratchCost, ScratchCost)>> {
    let mut costs = Vec::new();
    for layout in LayoutKind::ALL {
        let traced = runs.iter().enumerate().filter_map(|(i, (run, _))| {
            let trace = run.trace.as_ref().filter(|_| run.layout == layout && run.reader != Reader::Mesh)?;
            Some((i, run, trace))
        });
        let traced: Vec<_> = traced.collect();
        let Some((_, run, _)) = traced.first() else { continue };
        progress.begin(format!("{}, writing", layout.name()), 0);
        let file = ScratchFile::create(folder, run.file_bytes, &mut |_| {})?;
        for (i, run, trace) in traced {
            let replay = |access, how: &str| {
                let stage = format!("{} {}, {how}", run.reader.name(), layout.name());
                progress.begin(stage, trace.len() as u64);
                standing.within(|| {
                    let costs = file.replay(trace, access, &mut |done| progress.set(done))?;
                    Ok(ScratchCost::of(&costs))
                })
            };
            costs.push((i, replay(Access::Map, "map")?, replay(Access::Pread, "pread")?));
        }
    }
    Ok(costs)
}
