//! The samples on their way from the DEM to the build: one row-major copy, south row first, in memory if the budget
//! allows, else in a nameless temporary file.
//!
//! While samples arrive their statistics are taken: range, voids, and which height steps they are whole multiples of. A void is
//! NaN. Samples that single precision holds exactly take 4 bytes, others 8. A void's bytes are zero, so rows of voids are never written: the
//! file has a hole there, and no room is taken.

use super::land::{BLOCK, Land};
use crate::bound::range;
use crate::dem::{DemInfo, SampleSink, SampleType, Window};
use crate::error::LayoutError;
use crate::error::is_full;
use crate::file::atomic::folder_of;
use crate::file::disk::Disk;
use crate::remedy::Remedy;
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError, RwLock};

/// Height steps tried on floating-point samples, in raw units, coarsest first.
pub(super) const CANDIDATE_STEPS: [f64; 9] = [1.0, 0.5, 0.25, 0.125, 0.1, 0.05, 0.02, 0.01, 0.001];

/// What is known of the samples once all have arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SampleStats {
    /// Lowest and highest raw value; NaN if all are void.
    pub(super) range: [f64; 2],
    pub(super) voids: u64,
    /// Which of [`CANDIDATE_STEPS`] all samples are whole multiples of.
    pub(super) steps: [bool; CANDIDATE_STEPS.len()],
    /// Whether single precision holds every sample exactly.
    pub(super) fits_f32: bool,
}

impl SampleStats {
    fn new() -> Self {
        Self { range: [f64::NAN; 2], voids: 0, steps: [true; CANDIDATE_STEPS.len()], fits_f32: true }
    }

    fn merge(&mut self, other: &Self) {
        self.range = [self.range[0].min(other.range[0]), self.range[1].max(other.range[1])];
        self.voids += other.voids;
        self.steps.iter_mut().zip(other.steps).for_each(|(a, b)| *a &= b);
        self.fits_f32 &= other.fits_f32;
    }

    fn of(samples: &[f64], sample_type: SampleType) -> Self {
        let mut stats = Self::new();
        stats.voids = samples.iter().map(|v| u64::from(v.is_nan())).sum();
        if stats.voids < samples.len() as u64 {
            stats.range = range(samples);
        }
        if !sample_type.fits_f32() {
            stats.fits_f32 = samples.iter().all(|v| v.is_nan() || f64::from(*v as f32) == *v);
        }
        if !sample_type.is_integer() {
            for (holds, step) in stats.steps.iter_mut().zip(CANDIDATE_STEPS) {
                *holds = samples.iter().all(|v| v.is_nan() || is_multiple(*v, step, sample_type));
            }
        }
        stats
    }
}

/// Whether `value` is what its type makes of a whole number of `step`s.
fn is_multiple(value: f64, step: f64, sample_type: SampleType) -> bool {
    let exact = (value / step).round() * step;
    if sample_type == SampleType::F32 { exact as f32 == value as f32 } else { exact == value }
}

/// What the bits of stored samples are combined with, so that a void's are zero.
const VOID_F32: u32 = f32::NAN.to_bits();
const VOID_F64: u64 = f64::NAN.to_bits();

enum Storage {
    Memory(RwLock<Vec<u8>>),
    File(File),
}

/// The spooled samples of one DEM.
pub(super) struct Spool<'a> {
    disk: &'a dyn Disk,
    target: PathBuf,
    wide: u32,
    high: u32,
    double: bool,
    sample_type: SampleType,
    nodata: Option<f64>,
    storage: Storage,
    stats: Mutex<SampleStats>,
    /// Which rows, from the south, have a sample that is not void.
    has_heights: Vec<AtomicBool>,
    /// Which blocks have.
    land: Land,
    advance: &'a (dyn Fn(u64) + Sync),
}

