//! What it costs to read elevation data of every format.
//!
//! Question: how many megabytes of a file, and how many samples, does each reader take a second, and how much memory at the most? Data: one ground of SIDE x SIDE samples, written here in
//! every format that this program can write by itself. Command:
//!
//!     cargo bench -p terrasoar-import --bench readers -- [SIDE [FORMAT...]]
//!
//! Times are of opening and streaming into a sink that adds up, with the files in the page cache. Peak memory is the process's own, so name one format to learn that one's; it
//! holds what writing the file took, which is a row. Prints Markdown. Keep runs under benches/runs/.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::LayoutError;
use terrasoar_layout::dem::{SampleSink, Window};

type Failure = Box<dyn std::error::Error>;
type Writes = fn(&Path, u32) -> Result<PathBuf, Failure>;

/// A height in metres, whole.
fn height(col: u32, row: u32) -> u16 {
    let (x, y) = (f64::from(col) * 0.01, f64::from(row) * 0.013);
    (1500.0 + 700.0 * x.sin() + 500.0 * (y + 0.3 * x).cos()) as u16
}

/// Adds up what arrives.
#[derive(Default)]
struct Sum(Mutex<(u64, f64)>);

impl SampleSink for Sum {
    fn put(&self, _: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let sum: f64 = samples.iter().sum();
        let mut all = self.0.lock().map_err(|_| LayoutError::Usage("a thread died".into()))?;
        *all = (all.0 + samples.len() as u64, all.1 + sum);
        Ok(())
    }
}

fn written(
    path: PathBuf,
    side: u32,
    head: &str,
    row: impl Fn(u32, &mut Vec<u8>),
) -> Result<PathBuf, Failure> {
    let mut file = BufWriter::new(File::create(&path)?);
    file.write_all(head.as_bytes())?;
    let mut bytes = Vec::new();
    for number in 0..side {
        bytes.clear();
        row(number, &mut bytes);
        file.write_all(&bytes)?;
    }
    file.flush()?;
    Ok(path)
}

fn asc(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    let head = format!(
        "ncols {side}\nnrows {side}\nxllcorner 500000\nyllcorner 5000000\ncellsize 10\nNODATA_value -9999\n"
    );
    written(folder.join("a.asc"), side, &head, |row, bytes| {
        (0..side).for_each(|col| write!(bytes, "{}.{} ", height(col, row), col % 10).unwrap_or_default());
        bytes.push(b'\n');
    })
}

fn point(bytes: &mut Vec<u8>, col: u32, row: u32) {
    writeln!(bytes, "{} {} {}", 500_000 + 10 * col, 5_000_000 + 10 * row, height(col, row))
        .unwrap_or_default();
}

fn xyz_rows(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    written(folder.join("rows.xyz"), side, "", |row, bytes| (0..side).for_each(|col| point(bytes, col, row)))
}

fn xyz_columns(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    written(folder.join("columns.xyz"), side, "", |col, bytes| {
        (0..side).for_each(|row| point(bytes, col, row))
    })
}

fn xyz_any(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    // Every row goes on in the next one's middle.
    written(folder.join("any.xyz"), side, "", |row, bytes| {
        (0..side).for_each(|col| point(bytes, col, if col % 2 == 0 { row } else { (row + side / 2) % side }));
    })
}

fn flt(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    std::fs::write(
        folder.join("a.hdr"),
        format!("ncols {side}\nnrows {side}\nxllcorner 0\nyllcorner 0\ncellsize 10\nbyteorder LSBFIRST\n"),
    )?;
    written(folder.join("a.flt"), side, "", |row, bytes| {
        (0..side).for_each(|col| bytes.extend(f32::from(height(col, row)).to_le_bytes()))
    })
}

fn bip(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    std::fs::write(
        folder.join("b.hdr"),
        format!(
            "ncols {side}\nnrows {side}\nnbits 16\nnbands 3\nlayout bip\nbyteorder M\npixeltype unsignedint\n"
        ),
    )?;
    written(folder.join("b.bip"), side, "", |row, bytes| {
        (0..side).for_each(|col| (0..3).for_each(|_| bytes.extend(height(col, row).to_be_bytes())))
    })
}

fn r16(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    written(folder.join("a.r16"), side, "", |row, bytes| {
        (0..side).for_each(|col| bytes.extend(height(col, row).to_le_bytes()))
    })
}

