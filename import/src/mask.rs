//! Masks: samples that another image, inside the file or beside it, calls void.
//!
//! The mask is read first, a bit for each sample: in memory where the budget allows it, else in a nameless temporary file. Then samples are read, and those whose bit is 0
//! become NaN. Squares without any bit are known, so that what lies in them is passed over. Cost: one pass over the mask, a copy of each window with such samples.

use crate::cells::Cells;
use crate::kept::Kept;
use crate::options::OpenOptions;
use crate::reader::Reader;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Share of the memory allowed that a mask may take.
const SHARE: u64 = 8;

/// Where a file that masks the one at `path` would stand.
pub(crate) fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".msk");
    PathBuf::from(name)
}

/// A mask that is to be applied.
pub(crate) struct Masking {
    /// A file of its own; without it the reader's own mask.
    file: Option<Box<dyn Reader>>,
    path: PathBuf,
    samples: [u32; 2],
    in_memory: bool,
    scratch: PathBuf,
}

/// A mask that was read: a bit a sample, rows padded to whole bytes.
pub(crate) struct Bits {
    kept: Kept,
    writing: Mutex<()>,
    /// Where bits are set.
    shown: Cells,
}

impl Bits {
    /// Whether no bit of a window is set, as far as is known without reading them.
    fn hides(&self, window: Window) -> bool {
        !self.shown.touch([window.col.into(), window.row.into()], [window.width, window.height])
    }
}

impl Masking {
    /// The mask of a data set of `samples` (columns, rows): of its own or of the file that `beside` read.
    pub(crate) fn new(
        path: &Path,
        samples: [u32; 2],
        file: Option<Box<dyn Reader>>,
        options: &OpenOptions,
    ) -> Self {
        let allowed = (options.memory_mib.unwrap_or(512) << 20) / SHARE;
        Self {
            file,
            path: path.to_owned(),
            samples,
            in_memory: Self::bytes_of(samples) <= allowed,
            scratch: options.scratch.clone().unwrap_or_else(std::env::temp_dir),
        }
    }

    fn bytes_of([columns, rows]: [u32; 2]) -> u64 {
        u64::from(columns.div_ceil(8)) * u64::from(rows)
    }

    /// Memory that it takes.
    pub(crate) fn memory_bytes(&self) -> u64 {
        if self.in_memory { Self::bytes_of(self.samples) } else { 0 }
    }

    /// Reads the mask: that of its file, or else `own`. `None` where there is none.
    pub(crate) fn keep(&self, own: Option<&dyn Reader>) -> Result<Option<Bits>, LayoutError> {
        let Some(mask) = self.file.as_deref().or(own) else { return Ok(None) };
        let action = "cannot keep the mask in a temporary file in";
        let kept = Kept::new(Self::bytes_of(self.samples), self.in_memory, &self.scratch, action)?;
        let mut bits = Bits { kept, writing: Mutex::new(()), shown: Cells::default() };
        let shown = Mutex::new(Cells::default());
        mask.stream(&Keeping { masking: self, bits: &bits, shown: &shown })?;
        bits.shown = shown.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Some(bits))
    }

    /// Calls `hide` with every texel of a row that the mask calls void.
    pub(crate) fn hide_row(
        &self,
        bits: &Bits,
        row: u32,
        mut hide: impl FnMut(usize),
    ) -> Result<(), LayoutError> {
        let window = Window { col: 0, row, width: self.samples[0], height: 1 };
        self.rows(bits, window, false, |_, bytes, bit| {
            for at in 0..self.samples[0] as usize {
                if bytes[(bit + at) / 8] >> ((bit + at) % 8) & 1 == 0 {
                    hide(at);
                }
            }
        })
    }

    /// Streams `reader` into `sink` with what is masked as NaN.
    pub(crate) fn stream(&self, reader: &dyn Reader, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let Some(bits) = self.keep(reader.mask())? else { return reader.stream(sink) };
        reader.stream(&Masked { masking: self, bits: &bits, sink })
    }

    /// Calls `each` with every row of a window: its bytes, and the bit at which the window begins.
    fn rows(
        &self,
        bits: &Bits,
        window: Window,
        write: bool,
        mut each: impl FnMut(usize, &mut [u8], usize),
    ) -> Result<(), LayoutError> {
        let pitch = u64::from(self.samples[0].div_ceil(8));
        let inside = window.col.checked_add(window.width).is_some_and(|end| end <= self.samples[0])
            && window.row.checked_add(window.height).is_some_and(|end| end <= self.samples[1]);
        if !inside {
            return Err(LayoutError::damaged(
                &self.path,
                "mask",
                "its size changed while it was read; start again",
            ));
        }
        let (first, last) = (u64::from(window.col / 8), u64::from((window.col + window.width).div_ceil(8)));
        let bit = (window.col % 8) as usize;
        let length = (last - first) as usize;
        // Windows share bytes where they meet.
        let _alone = write.then(|| bits.writing.lock().unwrap_or_else(PoisonError::into_inner));
        let (mut bytes, mut buffer) = (vec![0; length], Vec::new());
        for row in 0..window.height {
            let at = u64::from(window.row + row) * pitch + first;
            bits.kept.read(at, length, &mut buffer, |kept| bytes.copy_from_slice(kept))?;
            each(row as usize, &mut bytes, bit);
            if write {
                bits.kept.write(at, &bytes)?;
            }
        }
        Ok(())
    }
}

/// Keeps a mask as it streams.
struct Keeping<'a> {
    masking: &'a Masking,
    bits: &'a Bits,
    shown: &'a Mutex<Cells>,
}

/// Whether a number of a mask shows what lies under it.
fn shows(value: f64) -> bool {
    value != 0.0 && !value.is_nan()
}

impl SampleSink for Keeping<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let width = window.width as usize;
        let rows = samples.chunks_exact(width.max(1));
        let ends = rows.filter_map(|row| {
            Some([row.iter().position(|v| shows(*v))?, row.iter().rposition(|v| shows(*v))?])
        });
        // What was never written hides.
        let Some([first, last]) = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]) else { return Ok(()) };
        // Both are columns of the window.
        let [from, to] = [first as u32, last as u32 + 1].map(|at| window.col + at);
        let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        shown.add([from, window.row], [to, window.row + window.height]);
        drop(shown);
        self.masking.rows(self.bits, window, true, |row, bytes, bit| {
            for (at, value) in samples[row * width..(row + 1) * width].iter().enumerate() {
                if shows(*value) {
                    bytes[(bit + at) / 8] |= 1 << ((bit + at) % 8);
                }
            }
        })
    }

    fn put_void(&self, _window: Window) -> Result<(), LayoutError> {
        Ok(())
    }
}

/// Passes samples on with NaN under the mask.
struct Masked<'a> {
    masking: &'a Masking,
    bits: &'a Bits,
    sink: &'a dyn SampleSink,
}

impl SampleSink for Masked<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        if self.bits.hides(window) {
            return self.sink.put_void(window);
        }
        let width = window.width as usize;
        let mut masked = samples.to_vec();
        self.masking.rows(self.bits, window, false, |row, bytes, bit| {
            for (at, value) in masked[row * width..(row + 1) * width].iter_mut().enumerate() {
                if bytes[(bit + at) / 8] >> ((bit + at) % 8) & 1 == 0 {
                    *value = f64::NAN;
                }
            }
        })?;
        self.sink.put(window, &masked)
    }

    fn is_void(&self, window: Window) -> bool {
        self.bits.hides(window)
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.sink.put_void(window)
    }
}
