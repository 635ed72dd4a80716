//! VTP binary terrain, versions 1.0 to 1.3 (Ben Discoe, Virtual Terrain Project, 1997-2007).
//!
//! A header of 256 bytes, then the samples column by column from west to east, each column from
//! south to north, all little-endian:
//!
//! ```text
//! at  size  1.0               1.1, 1.2             1.3
//!  0   10   "binterr1.0"      "binterr1.1"         "binterr1.3"
//! 10    4   columns           columns              columns
//! 14    4   rows              rows                 rows
//! 18    2   bytes a sample    bytes a sample       bytes a sample       (4 wide in 1.0)
//! 20    2                     1 = float            1 = float
//! 22    2   1 = UTM           1 = UTM              0 degrees, 1 m, 2 feet, 3 US feet
//! 24    2   UTM zone          UTM zone, < 0 south  UTM zone, < 0 south
//! 26    2   (extents as f32)  datum                datum
//! 28   32   (float flag: 42)  left, right, bottom, top as f64
//! 60    2                     1 = see .prj (1.2)   1 = see .prj
//! 62    4                                          metres a unit, 0 = 1
//! ```
//!
//! The extents are those of the samples' *areas*: the spacing is extent / samples, the first sample
//! half a spacing inside, as GDAL reads and writes BT (VTP's own programs divide by samples - 1; a
//! file of 1025 columns then differs by 0.1 %). A void is -32768 in every sample type. Where the
//! header points to the `.prj` file beside it and that is there, it is the reference system, else the header's zone
//! and datum. The grid is read in blocks of 64
//! columns and transposed; blocks in parallel, half a mebibyte of samples a worker.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::WINDOW_SAMPLES;
use super::input;
use super::parallel::each_task;
use crate::reader::{CrsSaid, Declared, HorizontalSize, Reader, Said};
use crate::value::US_SURVEY_FOOT_M;
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;

const HEADER_BYTES: u64 = 256;
const VOID: f64 = -32768.0;
/// Columns of a block.
const BLOCK_COLUMNS: u32 = 64;
/// Rows of a block.
const BLOCK_ROWS: u32 = (WINDOW_SAMPLES / BLOCK_COLUMNS as u64) as u32;

/// A BT file.
#[derive(Debug)]
pub(super) struct BtDem {
    path: PathBuf,
    declared: Declared,
}

impl BtDem {
    /// Reads and checks the header.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
        let cannot_read = |source| LayoutError::io(path, "cannot read the BT file", source);
        let mut file = input::open(path, "cannot read the BT file")?;
        let file_bytes = file.metadata().map_err(cannot_read)?.len();
        let mut header = [0; HEADER_BYTES as usize];
        if file_bytes < HEADER_BYTES {
            return Err(LayoutError::damaged(
                path,
                "header",
                format!("{file_bytes} bytes are less than a BT header's 256; fetch the file again"),
            ));
        }
        file.read_exact(&mut header).map_err(cannot_read)?;
        let header = Header(&header);
        let mut declared = parse(path, &header, file_bytes)?;
        // The flag says that the system stands in a .prj file, which the header only sums up.
        let is_told_beside = declared.format != "VTP BT 1.0" && header.i16(60) == 1;
        if is_told_beside && ["prj", "PRJ"].iter().any(|ending| path.with_extension(ending).is_file()) {
            declared.crs.code = None;
        }
        Ok(Self { path: path.to_owned(), declared })
    }

    fn sample_bytes(&self) -> u64 {
        if self.declared.sample_type == SampleType::I16 { 2 } else { 4 }
    }
}

impl Reader for BtDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let [wide, high] = self.declared.samples;
        let blocks_down = u64::from(high.div_ceil(BLOCK_ROWS));
        let blocks = u64::from(wide.div_ceil(BLOCK_COLUMNS)) * blocks_down;
        let open = || Ok((input::open(&self.path, "cannot open the BT file")?, Vec::new(), Vec::new()));
        each_task(blocks, usize::MAX, open, |(file, bytes, samples), block| {
            // Both products stay below the grid's sides, which are 31-bit.
            let col = (block / blocks_down) as u32 * BLOCK_COLUMNS;
            let row = (block % blocks_down) as u32 * BLOCK_ROWS;
            let window =
                Window { col, row, width: BLOCK_COLUMNS.min(wide - col), height: BLOCK_ROWS.min(high - row) };
            self.read_block(file, window, bytes, samples)?;
            sink.put(window, samples)
        })
    }
}

