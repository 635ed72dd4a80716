//! Images in, an imagery section out: the whole way.
//!
//! One image, or several of one texel size on one grid of texels, become one picture ([`super::mosaic`]); its rows go through the pyramid
//! ([`super::pyramid`]) while the next are read, and tiles are appended as they are made ([`super::append`]). Equal input gives
//! equal bytes, whatever the number of threads. Cost: each image is read once, each tile written once, nothing is spooled.

use super::append::Append;
use super::encode::check_format;
use super::mosaic::Mosaic;
use super::place::{Extent, PlaceOrigin};
use super::pyramid::{Pyramid, memory_bytes};
use super::rows::{Arrival, STEP_ROWS};
use super::shape::{ImageryShape, TileFormat};
use super::source::ImageSource;
use crate::error::LayoutError;
use crate::file::disk::{Disk, SystemDisk};
use crate::file::header::Header;
use crate::file::journal::Lineage;
use crate::file::lock::WriteLock;
use crate::file::slots::Slots;
use crate::file::source::{PreadSource, Source};
use crate::file::tail::{Attempted, Tail};
use crate::progress::Progress;
use crate::read::terrain::Terrain;
use crate::remedy::Remedy;
use std::path::Path;

/// How to drape.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct DrapeOptions {
    /// How texels are stored; default BC1.
    pub format: TileFormat,
    /// Where the image lies, instead of what it says. Of one image only.
    pub extent: Option<Extent>,
    /// Memory to use at most, in MiB; default 512.
    pub memory_mib: u64,
}

impl Default for DrapeOptions {
    fn default() -> Self {
        Self { format: TileFormat::Bc1, extent: None, memory_mib: 512 }
    }
}

impl DrapeOptions {
    /// These options with texels stored in another way.
    pub fn format(self, format: TileFormat) -> Self {
        Self { format, ..self }
    }

    /// These options with a place of the image, instead of what it says.
    pub fn extent(self, extent: impl Into<Option<Extent>>) -> Self {
        Self { extent: extent.into(), ..self }
    }

    /// These options with another most of memory in MiB.
    pub fn memory_mib(self, memory_mib: u64) -> Self {
        Self { memory_mib, ..self }
    }
}

/// What was draped.
#[derive(Debug, Clone, PartialEq)]
pub struct Draped {
    /// The file's header now.
    pub header: Header,
    /// The imagery's shape.
    pub shape: ImageryShape,
    /// Tiles stored.
    pub stored_tiles: u64,
    /// Where the place of the images came from.
    pub place: PlaceOrigin,
}

/// Drapes `images` over the terrain file at `path`, those later in the list above those before. The file reads as before until the end, when the new imagery counts at
/// once. Runs on the current rayon pool.
///
/// # Errors
/// [`LayoutError::Usage`] for images that do not fit each other, the terrain or the memory, or while another program writes to the file; those of
/// opening a terrain, of reading an image, of writing. The file reads as before then.
pub fn drape(
    path: &Path,
    images: &[Box<dyn ImageSource>],
    options: &DrapeOptions,
    progress: &dyn Progress,
) -> Result<Draped, LayoutError> {
    drape_on(&SystemDisk, path, images, options, progress)
}

/// As [`drape`], with all writing done by `disk`.
///
/// # Errors
/// As [`drape`].
pub fn drape_on(
    disk: &dyn Disk,
    path: &Path,
    images: &[Box<dyn ImageSource>],
    options: &DrapeOptions,
    progress: &dyn Progress,
) -> Result<Draped, LayoutError> {
    let lock = WriteLock::take(path)?;
    let file = lock.file();
    let again =
        file.try_clone().map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
    // One file, opened once: what is read is what is written to.
    let terrain = Terrain::from_source(Box::new(PreadSource::over(path, again)?))?;
    append_all(disk, &lock, terrain.source(), images, options, progress)
}

fn append_all(
    disk: &dyn Disk,
    lock: &WriteLock,
    source: &dyn Source,
    images: &[Box<dyn ImageSource>],
    options: &DrapeOptions,
    progress: &dyn Progress,
) -> Result<Draped, LayoutError> {
    let images: Vec<&dyn ImageSource> = images.iter().map(|image| &**image).collect();
    check_format(options.format)?;
    let path = source.path();
    let slots = Slots::read(source, 0)?;
    let mosaic = Mosaic::new(&images, &slots.header, options.extent)?;
    let shape = mosaic.shape(options.format);
    let needed = memory_bytes(&shape, &mosaic.areas()).saturating_add(mosaic.memory_bytes());
    if needed.div_ceil(1 << 20) > options.memory_mib {
        let needed_mib = needed.div_ceil(1 << 20);
        return Err(LayoutError::Usage(format!(
            "{} x {} texels of {} take {} MiB of memory and {} are allowed: allow more, or give a tiled GeoTIFF: \
             gdal_translate -co TILED=YES -co BIGTIFF=IF_SAFER INPUT output.tif",
            shape.texels[0],
            shape.texels[1],
            mosaic.format(),
            needed_mib,
            options.memory_mib
        ))
        .mended_by(Remedy::Memory { enough_mib: Some(needed_mib) }));
    }
    let old = slots.header.clone();
    let lineage = old.history.map(|_| Lineage::read(source, &old)).transpose()?;
    let tail = Tail::of(path, lock, 0, &slots, Attempted::default())?;
    let mut append = Append::begin(disk, tail, old, lineage, shape)?;
    progress.stage("draping", u64::from(shape.texels[0]) * u64::from(shape.texels[1]));
    let length = source.byte_count();
    if let Err(error) = append_tiles(&mut append, &mosaic, &shape, images[0].path(), progress) {
        append.give_up(length);
        return Err(error);
    }
    let stored_tiles = append.stored_tiles();
    progress.stage("writing to disk", 0);
    let header = append.commit(&mosaic.format(), length)?;
    Ok(Draped { header, shape, stored_tiles, place: mosaic.place() })
}

