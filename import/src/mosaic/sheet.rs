//! The files of one grid, laid one over the other into one store.
//!
//! They are read one after the other, from the lowest to the highest, each into a store of its own; then its samples replace what lies below them. So one file is open at a time, and of a file that fails
//! nothing is laid. Voids replace nothing. Cost: each sample written twice and read twice.

use super::blend::{Blend, Edges, over};
use super::source::{Failure, Read, Source};
use crate::cells::Cells;
use crate::options::{OpenOptions, Priority};
use crate::warp::{Store, each_block};
use std::path::Path;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Columns and rows that are laid at a time.
const PART: [u32; 2] = [2048, 64];
/// The same where seams are blended.
pub(super) const BLENDED: [u32; 2] = [256, 256];

/// One file of a sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Member {
    /// Its number among the files.
    pub(super) source: usize,
    /// Column and row of its first sample.
    pub(super) at: [u32; 2],
}

/// Files of one grid.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) samples: [u32; 2],
    pub(super) map: [f64; 6],
    /// From the lowest to the highest.
    pub(super) members: Vec<Member>,
    /// Number of its reference system.
    pub(super) system: usize,
}

/// The cells of a sheet that its files lie in.
pub(super) fn cells_of(sheet: &Sheet, sources: &[Source]) -> Cells {
    let mut cells = Cells::default();
    for member in &sheet.members {
        let size = sources[member.source].samples;
        cells.add(member.at, [0, 1].map(|i| member.at[i] + size[i]));
    }
    cells
}

/// How samples become those of the mosaic, and where they are kept meanwhile.
pub(super) struct Laying<'a> {
    pub(super) sources: &'a [Source],
    /// How each file is opened.
    pub(super) options: &'a OpenOptions,
    /// Whether numbers become metres, where files count unlike.
    pub(super) in_metres: bool,
    pub(super) sample_bytes: u64,
    /// Largest file in bytes that is kept in memory while it is read.
    pub(super) most_in_memory: u64,
    pub(super) folder: &'a Path,
    pub(super) blend: Option<&'a Blend>,
}

impl Laying<'_> {
    /// Lays the files of a sheet into its `store`; weights of blended seams into `weights`. `told` hears how each file was read.
    ///
    /// # Errors
    /// What is not a file's fault, or what `told` makes of it.
    pub(super) fn lay(
        &self,
        sheet: &Sheet,
        store: &Store,
        weights: Option<&Store>,
        told: &mut dyn FnMut(usize, Result<Read, LayoutError>) -> Result<(), LayoutError>,
    ) -> Result<(), LayoutError> {
        for member in &sheet.members {
            let source = &self.sources[member.source];
            let in_memory = Store::bytes(source.samples, self.sample_bytes) <= self.most_in_memory;
            let own = Store::new(source.samples, self.sample_bytes, in_memory, self.folder)?;
            match source.read(self.options, &own) {
                Ok(read) => told(member.source, Ok(read))?,
                Err(Failure::File(error)) => {
                    told(member.source, Err(error))?;
                    continue;
                }
                Err(Failure::Ours(error)) => return Err(error),
            }
            self.over(source, *member, &own, store, weights)?;
        }
        Ok(())
    }

    /// Lays a file's samples over what is there.
    fn over(
        &self,
        source: &Source,
        member: Member,
        own: &Store,
        store: &Store,
        weights: Option<&Store>,
    ) -> Result<(), LayoutError> {
        // Edges are looked for around each part, so that square ones take least.
        let size = if self.blend.is_some() { BLENDED } else { PART };
        let edges = self.blend.map(|blend| blend.edges(member.source));
        each_block(source.samples, size, |window| {
            self.part(source, member, window, own, store, weights, edges.as_ref())
        })
    }

    #[allow(clippy::too_many_arguments, reason = "a step of `over`, which has them all")]
    fn part(
        &self,
        source: &Source,
        member: Member,
        window: Window,
        own: &Store,
        store: &Store,
        weights: Option<&Store>,
        edges: Option<&Edges>,
    ) -> Result<(), LayoutError> {
        let size = [window.width as usize, window.height as usize];
        let first = [i64::from(window.col), i64::from(window.row)];
        let mut new = own.window(first, size, false)?.into_values();
        if new.iter().all(|value| value.is_nan()) {
            return Ok(());
        }
        if self.in_metres {
            let [scale, offset] = source.metres;
            new.iter_mut().for_each(|value| *value = *value * scale + offset);
        }
        let to = Window { col: window.col + member.at[0], row: window.row + member.at[1], ..window };
        let there = [i64::from(to.col), i64::from(to.row)];
        let mut values = store.window(there, size, false)?.into_values();
        match (edges, weights) {
            (Some(edges), Some(kept)) => {
                let fresh = edges.weights(own, first, size)?;
                let mut old = kept.window(there, size, false)?.into_values();
                for (i, value) in values.iter_mut().enumerate() {
                    over(value, &mut old[i], new[i], fresh[i]);
                }
                kept.put(to, &old)?;
            }
            _ => {
                let highest = self.options.priority == Priority::Highest;
                values.iter_mut().zip(&new).for_each(|(value, new)| replace(value, *new, highest));
            }
        }
        store.put(to, &values)
    }
}

/// Puts a sample in the place of one below it.
pub(super) fn replace(value: &mut f64, new: f64, highest: bool) {
    let stays = new.is_nan() || highest && *value >= new;
    if !stays {
        *value = new;
    }
}