impl BtDem {
    /// Reads `window` into `samples`, rows from north to south, through the scratch buffer `bytes`.
    fn read_block(
        &self,
        file: &mut File,
        window: Window,
        bytes: &mut Vec<u8>,
        samples: &mut Vec<f64>,
    ) -> Result<(), LayoutError> {
        let size = self.sample_bytes();
        let (width, height) = (window.width as usize, window.height as usize);
        bytes.resize(height * size as usize, 0);
        samples.resize(width * height, 0.0);
        // In the file a column starts in the south: the window's first sample is its last row.
        let from_south = self.declared.samples[1] - window.row - window.height;
        for across in 0..width {
            let column = u64::from(window.col) + across as u64;
            let at =
                HEADER_BYTES + (column * u64::from(self.declared.samples[1]) + u64::from(from_south)) * size;
            let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(bytes));
            read.map_err(|source| match source.kind() {
                std::io::ErrorKind::UnexpectedEof => LayoutError::damaged(
                    &self.path,
                    format!("column {column}"),
                    "the file was cut short while it was read; start again",
                ),
                _ => LayoutError::io(&self.path, "cannot read the BT file", source),
            })?;
            let put =
                |(up, value): (usize, f64)| samples[(height - 1 - up) * width + across] = void_or(value);
            match self.declared.sample_type {
                SampleType::I16 => each_i16(bytes).enumerate().for_each(put),
                SampleType::F32 => {
                    each_word(bytes).map(|word| f64::from(f32::from_le_bytes(word))).enumerate().for_each(put)
                }
                _ => {
                    each_word(bytes).map(|word| f64::from(i32::from_le_bytes(word))).enumerate().for_each(put)
                }
            }
        }
        Ok(())
    }
}

fn each_i16(bytes: &[u8]) -> impl Iterator<Item = f64> {
    bytes.chunks_exact(2).map(|pair| f64::from(i16::from_le_bytes([pair[0], pair[1]])))
}

fn each_word(bytes: &[u8]) -> impl Iterator<Item = [u8; 4]> {
    bytes.chunks_exact(4).map(|word| [word[0], word[1], word[2], word[3]])
}

/// Infinite heights mean nothing either.
fn void_or(value: f64) -> f64 {
    if value == VOID || !value.is_finite() { f64::NAN } else { value }
}

/// The header's bytes with typed access; offsets are constants below 253.
struct Header<'a>(&'a [u8; HEADER_BYTES as usize]);

impl Header<'_> {
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|i| self.0[at + i])
    }
    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.bytes(at))
    }
    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.bytes(at))
    }
    fn f32(&self, at: usize) -> f32 {
        f32::from_le_bytes(self.bytes(at))
    }
    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.bytes(at))
    }
}

