//! OpenEXR pictures as heights: one channel of reals of 16 or 32 bits or of whole numbers of 32, in rows or tiles, packed in any way but DWAA and DWAB.
//!
//! What is read is the data window, from its north-west corner on; nothing says where it lies. Not-a-number is void. Of several channels a person names one; of smaller copies the
//! full one is read. A block at a time is in memory, by one thread; blocks of more than 64 MiB are refused. Invariant: every sample is pushed once, whatever the file says of its blocks.

use crate::options::OpenOptions;
use crate::reader::{Declared, Reader};
use crate::{guard, input, value};
use exr::block::UncompressedBlock;
use exr::block::reader::{ChunksReader, Reader as Blocks};
use exr::meta::BlockDescription;
use exr::meta::attribute::SampleType as Stored;
use exr::meta::header::Header;
use half::f16;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// A file begins so.
pub(crate) const MAGIC: &[u8] = b"v/1\x01";
/// Largest block.
const MAX_BLOCK_BYTES: usize = 64 << 20;
/// Channels that are listed in a message.
const LISTED: usize = 12;
/// Flag of a file that has lists of samples a pixel.
const DEEP: u32 = 0x800;

/// A channel of an OpenEXR picture.
#[derive(Debug)]
pub(crate) struct ExrDem {
    path: PathBuf,
    declared: Declared,
    /// Which part, and which channel of it.
    part: usize,
    channel: usize,
    memory_bytes: u64,
}

