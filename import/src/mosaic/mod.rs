//! Several files as one elevation model: of unlike resolution, reference system, "no data", unit and overlap.
//!
//! Files on one grid are laid into a *sheet*, bit for bit ([`sheet`]). Sheets come onto the grid of the mosaic ([`target`]): copied where they lie on it, else by the kernels of warps. What is
//! over what is decided once ([`plan`]). A file that is missing or damaged is named and left out, whole. **The order of names, where it does not decide what counts, and the number of threads change nothing.**
//! One file is open at a time. Memory: a share of what is allowed, a few hundred bytes a file, and what reading one file takes. Cost: two passes over the samples, and that of a warp for sheets on other
//! grids.

mod across;
mod aim;
mod blend;
mod lattice;
mod levels;
mod names;
mod plan;
mod sheet;
mod source;
mod target;
mod told;
mod values;

use crate::cells::{CELL, Cells, each_block_met};
use crate::crs::{System, shift_in_doubt};
use crate::guard::is_ours;
use crate::opened::{Known, OpenedDem};
use crate::options::{OpenOptions, Priority, Resampling};
use crate::reader::{Declared, Reader, Said};
use crate::value::Voids;
use crate::warp::{Store, blocks_bytes};
use aim::{Aim, aimed};
use blend::{Blend, Edges, over};
pub(crate) use names::Inputs;
use plan::Placed;
use sheet::{BLENDED, Laying, Sheet, cells_of, replace};
pub(crate) use source::open_one;
use source::{Source, options_of_each};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use target::{Laid, Target, Way};
use terrasoar_layout::dem::{DemSource, SampleSink, Warning, Window};
use terrasoar_layout::error::LayoutError;
use told::Told;
use values::{Values, real};

/// Files of one mosaic, at most.
const MOST_FILES: usize = 1 << 16;
/// Share of the memory allowed that all sheets may take, and that one file may.
const SHEETS_SHARE: u64 = 4;
const FILE_SHARE: u64 = 8;
/// Old samples that weights are taken of for one block where new samples are made, with their margin: bytes.
const WEIGHTS_BYTES: u64 = 24 * 1540 * 1540;
/// Columns and rows of a block where samples are copied.
const COPIED: [u32; 2] = [2048, 32];

