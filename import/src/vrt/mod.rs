//! GDAL's virtual rasters (`.vrt`): a grid whose samples are pieces of other files, as gdalbuildvrt and gdal_translate write them.
//!
//! Files are laid one over the other into one store, in the order of the text, and streamed from there. Each is read whole into a store of its own first, so that one that fails leaves nothing: it is named, and
//! what lies below it shows. **What no file covers is void**, where GDAL gives a number. Files are opened when samples are asked for, one at a time. Memory: a share of what is allowed. Cost: two passes over
//! the samples of the files.

mod change;
mod paint;
mod painted;
mod parse;
mod said;
mod text;

use crate::options::OpenOptions;
use crate::reader::{CrsSaid, Declared, Reader, Said, ValueSaid, VerticalUnit};
use painted::{Opens, Painted, Within};
use said::Vrt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use terrasoar_layout::dem::{SampleSink, Warning};
use terrasoar_layout::error::LayoutError;
use text::is_virtual;
pub(crate) use text::is_vrt;

/// Virtual rasters within virtual rasters.
const DEEPEST: usize = 8;
/// Files that are looked at for virtual rasters, where only their names are asked for.
const MOST_SOUGHT: usize = 4096;

/// A virtual raster.
pub(crate) struct VrtDem {
    band: Painted,
    mask: Option<Painted>,
}

impl VrtDem {
    /// Reads the text; its files are opened later, by `opens`.
    ///
    /// # Errors
    /// As [`crate::open`].
    pub(crate) fn open(path: &Path, options: &OpenOptions, opens: Opens) -> Result<Self, LayoutError> {
        let options = options.clone();
        let within = Within {
            opens,
            opens_virtual: |path, within| Ok(Box::new(Self::within(path, within)?)),
            options,
            chain: Vec::new(),
            opened: Arc::new(AtomicU32::new(0)),
        };
        Self::within(path, within)
    }

    fn within(path: &Path, mut within: Within) -> Result<Self, LayoutError> {
        let options = &within.options;
        if options.decode.is_some() {
            return Err(LayoutError::Usage(format!(
                "{}: heights packed into colours are unpacked from the files themselves; name these instead of the virtual raster",
                path.display()
            )));
        }
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if within.chain.contains(&whole) {
            return Err(LayoutError::damaged(
                path,
                "SourceFilename",
                "the virtual raster is made of itself; write it again with gdalbuildvrt",
            ));
        }
        if within.chain.len() >= DEEPEST {
            return Err(LayoutError::unsupported(
                path,
                format!("more than {DEEPEST} virtual rasters lie in each other; name the innermost ones"),
            ));
        }
        within.chain.push(whole);
        let text = text::read(path, options)?;
        let vrt = parse::vrt(path, &text::tree(path, &text)?, options)?;
        let declared = declared(&vrt);
        let mask = vrt.mask.map(|band| {
            let declared = Declared::new(vrt.samples, band.sample_type, "mask of a virtual raster");
            Painted::new(path, declared, band, &within)
        });
        Ok(Self { band: Painted::new(path, declared, vrt.band, &within), mask })
    }
}

/// The files that the virtual raster at `path` is made of, and those that virtual rasters among them are made of; none of what cannot be read.
pub(crate) fn files_of(path: &Path) -> Vec<PathBuf> {
    let (mut found, mut seen) = (Vec::new(), std::collections::HashSet::new());
    let mut next = vec![path.to_owned()];
    let mut looked = 0;
    while let Some(path) = next.pop() {
        looked += 1;
        let options = OpenOptions::default();
        let is_virtual = looked <= MOST_SOUGHT && is_virtual(&path);
        let vrt = is_virtual.then(|| {
            let text = text::read(&path, &options)?;
            parse::vrt(&path, &text::tree(&path, &text)?, &options)
        });
        let Some(Ok(vrt)) = vrt else { continue };
        let bands = std::iter::once(vrt.band).chain(vrt.mask);
        for source in bands.flat_map(|band| band.sources) {
            if seen.insert(source.file.clone()) {
                next.push(source.file.clone());
                found.push(source.file);
            }
        }
    }
    found
}

/// What a virtual raster says, as every file does.
fn declared(vrt: &Vrt) -> Declared {
    let band = &vrt.band;
    let mut files: Vec<&Path> = band.sources.iter().map(|source| source.file.as_path()).collect();
    files.sort_unstable();
    files.dedup();
    let format = match files.len() {
        1 => "virtual raster of a file".to_owned(),
        count => format!("virtual raster of {count} files"),
    };
    let mut declared = Declared::new(vrt.samples, band.sample_type, format.clone());
    declared.band_number = band.number;
    declared.corrects.nothing = true;
    if let Some([x, a, b, y, d, e]) = vrt.corners {
        let centres = [x + 0.5 * (a + b), a, b, y + 0.5 * (d + e), d, e];
        declared.place = Some(Said::new(centres, "GeoTransform"));
    }
    declared.crs =
        CrsSaid { text: vrt.system.clone().map(|text| Said::new(text, "SRS")), ..CrsSaid::default() };
    declared.value = ValueSaid {
        scale: band.scale.map(|scale| Said::new(scale, "Scale")),
        offset: band.offset.map(|offset| Said::new(offset, "Offset")),
        unit: band.unit.clone().map(|unit| Said::new(VerticalUnit::Name(unit), "UnitType")),
        direction: None,
        nodata: band.nodata.clone().map(|text| Said::new(text, "NoDataValue")).into_iter().collect(),
        valid: None,
    };
    declared.notes.push(format);
    if vrt.by_points {
        declared.warnings.push(Warning::new(
            "the virtual raster is placed by ground control points alone, which are not read; bring it onto a grid first: gdalwarp IN.vrt heights.tif",
        ));
    }
    declared
}

impl Reader for VrtDem {
    fn declared(&self) -> &Declared {
        self.band.declared()
    }

    fn mask(&self) -> Option<&dyn Reader> {
        self.mask.as_ref().map(|mask| mask as &dyn Reader)
    }

    fn warnings(&self) -> Vec<Warning> {
        let mut warnings = self.band.warnings();
        for warning in self.mask.iter().flat_map(|mask| mask.warnings()) {
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        warnings
    }

    fn memory_bytes(&self) -> u64 {
        // The mask is read before the band.
        self.band.memory_bytes()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.band.stream(sink)
    }
}