impl ExrDem {
    /// Reads the headers, and chooses a channel.
    pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let mut file = input::open(path, "cannot open the OpenEXR file")?;
        let failed = |source| LayoutError::io(path, "cannot read the OpenEXR file", source);
        let length = file.metadata().map_err(failed)?.len();
        let mut head = [0; 8];
        file.read_exact(&mut head).map_err(|error| refused(path, "header", error.into()))?;
        if u32::from_le_bytes([head[4], head[5], head[6], head[7]]) & DEEP != 0 {
            return Err(unsupported(
                path,
                "it has deep data, lists of samples a pixel, of which none is the height",
            ));
        }
        guard(path, || "header".into(), || Self::of(path, length, options))
    }

    fn of(path: &Path, length: u64, options: &OpenOptions) -> Result<Self, LayoutError> {
        let blocks = blocks(path)?;
        let headers = blocks.headers();
        let (part, channel) = choose(path, headers, options)?;
        let header = &headers[part];
        let (wide, high) = (header.layer_size.width(), header.layer_size.height());
        let [wide, high] = match [wide, high].map(|side| i32::try_from(side).ok().filter(|side| *side >= 2)) {
            [Some(wide), Some(high)] => [wide as u32, high as u32],
            _ => {
                return Err(unsupported(
                    path,
                    &format!("{wide} x {high} samples are no terrain; at least 2 x 2 are needed"),
                ));
            }
        };
        if header.channels.list.iter().any(|channel| channel.sampling.0 != 1 || channel.sampling.1 != 1) {
            return Err(unsupported(path, "a channel of it has fewer samples than the picture"));
        }
        use exr::compression::Compression;
        let is_kept = matches!(
            header.compression,
            Compression::Uncompressed
                | Compression::RLE
                | Compression::ZIP1
                | Compression::ZIP16
                | Compression::PIZ
                | Compression::PXR24
                | Compression::B44
                | Compression::B44A
        );
        // DWAA and DWAB are for pictures, and the crate unpacks them to any length.
        if !is_kept {
            return Err(unsupported(path, "it is packed for pictures (DWAA, DWAB) or in an unknown way"));
        }
        // A block of any part may be read before it is known to be one.
        let block = headers.iter().map(Header::max_block_byte_size).max().unwrap_or(0);
        if block > MAX_BLOCK_BYTES {
            return Err(unsupported(
                path,
                &format!("a block of it unpacks to {} MiB, more than the 64 MiB allowed", block >> 20),
            ));
        }
        let (sample_type, kind) = match header.channels.list[channel].sample_type {
            Stored::F16 => (SampleType::F16, "half"),
            Stored::F32 => (SampleType::F32, "float"),
            Stored::U32 => (SampleType::U32, "uint"),
        };
        let mut declared = Declared::new([wide, high], sample_type, format!("OpenEXR of {kind}"));
        declared.band_number = u32::try_from(channel + 1).unwrap_or(1);
        let (shown, data) = (header.shared_attributes.display_window, header.data_window());
        if shown != data {
            declared.notes.push(format!(
                "its data window of {wide} x {high} samples is read, from {}, {} on; its display window is of {} x {}",
                data.position.0, data.position.1, shown.size.0, shown.size.1
            ));
        }
        // Packed, unpacked and on the way between both; and the table of all blocks.
        let memory_bytes = 4 * block as u64 + length.min(16 * header.chunk_count as u64) + (1 << 20);
        Ok(Self { path: path.to_owned(), declared, part, channel, memory_bytes })
    }

    fn push(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let blocks = blocks(&self.path)?;
        let part = self.part;
        let mut chunks = blocks
            .filter_chunks(false, |_, _, block| {
                block.layer == part && block.level.0 == 0 && block.level.1 == 0
            })
            .map_err(|error| refused(&self.path, "table of blocks", error))?;
        let header = chunks.meta_data().headers.get(part).cloned();
        let header = header.ok_or_else(|| changed(&self.path))?;
        if [header.layer_size.width(), header.layer_size.height()]
            != self.declared.samples.map(|side| side as usize)
        {
            return Err(changed(&self.path));
        }
        let step = match header.blocks {
            BlockDescription::Tiles(tiles) => [tiles.tile_size.width(), tiles.tile_size.height()],
            BlockDescription::ScanLines => {
                [header.layer_size.width(), header.compression.scan_lines_per_block()]
            }
        };
        let across = header.layer_size.width().div_ceil(step[0].max(1));
        let down = header.layer_size.height().div_ceil(step[1].max(1));
        let mut seen = vec![false; across * down];
        let mut samples = Vec::new();
        let failed = |error| refused(&self.path, "samples", error);
        while let Some(chunk) = chunks.read_next_chunk() {
            let chunk = chunk.map_err(failed)?;
            // Blocks of other parts may be packed in ways that are not unpacked here.
            if chunk.layer_index != part {
                return Err(self.damaged("a block of it lies elsewhere than it should"));
            }
            let block =
                UncompressedBlock::decompress_chunk(chunk, chunks.meta_data(), false).map_err(failed)?;
            let window = self
                .window(&block, part, step)
                .ok_or_else(|| self.damaged("a block of it lies elsewhere than it should"))?;
            let number = window.row as usize / step[1] * across + window.col as usize / step[0];
            if std::mem::replace(&mut seen[number], true) {
                return Err(self.damaged("a block of it is there twice"));
            }
            self.samples(&block, &header, &mut samples)?;
            sink.put(window, &samples)?;
        }
        if seen.contains(&false) {
            return Err(self.damaged("a block of it is missing"));
        }
        Ok(())
    }

    /// Where a block of this part lies, if it is one of those that fill the picture.
    fn window(&self, block: &UncompressedBlock, part: usize, step: [usize; 2]) -> Option<Window> {
        let index = &block.index;
        let at = [index.pixel_position.0, index.pixel_position.1];
        let size = [index.pixel_size.0, index.pixel_size.1];
        let whole = self.declared.samples.map(|side| side as usize);
        let is_whole = (0..2).all(|i| {
            at[i].is_multiple_of(step[i]) && at[i] < whole[i] && size[i] == step[i].min(whole[i] - at[i])
        });
        let is_full = index.layer == part && index.level.0 == 0 && index.level.1 == 0;
        (is_whole && is_full).then_some(Window {
            col: at[0] as u32,
            row: at[1] as u32,
            width: size[0] as u32,
            height: size[1] as u32,
        })
    }

    /// The samples of the channel in a block.
    fn samples(
        &self,
        block: &UncompressedBlock,
        header: &Header,
        samples: &mut Vec<f64>,
    ) -> Result<(), LayoutError> {
        samples.clear();
        let wide = block.index.pixel_size.0;
        let count = wide * block.index.pixel_size.1;
        let bytes: usize =
            header.channels.list.iter().map(|channel| channel.sample_type.bytes_per_sample()).sum();
        if block.data.len() != count * bytes {
            return Err(self.damaged("a block of it is of another length than it should be"));
        }
        for line in block.lines(&header.channels).filter(|line| line.location.channel == self.channel) {
            match self.declared.sample_type {
                SampleType::F16 => {
                    samples.extend(
                        line.value.as_chunks::<2>().0.iter().map(|b| f64::from(f16::from_ne_bytes(*b))),
                    );
                }
                SampleType::U32 => {
                    samples.extend(
                        line.value.as_chunks::<4>().0.iter().map(|b| f64::from(u32::from_ne_bytes(*b))),
                    );
                }
                _ => samples
                    .extend(line.value.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_ne_bytes(*b)))),
            }
        }
        match samples.len() == count {
            true => Ok(()),
            false => Err(self.damaged("a block of it is of another length than it should be")),
        }
    }

    fn damaged(&self, problem: &str) -> LayoutError {
        LayoutError::damaged(&self.path, "samples", format!("{problem}; fetch or write the file again"))
    }
}

