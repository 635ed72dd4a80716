//! The timed pass: a flight over the mapped file, cold and warm, with what the kernel says about each frame.
//!
//! Cold begins after the system was asked to forget the file, so nothing may have it mapped when this starts. Warm flies the same frames again with a new engine over
//! what the cold pass left in memory. What a frame waited for storage is its cold time beyond its warm one.

use super::kernel::{self, Faults};
use super::{IoBenchError, Reader};
use std::path::Path;
use std::time::Instant;
use terrasoar::flyover::EngineKind;
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::View;
use terrasoar_layout::file::source::resident_bytes;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// One update as clock and kernel saw it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct UpdateCost {
    /// Milliseconds.
    pub ms: f64,
    /// Faults of the thread that flew; `None` where not known.
    pub faults: Option<Faults>,
    /// Bytes that storage delivered; `None` where not known.
    pub read_bytes: Option<u64>,
}

/// A flight cold and warm.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Timed {
    /// Whether the system could be asked to forget the file before the cold pass.
    pub was_forgotten: bool,
    /// Each frame's cost, cold.
    pub cold: Vec<UpdateCost>,
    /// Each frame's cost, warm.
    pub warm: Vec<UpdateCost>,
    /// Bytes of the file that the system held after the cold pass; `None` where not known.
    pub resident_bytes: Option<u64>,
    /// Most memory held during the cold pass in bytes, mapped pages included; `None` where not known.
    pub peak_memory_bytes: Option<u64>,
}

/// Flies `views` over the file at `path` twice. `done` hears the number of frame passes finished, twice the frames in all.
///
/// # Errors
/// The file cannot be opened, forgotten or mapped.
pub fn time(
    path: &Path,
    views: &[View],
    culling: Culling,
    reader: Reader,
    done: &mut dyn FnMut(u64),
) -> Result<Timed, IoBenchError> {
    forget(path)?;
    let terrain = Terrain::open(path)?;
    // With what the system read ahead while the file was opened, which may be all of it.
    let was_forgotten = forget(path)?;
    let records = terrain.records()?;
    with_records!(records, records => {
        let knows_peak = kernel::reset_peak_memory();
        let cold = fly(&records, views, culling, reader, 0, done);
        let peak_memory_bytes = if knows_peak { kernel::peak_memory_bytes() } else { None };
        let resident_bytes = resident_bytes(path)?;
        let warm = fly(&records, views, culling, reader, views.len() as u64, done);
        Ok(Timed { resident_bytes, was_forgotten, cold, warm, peak_memory_bytes })
    })
}

fn fly<C: RecordCodec>(
    records: &Records<'_, C>,
    views: &[View],
    culling: Culling,
    reader: Reader,
    begun: u64,
    done: &mut dyn FnMut(u64),
) -> Vec<UpdateCost> {
    let done = &mut |i| done(begun + i);
    match reader.engine() {
        EngineKind::Naive => fly_with(Naive::new(records.clone(), culling), views, done),
        EngineKind::Soar => fly_with(Soar::new(records.clone(), culling), views, done),
        EngineKind::Smart => fly_with(Smart::new(records.clone(), culling), views, done),
        EngineKind::Kinetic => fly_with(Kinetic::new(records.clone(), culling), views, done),
    }
}

fn fly_with(mut engine: impl Engine, views: &[View], done: &mut dyn FnMut(u64)) -> Vec<UpdateCost> {
    let update = |(i, view): (usize, &View)| {
        let cost = observed(|| {
            engine.update(view, &mut Unobserved);
        });
        done(i as u64 + 1);
        cost
    };
    views.iter().enumerate().map(update).collect()
}

/// Asks the system to forget the file; whether it can be asked.
pub(super) fn forget(path: &Path) -> Result<bool, IoBenchError> {
    kernel::forget_file(path).map_err(|source| IoBenchError::Io {
        doing: "cannot drop the file from memory",
        path: path.into(),
        source,
    })
}

/// What `work` costs.
pub(super) fn observed(work: impl FnOnce()) -> UpdateCost {
    let (faults, bytes) = (kernel::thread_faults(), kernel::read_bytes());
    let start = Instant::now();
    work();
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let faults = kernel::thread_faults()
        .zip(faults)
        .map(|(now, then)| Faults { minor: now.minor - then.minor, major: now.major - then.major });
    let read_bytes = kernel::read_bytes().zip(bytes).map(|(now, then)| now - then);
    UpdateCost { ms, faults, read_bytes }
}