/// The files `paths` as one elevation model.
///
/// # Errors
/// As [`crate::open_with`]; where `strict` is asked for, whatever is wrong with a file.
pub(crate) fn open(paths: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn DemSource>, LayoutError> {
    if paths.len() > MOST_FILES {
        return Err(LayoutError::Usage(format!(
            "{} files are more than the {MOST_FILES} that one mosaic takes; join some of them first",
            paths.len()
        )));
    }
    if options.feather_m.is_some() && options.priority == Priority::Highest {
        return Err(LayoutError::Usage(
            "seams are blended between files of which one lies over the other, and by the priority highest none does; choose first, last or finest".into(),
        ));
    }
    let each = options_of_each(options);
    let mut told = Told::default();
    let mut looked = Vec::new();
    for (rank, path) in in_order(paths, options.priority) {
        match Source::look(&path, rank, &each) {
            Ok(found) => looked.push(found),
            Err(error) if options.strict || is_ours(&error) => return Err(error),
            Err(error) => told.lose(&path, &error),
        }
    }
    if looked.is_empty() {
        return Err(told.nothing_read());
    }
    let (placed, sheets, aim) = aimed(Placed::new(looked), options, &mut told)?;
    placed.sources.iter().for_each(|source| told.look(source));
    let name = aim::name(&placed);
    let (mosaic, known, later) = Mosaic::new(&name, (placed, sheets, aim), each, options, told)?;
    let declared = mosaic.declared.clone();
    Ok(Box::new(OpenedDem::known(&name, Box::new(mosaic), declared, known, &later)?))
}

/// Each file once, in the order of their paths, with its place among the names: of several places the one on top.
fn in_order(paths: &[PathBuf], priority: Priority) -> Vec<(usize, PathBuf)> {
    let mut seen = HashSet::new();
    let whole = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
    let mut files: Vec<(PathBuf, usize, PathBuf)> =
        paths.iter().enumerate().map(|(rank, path)| (whole(path), rank, path.clone())).collect();
    if priority == Priority::Last {
        files.reverse();
    }
    files.retain(|(whole, ..)| seen.insert(whole.clone()));
    files.sort();
    files.into_iter().map(|(_, rank, path)| (rank, path)).collect()
}

/// Several files.
struct Mosaic {
    declared: Declared,
    sources: Vec<Source>,
    /// How each file is opened.
    each: OpenOptions,
    sheets: Vec<Sheet>,
    /// Of each sheet, the cells that files lie in.
    cells: Vec<Cells>,
    laid: Vec<Laid>,
    in_metres: bool,
    sample_bytes: u64,
    sheets_in_memory: bool,
    most_in_memory: u64,
    folder: PathBuf,
    /// Blending of files within a sheet, and of sheets.
    blend: Option<[Blend; 2]>,
    /// What was said when it was opened, and with what was seen while it streamed.
    opened: Told,
    told: Mutex<Told>,
}

impl Mosaic {
    /// The mosaic, what is known of it, and what is left to be done with it.
    fn new(
        name: &Path,
        (placed, sheets, aim): (Placed, Vec<Sheet>, Aim),
        each: OpenOptions,
        options: &OpenOptions,
        told: Told,
    ) -> Result<(Self, Known, OpenOptions), LayoutError> {
        let values = Values::of(&placed.sources);
        let sample_bytes = if values.sample_type.fits_f32() { 4 } else { 8 };
        let mut later = OpenOptions { crs: None, ..options.clone() };
        let mut asked = options.clone();
        if options.reproject.is_some() {
            match aim.is_later {
                true => asked.resolution = None,
                false => later.reproject = None,
            }
        }
        let target = Target::new(name, &placed, &sheets, aim, sample_bytes, &asked)?;
        if later.reproject.is_none() {
            later.resolution = None;
        }
        let blend = match options.feather_m {
            None => None,
            Some(metres) => {
                let steps: Vec<[f64; 2]> = (0..placed.sources.len()).map(|at| placed.steps_m(at)).collect();
                let of_sheet =
                    |sheet: &Sheet| sheet.members.first().map_or([1.0; 2], |member| steps[member.source]);
                let of_sheets = sheets.iter().map(of_sheet).collect();
                Some([Blend::new(metres, steps.clone())?, Blend::new(metres, of_sheets)?])
            }
        };
        let resampled = target.laid.iter().filter(|laid| matches!(laid.way, Way::Resampled(_))).count();
        let resampling = options.resampling.unwrap_or_default();
        let is_made = blend.is_some() || resampled > 0 && resampling != Resampling::Nearest;
        let sample_type = if is_made { real(values.sample_type) } else { values.sample_type };
        let mut declared = Declared::new(target.samples, sample_type, format_of(&placed.sources));
        declared.place = Some(Said::new(target.map, "the places of the files"));
        declared.notes = vec![note(&placed, &sheets, resampled, resampling, options)];
        let (vertical, unlike) = levels::of(&placed.sources);
        let rough = placed.systems.iter().enumerate().find_map(|(number, tied)| {
            let doubt =
                tied.ground.as_ref()?.doubt(target.tied.ground.as_ref()?, &placed.places_in(number))?;
            Some(Warning::new(shift_in_doubt(doubt, &tied.system.name, &target.tied.system.name)))
        });
        let bytes = Store::all_bytes(sheets.iter().map(|sheet| &sheet.samples), sample_bytes);
        let bytes = if blend.is_some() { bytes.saturating_mul(2) } else { bytes };
        let allowed = options.memory_mib.unwrap_or(512) << 20;
        let mosaic = Self {
            declared,
            cells: sheets.iter().map(|sheet| cells_of(sheet, &placed.sources)).collect(),
            sources: placed.sources,
            each,
            sheets,
            laid: target.laid,
            in_metres: values.in_metres,
            sample_bytes,
            sheets_in_memory: bytes <= allowed / SHEETS_SHARE,
            most_in_memory: allowed / FILE_SHARE,
            folder: options.scratch.clone().unwrap_or_else(std::env::temp_dir),
            blend,
            opened: told.clone(),
            told: Mutex::new(told),
        };
        let known = Known {
            system: System { vertical, ..target.tied.system },
            heights: values.heights,
            voids: Voids::new(name, &[], &[], sample_type)?,
            mask: None,
            warnings: unlike.into_iter().chain(rough).collect(),
        };
        Ok((mosaic, known, later))
    }

    fn is_copied(&self) -> bool {
        self.laid.iter().all(|laid| matches!(laid.way, Way::Copied(_)))
    }

    /// The samples of a window of the mosaic, of all sheets.
    fn block(&self, window: Window, stores: &[Store], sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let met: Vec<bool> =
            self.laid.iter().zip(&self.cells).map(|(laid, cells)| laid.meets(window, cells)).collect();
        if !met.contains(&true) {
            return sink.put_void(window);
        }
        let count = window.width as usize * window.height as usize;
        let mut values = vec![f64::NAN; count];
        let mut weights = if self.blend.is_some() { vec![0.0; count] } else { Vec::new() };
        let highest = self.each.priority == Priority::Highest;
        for (number, (laid, store)) in self.laid.iter().zip(stores).enumerate() {
            if !met[number] {
                continue;
            }
            let edges = self.blend.as_ref().map(|[_, sheets]| sheets.edges(number));
            let mut put = |part: Window, new: &[f64], fresh: Option<&[f64]>| {
                let (left, wide) = ((part.col - window.col) as usize, part.width as usize);
                for row in 0..part.height as usize {
                    let to = ((part.row - window.row) as usize + row) * window.width as usize + left;
                    for i in 0..wide {
                        let new = new[row * wide + i];
                        match fresh {
                            None => replace(&mut values[to + i], new, highest),
                            Some(fresh) => {
                                over(&mut values[to + i], &mut weights[to + i], new, fresh[row * wide + i]);
                            }
                        }
                    }
                }
            };
            match &laid.way {
                Way::Copied(at) => {
                    let first = [i64::from(window.col) - at[0], i64::from(window.row) - at[1]];
                    let size = [window.width as usize, window.height as usize];
                    let fresh = edges.map(|edges| edges.weights(store, first, size)).transpose()?;
                    put(window, &store.window(first, size, false)?.into_values(), fresh.as_deref());
                }
                Way::Resampled(resampler) => resampler.block(store, window, &mut |part, new| {
                    let Some(new) = new else { return Ok(()) };
                    let fresh =
                        edges.map(|edges| around(&edges, store, &resampler.places(part))).transpose()?;
                    put(part, new, fresh.as_deref());
                    Ok(())
                })?,
            }
        }
        if values.iter().all(|value| value.is_nan()) {
            sink.put_void(window)
        } else {
            sink.put(window, &values)
        }
    }
}

/// The weights at places among the samples of a store.
fn around(edges: &Edges, store: &Store, places: &[[f64; 2]]) -> Result<Vec<f64>, LayoutError> {
    let found = || places.iter().filter(|place| place[0].is_finite() && place[1].is_finite());
    let low = [0, 1].map(|i| found().map(|place| place[i]).fold(f64::INFINITY, f64::min).round());
    let high = [0, 1].map(|i| found().map(|place| place[i]).fold(f64::NEG_INFINITY, f64::max).round());
    if low[0] > high[0] {
        return Ok(vec![0.0; places.len()]);
    }
    let size = [0, 1].map(|i| (high[i] - low[i]) as usize + 1);
    let weights = edges.weights(store, low.map(|low| low as i64), size)?;
    let at = |place: &[f64; 2]| {
        let [x, y] = [0, 1].map(|i| place[i].round() - low[i]);
        if place[0].is_finite() { weights[y as usize * size[0] + x as usize] } else { 0.0 }
    };
    Ok(places.iter().map(at).collect())
}

/// What the files are, in words.
fn format_of(sources: &[Source]) -> String {
    let mut formats: Vec<&str> = sources.iter().map(|source| source.format.as_str()).collect();
    formats.sort_unstable();
    formats.dedup();
    let listed = if formats.len() <= 3 { formats.join(", ") } else { format!("{} formats", formats.len()) };
    format!("mosaic of {} ({listed})", plan::counted(sources.len()))
}

/// What is kept of how it was put together.
fn note(
    placed: &Placed,
    sheets: &[Sheet],
    resampled: usize,
    resampling: Resampling,
    options: &OpenOptions,
) -> String {
    let paths: Vec<PathBuf> = placed.sources.iter().map(|source| source.path.clone()).collect();
    let mut words = format!(
        "mosaic of {}, {}, priority {}",
        plan::counted(paths.len()),
        plan::names(&paths),
        options.priority.name()
    );
    if placed.lattices.len() > 1 {
        words += &format!(", on {} grids", placed.lattices.len());
    }
    if resampled > 0 {
        words += &format!(", {resampled} of {} parts resampled ({})", sheets.len(), resampling.name());
    }
    if let Some(metres) = options.feather_m {
        words += &format!(", seams blended over {} m", terrasoar_layout::words::number(metres));
    }
    words
}

impl Reader for Mosaic {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn warnings(&self) -> Vec<Warning> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner).warnings(self.sources.len())
    }

    fn memory_bytes(&self) -> u64 {
        let stores = Store::all_bytes(self.sheets.iter().map(|sheet| &sheet.samples), self.sample_bytes);
        let planes = if self.blend.is_some() { 2 } else { 1 };
        let kept = if self.sheets_in_memory { planes * stores } else { 0 };
        let files = self.sources.iter().map(|source| Store::bytes(source.samples, self.sample_bytes));
        let own = files.filter(|bytes| *bytes <= self.most_in_memory).max().unwrap_or(0);
        let reading = self.sources.iter().map(|source| source.memory_bytes).max().unwrap_or(0);
        let threads = rayon::current_num_threads() as u64;
        let blocks = if self.is_copied() { 0 } else { blocks_bytes() };
        let blending = self.blend.as_ref().map_or(0, |[files, _]| {
            threads * files.bytes(BLENDED).max(if self.is_copied() { 0 } else { WEIGHTS_BYTES })
        });
        kept + (own + reading).max(blocks) + blending
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let sizes: Vec<[u32; 2]> = self.sheets.iter().map(|sheet| sheet.samples).collect();
        let several = || Store::several(&sizes, self.sample_bytes, self.sheets_in_memory, &self.folder);
        let stores = several()?;
        let weights = self.blend.is_some().then(several).transpose()?;
        let mut told = self.opened.clone();
        let laying = Laying {
            sources: &self.sources,
            options: &self.each,
            in_metres: self.in_metres,
            sample_bytes: self.sample_bytes,
            most_in_memory: self.most_in_memory,
            folder: &self.folder,
            blend: self.blend.as_ref().map(|[files, _]| files),
        };
        for (number, (sheet, store)) in self.sheets.iter().zip(&stores).enumerate() {
            let weights = weights.as_ref().map(|weights| &weights[number]);
            laying.lay(sheet, store, weights, &mut |source, read| {
                let source = &self.sources[source];
                match read {
                    Ok(read) => told.read(source, read),
                    Err(error) if self.each.strict => return Err(error),
                    Err(error) => told.lose(&source.path, &error),
                }
                Ok(())
            })?;
        }
        drop(weights);
        let read = told.count_read();
        let nothing = told.nothing_read();
        *self.told.lock().unwrap_or_else(PoisonError::into_inner) = told;
        if read == 0 {
            return Err(nothing);
        }
        let size = if self.is_copied() && self.blend.is_none() { COPIED } else { BLENDED };
        let is_met =
            |cell: Window| self.laid.iter().zip(&self.cells).any(|(laid, cells)| laid.meets(cell, cells));
        let pass = |window| sink.put_void(window);
        let make = |(): &mut (), window| self.block(window, &stores, sink);
        each_block_met(self.declared.samples, size, CELL, is_met, pass, || (), make)
    }
}