impl Reader for ExrDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        self.memory_bytes
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        guard(&self.path, || "samples".into(), || self.push(sink))
    }
}

/// Reads the headers.
fn blocks(path: &Path) -> Result<Blocks<BufReader<File>>, LayoutError> {
    let file = BufReader::with_capacity(1 << 16, input::open(path, "cannot open the OpenEXR file")?);
    exr::block::read(file, false).map_err(|error| refused(path, "header", error))
}

/// The channel that is asked for, or the only one that is no alpha.
fn choose(path: &Path, headers: &[Header], options: &OpenOptions) -> Result<(usize, usize), LayoutError> {
    let (mut places, mut names) = (Vec::new(), Vec::new());
    for (part, header) in headers.iter().enumerate() {
        let layer = header.own_attributes.layer_name.as_ref().filter(|_| headers.len() > 1);
        for (channel, described) in header.channels.list.iter().enumerate() {
            places.push((part, channel));
            names.push(match layer {
                Some(layer) => format!("{layer}.{}", described.name),
                None => described.name.to_string(),
            });
        }
    }
    if let Some(word) = &options.band {
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        return value::band(path, word, places.len(), &known).map(|band| places[band]);
    }
    let is_alpha = |name: &str| name.rsplit('.').next().is_some_and(|last| last.eq_ignore_ascii_case("a"));
    let mut choices = (0..places.len()).filter(|at| !is_alpha(&names[*at]));
    match (choices.next(), choices.next()) {
        (Some(only), None) => Ok(places[only]),
        _ => {
            let listed = names.iter().take(LISTED).map(|name| format!("\"{}\"", harmless(name, 40)));
            let problem = format!(
                "it has {} channels ({}{}); say which one holds the heights",
                names.len(),
                listed.collect::<Vec<_>>().join(", "),
                if names.len() > LISTED { ", ..." } else { "" }
            );
            Err(LayoutError::unsupported(path, problem).mended_by(Remedy::Band))
        }
    }
}

fn changed(path: &Path) -> LayoutError {
    LayoutError::damaged(path, "header", "the file changed while it was read; start again")
}

fn unsupported(path: &Path, problem: &str) -> LayoutError {
    LayoutError::unsupported(
        path,
        format!("{problem}; write its heights as one channel of floats in rows, for example with oiiotool"),
    )
}

fn refused(path: &Path, place: &str, error: exr::error::Error) -> LayoutError {
    use exr::error::Error;
    match error {
        Error::Io(source) => LayoutError::io(path, "cannot read the OpenEXR file", source),
        Error::NotSupported(_) => unsupported(path, "it is packed in a way that is not read"),
        Error::Invalid(_) | Error::Aborted => {
            LayoutError::damaged(path, place, "it is damaged or cut short; fetch or write the file again")
        }
    }
}