fn parse(path: &Path, header: &Header<'_>, file_bytes: u64) -> Result<Declared, LayoutError> {
    let damaged = |problem: String| LayoutError::damaged(path, "header", problem);
    let version = match &header.bytes::<3>(7) {
        b"1.0" => 0,
        b"1.1" => 1,
        b"1.2" => 2,
        b"1.3" => 3,
        other => {
            let shown = String::from_utf8_lossy(other).into_owned();
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "BT version {shown:?} is unknown, 1.0 to 1.3 are read; write it again as version 1.3"
                ),
            ));
        }
    };
    let (columns, rows) = (header.i32(10), header.i32(14));
    let (Ok(samples_wide @ 2..), Ok(samples_high @ 2..)) = (u32::try_from(columns), u32::try_from(rows))
    else {
        return Err(damaged(format!(
            "{columns} columns and {rows} rows are no grid; at least 2 x 2 are needed"
        )));
    };
    let float = header.i16(if version == 0 { 42 } else { 20 }) != 0;
    let size = if version == 0 { header.i32(18) } else { i32::from(header.i16(18)) };
    let sample_type = match (size, float) {
        (2, false) => SampleType::I16,
        (4, false) => SampleType::I32,
        (4, true) => SampleType::F32,
        _ => {
            return Err(damaged(format!(
                "{size} bytes a sample, float {float}: BT knows int16, int32 and float32"
            )));
        }
    };
    // 2^31 columns of 2^31 rows of 4 bytes just fit 64 bits.
    let needed =
        u128::from(samples_wide) * u128::from(samples_high) * size as u128 + u128::from(HEADER_BYTES);
    if needed > u128::from(file_bytes) {
        return Err(LayoutError::damaged(
            path,
            "samples",
            format!(
                "{samples_wide} x {samples_high} samples need {needed} bytes and the file has {file_bytes}: it is cut \
                 short; fetch it again"
            ),
        ));
    }
    let scale = if version == 3 { header.f32(62) } else { 0.0 };
    if !scale.is_finite() || scale < 0.0 {
        return Err(damaged(format!("a vertical scale of {scale} makes no height; it is metres a unit")));
    }
    let format = format!("VTP BT 1.{version}");
    let mut declared = Declared::new([samples_wide, samples_high], sample_type, format);
    if scale != 0.0 {
        declared.value.scale = Some(Said::new(f64::from(scale), "the header's vertical scale"));
    }
    declared.place = place(header, version, [samples_wide, samples_high]);
    declared.crs = system(header, version);
    Ok(declared)
}

fn place(header: &Header<'_>, version: u8, [wide, high]: [u32; 2]) -> Option<Said<[f64; 6]>> {
    let [left, right, bottom, top] = match version {
        0 => [26, 30, 34, 38].map(|at| f64::from(header.f32(at))),
        _ => [28, 36, 44, 52].map(|at| header.f64(at)),
    };
    let across = (right - left) / f64::from(wide);
    let down = (top - bottom) / f64::from(high);
    let known = [left, top, across, down].iter().all(|value| value.is_finite()) && across > 0.0 && down > 0.0;
    known.then(|| {
        Said::new([left + 0.5 * across, across, 0.0, top - 0.5 * down, 0.0, -down], "the header's extents")
    })
}

fn system(header: &Header<'_>, version: u8) -> CrsSaid {
    let unit = match (version, header.i16(22)) {
        (_, 0) => Some(HorizontalSize::Radians(1f64.to_radians())),
        (_, 1) => Some(HorizontalSize::Metres(1.0)),
        (3, 2) => Some(HorizontalSize::Metres(0.3048)),
        (3, 3) => Some(HorizontalSize::Metres(US_SURVEY_FOOT_M)),
        _ => None,
    };
    let (epsg, name) = reference_system(unit, header.i16(24), (version > 0).then(|| header.i16(26)));
    CrsSaid {
        code: epsg.map(|code| Said::new(code, "the header's zone and datum")),
        name,
        unit: unit.map(|unit| Said::new(unit, "the header's unit")),
        // Programs that write the system beside the file leave metres here whatever it counts.
        unit_yields: true,
        ..CrsSaid::default()
    }
}

/// EPSG code and name of what the header's zone and datum say, where one exists.
fn reference_system(unit: Option<HorizontalSize>, zone: i16, datum: Option<i16>) -> (Option<u32>, String) {
    // EPSG's datum codes, and the older USGS numbers of the first versions.
    let (name, geographic, north, south, zones) = match datum {
        Some(6326 | 23) => ("WGS 84", 4326, 32600, Some(32700), 1..=60),
        Some(6269 | 14) => ("NAD83", 4269, 26900, None, 1..=23),
        Some(6267 | 13) => ("NAD27", 4267, 26700, None, 1..=22),
        Some(6258) => ("ETRS89", 4258, 25800, None, 28..=38),
        _ => return (None, String::new()),
    };
    if matches!(unit, Some(HorizontalSize::Radians(_))) {
        return (Some(geographic), name.into());
    }
    let number = zone.unsigned_abs();
    if unit != Some(HorizontalSize::Metres(1.0)) || !(1..=60).contains(&number) {
        return (None, String::new());
    }
    let base = if zone > 0 { Some(north) } else { south };
    let epsg = base.filter(|_| zones.contains(&number)).map(|base| base + u32::from(number));
    (epsg, format!("{name} / UTM zone {number}{}", if zone > 0 { 'N' } else { 'S' }))
}