impl<'a> Spool<'a> {
    /// An empty spool for the samples of `info`, in memory if that takes at most `memory_bytes`, else in the folder of `target`.
    pub(super) fn new(
        disk: &'a dyn Disk,
        info: &DemInfo,
        nodata: Option<f64>,
        target: &Path,
        memory_bytes: u64,
        advance: &'a (dyn Fn(u64) + Sync),
    ) -> Result<Self, LayoutError> {
        let double = !info.sample_type.fits_f32();
        let bytes = u64::from(info.samples_wide) * u64::from(info.samples_high) * if double { 8 } else { 4 };
        let storage = if bytes <= memory_bytes {
            Storage::Memory(RwLock::new(vec![0; crate::file::bytes::to_usize(bytes)?]))
        } else {
            let file = tempfile::tempfile_in(folder_of(target))
                .and_then(|file| disk.set_len(&file, bytes).map(|()| file))
                .map_err(|e| failed(target, "cannot create a temporary file beside it", e))?;
            Storage::File(file)
        };
        Ok(Self {
            disk,
            target: target.to_owned(),
            wide: info.samples_wide,
            high: info.samples_high,
            double,
            sample_type: info.sample_type,
            nodata,
            storage,
            stats: Mutex::new(SampleStats::new()),
            land: Land::none([info.samples_wide, info.samples_high]),
            has_heights: (0..info.samples_high).map(|_| AtomicBool::new(false)).collect(),
            advance,
        })
    }

    /// Statistics of what has arrived.
    pub(super) fn stats(&self) -> SampleStats {
        *self.stats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn sample_bytes(&self) -> u64 {
        if self.double { 8 } else { 4 }
    }

    /// Whether all of row `y`, counted from the south, is void.
    pub(super) fn is_void_row(&self, y: u32) -> bool {
        !self.has_heights[y as usize].load(Ordering::Relaxed)
    }

    /// Where samples are that are not void.
    pub(super) fn land(&self) -> &Land {
        &self.land
    }

    /// Raw samples of row `y`, counted from the south, from a column on.
    pub(super) fn read_part(&self, y: u32, col: u32, row: &mut [f64]) -> Result<(), LayoutError> {
        if self.is_void_row(y) {
            row.fill(f64::NAN);
            return Ok(());
        }
        let offset = (u64::from(y) * u64::from(self.wide) + u64::from(col)) * self.sample_bytes();
        let length = row.len() * self.sample_bytes() as usize;
        match &self.storage {
            Storage::Memory(bytes) => {
                let bytes = bytes.read().unwrap_or_else(PoisonError::into_inner);
                let at = offset as usize;
                self.decode(&bytes[at..at + length], row);
            }
            Storage::File(file) => {
                let mut bytes = vec![0; length];
                self.disk.read_at(file, &mut bytes, offset).map_err(|e| {
                    LayoutError::io(&self.target, "cannot read the temporary file beside it", e)
                })?;
                self.decode(&bytes, row);
            }
        }
        Ok(())
    }

    /// Puts raw samples in the place of voids, from a column of row `y` on, counted from the south; each is rounded to the steps that all samples keep. They
    /// must lie within the range of the samples.
    pub(super) fn fill(&self, y: u32, col: u32, samples: &[f64]) -> Result<(), LayoutError> {
        let stats = self.stats();
        let step = if self.sample_type.is_integer() {
            Some(1.0)
        } else {
            CANDIDATE_STEPS.into_iter().zip(stats.steps).find(|(_, holds)| *holds).map(|(step, _)| step)
        };
        let rounded = |value: f64| {
            let value = step.map_or(value, |step| (value / step).round() * step);
            // A step's multiple is to its type what those of the file are.
            if stats.fits_f32 || self.sample_type == SampleType::F32 {
                f64::from(value as f32)
            } else {
                value
            }
        };
        let samples: Vec<f64> = samples.iter().map(|value| rounded(*value)).collect();
        let mut bytes = Vec::new();
        self.encode(&samples, &mut bytes);
        self.write(y, col, &bytes)?;
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).voids -= samples.len() as u64;
        Ok(())
    }

    /// Stores encoded samples of row `y`, counted from the south, from a column on.
    fn write(&self, y: u32, col: u32, bytes: &[u8]) -> Result<(), LayoutError> {
        self.has_heights[y as usize].store(true, Ordering::Relaxed);
        let count = bytes.len() as u64 / self.sample_bytes();
        self.land.mark(col..col + count as u32, y);
        let offset = (u64::from(y) * u64::from(self.wide) + u64::from(col)) * self.sample_bytes();
        match &self.storage {
            Storage::Memory(all) => {
                let mut all = all.write().unwrap_or_else(PoisonError::into_inner);
                all[offset as usize..offset as usize + bytes.len()].copy_from_slice(bytes);
                Ok(())
            }
            Storage::File(file) => self
                .disk
                .write_at(file, bytes, offset)
                .map_err(|e| failed(&self.target, "cannot write the temporary file beside it", e)),
        }
    }