fn hgt(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    written(folder.join("N10E010.hgt"), side, "", |row, bytes| {
        (0..side).for_each(|col| bytes.extend(height(col, row).to_be_bytes()))
    })
}

fn hgt_gz(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    let plain = std::fs::read(hgt(folder, side)?)?;
    let path = folder.join("N10E010.hgt.gz");
    let mut packer =
        flate2::write::GzEncoder::new(BufWriter::new(File::create(&path)?), flate2::Compression::fast());
    packer.write_all(&plain)?;
    packer.finish()?.flush()?;
    Ok(path)
}

fn pgm(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    written(folder.join("a.pgm"), side, &format!("P5\n{side} {side}\n65535\n"), |row, bytes| {
        (0..side).for_each(|col| bytes.extend(height(col, row).to_be_bytes()))
    })
}

fn pgm_text(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    written(folder.join("text.pgm"), side, &format!("P2\n{side} {side}\n65535\n"), |row, bytes| {
        (0..side).for_each(|col| writeln!(bytes, "{}", height(col, row)).unwrap_or_default());
    })
}

fn png_of(
    path: PathBuf,
    side: u32,
    color: png::ColorType,
    depth: png::BitDepth,
    pixel: fn(u16, &mut Vec<u8>),
) -> Result<PathBuf, Failure> {
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(&path)?), side, side);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    let mut stream = writer.stream_writer()?;
    let mut bytes = Vec::new();
    for row in 0..side {
        bytes.clear();
        (0..side).for_each(|col| pixel(height(col, row), &mut bytes));
        stream.write_all(&bytes)?;
    }
    stream.finish()?;
    Ok(path)
}

fn png_grey(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    png_of(
        folder.join("grey.png"),
        side,
        png::ColorType::Grayscale,
        png::BitDepth::Sixteen,
        |height, bytes| bytes.extend(height.to_be_bytes()),
    )
}

fn png_mapbox(folder: &Path, side: u32) -> Result<PathBuf, Failure> {
    png_of(folder.join("mapbox.png"), side, png::ColorType::Rgb, png::BitDepth::Eight, |height, bytes| {
        bytes.extend(&(100_000 + 10 * u32::from(height)).to_be_bytes()[1..]);
    })
}

const FORMATS: [(&str, Writes); 13] = [
    ("asc", asc),
    ("xyz-rows", xyz_rows),
    ("xyz-columns", xyz_columns),
    ("xyz-any", xyz_any),
    ("flt", flt),
    ("bip", bip),
    ("r16", r16),
    ("hgt", hgt),
    ("hgt-gz", hgt_gz),
    ("pgm", pgm),
    ("pgm-text", pgm_text),
    ("png-grey", png_grey),
    ("png-mapbox", png_mapbox),
];

/// Seconds of processor time that this process took, and its largest memory in MiB, where the system tells.
fn taken() -> (f64, f64) {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks: f64 = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|word| word.parse::<f64>().ok())
        .sum();
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<f64>().ok());
    (ticks / 100.0, peak.unwrap_or(0.0) / 1024.0)
}

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1).filter(|word| !word.starts_with("--"));
    let side: u32 = words.next().map_or(Ok(256), |word| word.parse())?;
    let wanted: Vec<String> = words.collect();
    println!("{side} x {side} samples; {} threads\n", rayon::current_num_threads());
    println!(
        "| format | file, MB | s | processor s | MB/s | million samples/s | peak memory so far, MiB |\n|---|---|---|---|---|---|---|"
    );
    for (name, write) in
        FORMATS.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|word| word == name))
    {
        let folder = tempfile::tempdir()?;
        let path = write(folder.path(), side)?;
        let bytes = path.metadata()?.len() as f64;
        let sum = Sum::default();
        let (before, start) = (taken().0, Instant::now());
        open_with(&[path], &OpenOptions::default())?.stream(&sum)?;
        let seconds = start.elapsed().as_secs_f64();
        let (after, peak) = taken();
        let (samples, _) = sum.0.into_inner()?;
        assert_eq!(samples, u64::from(side) * u64::from(side), "{name}");
        println!(
            "| {name} | {:.1} | {seconds:.2} | {:.2} | {:.0} | {:.1} | {peak:.0} |",
            bytes / 1e6,
            after - before,
            bytes / 1e6 / seconds,
            samples as f64 / 1e6 / seconds
        );
    }
    Ok(())
}