/// Rows of the images through the pyramid, and its tiles behind the file's end.
fn append_tiles(
    append: &mut Append<'_>,
    mosaic: &Mosaic<'_>,
    shape: &ImageryShape,
    first: &Path,
    progress: &dyn Progress,
) -> Result<(), LayoutError> {
    let mut pyramid = Pyramid::new(*shape);
    let mut rows = mosaic.rows()?;
    let (mut arriving, mut arrived) = (Arrival::default(), Arrival::default());
    let mut left = shape.texels[1];
    // One turn more than there are steps: each reads one and works on the one before.
    loop {
        let step = left.min(STEP_ROWS);
        left -= step;
        let read = || rows.read(step, &mut arriving);
        let work = || pyramid.push(&arrived, &mut |tile| append.put(&tile));
        let (read, worked) = rayon::join(read, work);
        read.and(worked)?;
        progress.advance(u64::from(arrived.rows) * u64::from(shape.texels[0]));
        std::mem::swap(&mut arriving, &mut arrived);
        if step == 0 {
            break;
        }
    }
    if append.stored_tiles() == 0 {
        return Err(LayoutError::Usage(format!("{}: the image is transparent throughout", first.display())));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Imagery, MemoryImage};
    use super::*;
    use crate::build::{BuildOptions, build};
    use crate::dem::{MemoryDem, SampleType};
    use crate::file::disk::{FailingDisk, Failure};
    use crate::file::mark::MARK_BYTES;
    use crate::file::source::MemorySource;
    use crate::progress::Silent;

    fn terrain_bytes() -> Vec<u8> {
        let dem = MemoryDem::from_fn([40, 30], SampleType::I16, |x, y| f64::from(x * 3 + y));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.iqt");
        build(&dem, &path, &BuildOptions { spacing_m: Some([10.0; 2]), ..Default::default() }, &Silent)
            .unwrap();
        std::fs::read(path).unwrap()
    }

    fn image(seed: u32) -> Box<dyn ImageSource> {
        Box::new(MemoryImage::from_fn([1200, 520], move |x, y| {
            let hole = (700..1200).contains(&x) && y < 100;
            [x as u8, y as u8, (x / 16 + y / 16 + seed) as u8, if hole { 0 } else { 255 }]
        }))
    }

    /// Everything a reader sees of a file: heights and tiles.
    fn seen(bytes: Vec<u8>) -> (u32, Vec<u8>, Vec<Vec<u8>>) {
        let terrain = Terrain::from_source(Box::new(MemorySource::new("a.iqt", bytes))).unwrap();
        let records = (0..terrain.header().record_pages())
            .flat_map(|page| terrain.checked_page(page).unwrap().to_vec())
            .collect();
        let mut tiles = Vec::new();
        if let Some(imagery) = Imagery::open(&terrain).unwrap() {
            for id in imagery.shape().ids() {
                let mut tile = Vec::new();
                imagery.read_tile(&terrain, id, &mut tile).unwrap();
                tiles.push(tile);
            }
        }
        (terrain.header().generation, records, tiles)
    }

    const NEVER: (u64, Failure) = (u64::MAX, Failure::Once);

    /// The file after an append that ends as told, whether it went well, and how many calls it made.
    fn append(
        before: &[u8],
        images: &[Box<dyn ImageSource>],
        (at, failure): (u64, Failure),
    ) -> (Vec<u8>, bool, u64) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.iqt");
        std::fs::write(&path, before).unwrap();
        let disk = FailingDisk::new(at, failure);
        let done = drape_on(&disk, &path, images, &DrapeOptions::default(), &Silent).is_ok();
        (std::fs::read(path).unwrap(), done, disk.calls())
    }

    /// Twice in a row, so that both header slots take their turn, and over the leavings of the append that was stopped.
    #[test]
    fn stopped_at_any_write_the_file_reads_as_before_or_after() {
        let mut before = terrain_bytes();
        for seed in [1, 2] {
            let picture = [image(seed)];
            let (after, done, calls) = append(&before, &picture, NEVER);
            assert!(done && calls > 8);
            let [wanted_before, wanted_after] = [before.clone(), after.clone()].map(seen);
            assert_ne!(wanted_before, wanted_after);
            for at in 0..calls {
                for quarters in 0..=4 {
                    // Only the header's own write decides; its sync, and the mark with its own, may fail after it.
                    let is_decided = at + 3 >= calls || at + 4 == calls && quarters == 4;
                    let wanted = if is_decided { &wanted_after } else { &wanted_before };
                    for failure in [Failure::Killed { quarters }, Failure::Full { quarters }] {
                        let (stopped, done, _) = append(&before, &picture, (at, failure));
                        assert!(!done);
                        assert!(seen(stopped.clone()) == *wanted, "{failure:?} at {at} of {calls}");
                        if matches!(failure, Failure::Full { .. }) && at + 4 < calls {
                            // What counts; the mark of the append before may be written over.
                            let counted = before.len() - if seed == 1 { 0 } else { MARK_BYTES };
                            assert!(
                                stopped.len() == before.len() && stopped[..counted] == before[..counted],
                                "{failure:?} at {at} of {calls}: the space is not given back"
                            );
                        }
                        if quarters == 2 && !is_decided {
                            let (again, done, _) = append(&stopped, &picture, NEVER);
                            assert!(done && seen(again) == wanted_after);
                        }
                    }
                }
            }
            before = after;
        }
    }
}