    fn decode(&self, bytes: &[u8], row: &mut [f64]) {
        if self.double {
            for (value, raw) in row.iter_mut().zip(bytes.as_chunks().0) {
                *value = f64::from_bits(u64::from_le_bytes(*raw) ^ VOID_F64);
            }
        } else {
            for (value, raw) in row.iter_mut().zip(bytes.as_chunks().0) {
                *value = f64::from(f32::from_bits(u32::from_le_bytes(*raw) ^ VOID_F32));
            }
        }
    }

    fn encode(&self, row: &[f64], bytes: &mut Vec<u8>) {
        bytes.resize(row.len() * self.sample_bytes() as usize, 0);
        if self.double {
            for (value, raw) in row.iter().zip(bytes.as_chunks_mut().0) {
                let bits = if value.is_nan() { 0 } else { value.to_bits() ^ VOID_F64 };
                *raw = bits.to_le_bytes();
            }
        } else {
            for (value, raw) in row.iter().zip(bytes.as_chunks_mut().0) {
                let bits = if value.is_nan() { 0 } else { (*value as f32).to_bits() ^ VOID_F32 };
                *raw = bits.to_le_bytes();
            }
        }
    }
}

/// Parts of a row of samples that starts at column `col`, cut where blocks begin, that have blocks with heights only.
fn stretches(row: &[f64], col: u32) -> Vec<Range<usize>> {
    let mut stretches: Vec<Range<usize>> = Vec::new();
    let mut from = 0;
    while from < row.len() {
        let column = col as usize + from;
        let to = (from + BLOCK as usize - column % BLOCK as usize).min(row.len());
        // Without an early end the comparison takes many samples at once.
        if !row[from..to].iter().fold(true, |all, v| all & v.is_nan()) {
            match stretches.last_mut().filter(|last| last.end == from) {
                Some(last) => last.end = to,
                None => stretches.push(from..to),
            }
        }
        from = to;
    }
    stretches
}

fn failed(target: &Path, action: &'static str, e: std::io::Error) -> LayoutError {
    let when_full = "no room for the temporary file beside it, which takes 4 or 8 bytes a sample; make some on its disk, name an output on \
                     another, or allow more memory, which may hold the samples instead";
    let is_full = is_full(&e);
    let error = LayoutError::write(target, action, when_full, e);
    if is_full { error.mended_by(Remedy::Memory { enough_mib: None }) } else { error }
}

impl Spool<'_> {
    /// Whether the window lies in the elevation model.
    fn check(&self, window: Window) -> Result<(), LayoutError> {
        let is_inside = window.col.checked_add(window.width).is_some_and(|end| end <= self.wide)
            && window.row.checked_add(window.height).is_some_and(|end| end <= self.high);
        if is_inside {
            return Ok(());
        }
        Err(LayoutError::Usage(format!(
            "a window of {} x {} samples at column {}, row {} does not lie in the elevation model",
            window.width, window.height, window.col, window.row
        )))
    }

    fn count_voids(&self, voids: u64) {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).voids += voids;
        (self.advance)(voids);
    }
}

impl SampleSink for Spool<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.check(window)?;
        if samples.len() != window.width as usize * window.height as usize {
            return Err(LayoutError::Usage(format!(
                "a window of {} x {} samples came with {}",
                window.width,
                window.height,
                samples.len()
            )));
        }
        if samples.iter().all(|v| v.is_nan()) {
            self.count_voids(samples.len() as u64);
            return Ok(());
        }
        let cleaned;
        let nodata = self.nodata.unwrap_or(f64::NAN);
        let means_void = |v: f64| v.is_infinite() | (v == nodata);
        // Without an early end the comparison takes many samples at once.
        let samples = if samples.iter().fold(false, |any, v| any | means_void(*v)) {
            cleaned = samples.iter().map(|v| if means_void(*v) { f64::NAN } else { *v }).collect::<Vec<_>>();
            &cleaned
        } else {
            samples
        };
        let stats = SampleStats::of(samples, self.sample_type);
        let mut bytes = Vec::new();
        for (i, row) in samples.chunks_exact(window.width.max(1) as usize).enumerate() {
            let y = self.high - 1 - (window.row + i as u32);
            for stretch in stretches(row, window.col) {
                self.encode(&row[stretch.clone()], &mut bytes);
                self.write(y, window.col + stretch.start as u32, &bytes)?;
            }
        }
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).merge(&stats);
        (self.advance)(samples.len() as u64);
        Ok(())
    }

    /// Nothing is written: a void's bytes are zero.
    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.check(window)?;
        self.count_voids(u64::from(window.width) * u64::from(window.height));
        Ok(())
    }
}
