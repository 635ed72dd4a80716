//! GRIB of edition 2 (WMO FM 92): fields of numbers on grids, as models of weather and climate write them; heights among them.
//!
//! [`fields`] finds the fields, [`products`] tells which are heights, [`grid`] where they lie, [`packing`] unpacks numbers. One field is read: the only one, the only ground, or the one that is asked for. Numbers are kept as they are packed, with their scale
//! beside. Cost: one pass over the field on one thread.
//!
//! The reading of sections and of plain numbers is our own: crate grib 0.20 takes memory as a file states it, without a limit, and makes single precision of everything.

mod bits;
mod ccsds;
mod complex;
mod fields;
mod grid;
mod packing;
mod products;
mod section;

use crate::guard::guard;
use crate::input;
use crate::options::OpenOptions;
use crate::reader::{Declared, Reader, Said, VerticalUnit};
use crate::text::Sequence;
use crate::value::STANDARD_GRAVITY;
use bits::Bits;
use fields::Field;
use grid::Grid;
use packing::Packing;
use products::Meaning;
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, Warning};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// Fields that a message lists.
const LISTED: usize = 12;

/// Why a file is not read.
#[derive(Debug)]
enum Fault {
    Io(std::io::Error),
    Damaged(&'static str),
    Unsupported(String),
    /// A grid of uneven steps on a map that GDAL knows.
    Warped(String),
    /// Another grid of uneven steps.
    Uneven(String),
    /// Waves on the sphere in place of samples.
    Spectral,
    FirstEdition,
}

impl From<std::io::Error> for Fault {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => Self::Damaged("it is cut short"),
            _ => Self::Io(error),
        }
    }
}

impl Fault {
    fn told(self, path: &Path, place: &str) -> LayoutError {
        match self {
            Self::Io(source) => LayoutError::io(path, "cannot read the GRIB file", source),
            Self::Damaged(problem) => {
                LayoutError::damaged(path, place, format!("{problem}; fetch the file again"))
            }
            Self::Unsupported(what) => LayoutError::unsupported(
                path,
                format!(
                    "{place}: {what}, which is not read; convert it with: gdal_translate -b N INPUT output.tif"
                ),
            ),
            Self::Warped(what) => LayoutError::unsupported(
                path,
                format!(
                    "{place}: {what}, and even steps are read; convert it with: gdal_translate -b N -of VRT INPUT band.vrt && gdalwarp -t_srs EPSG:4326 band.vrt output.tif"
                ),
            ),
            Self::Uneven(what) => LayoutError::unsupported(
                path,
                format!(
                    "{place}: {what}, and even steps are read; convert it with: cdo remapbil,global_0.25 -setgridtype,regular INPUT output.grib2"
                ),
            ),
            Self::Spectral => LayoutError::unsupported(
                path,
                format!(
                    "{place}: it holds waves on the sphere (spherical harmonics) and no samples; convert it with: cdo remapbil,global_0.25 -sp2gp INPUT output.grib2"
                ),
            ),
            Self::FirstEdition => LayoutError::unsupported(
                path,
                "this is GRIB of edition 1, and edition 2 is read; convert it with: gdal_translate -b N INPUT output.tif",
            ),
        }
    }
}

/// Whether a file begins so; one that is called so may have a line of a bulletin ahead.
pub(crate) fn is_grib(head: &[u8], is_called: bool) -> bool {
    head.starts_with(b"GRIB") || is_called && head.windows(4).take(128).any(|four| four == b"GRIB")
}

/// A field of a GRIB file.
#[derive(Debug)]
pub(crate) struct GribDem {
    path: PathBuf,
    declared: Declared,
    field: Field,
    /// Its number, counted from 1.
    number: usize,
    packing: Packing,
    is_ploughed: bool,
}

impl GribDem {
    /// Reads the headers of all fields, and chooses one.
    pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let file = input::open(path, "cannot open the GRIB file")?;
        let length = file.metadata().map_err(|error| Fault::Io(error).told(path, "header"))?.len();
        let fields = fields::fields(&file, length).map_err(|fault| fault.told(path, "messages"))?;
        let at = choose(path, &fields, options.band.as_deref())?;
        let field = &fields[at];
        let place = format!("field {}", at + 1);
        let told = |fault: Fault| fault.told(path, &place);
        let grid = guard(
            path,
            || place.clone(),
            || {
                let section = fields::section(&file, field.grid).map_err(told)?;
                Grid::of(&section).map_err(told)
            },
        )?;
        let section = fields::section(&file, field.packing).map_err(told)?;
        let mut packing = Packing::of(section).map_err(told)?;
        let points = u64::from(grid.samples[0]) * u64::from(grid.samples[1]);
        if packing.points > points || field.bitmap.is_none() && packing.points != points {
            return Err(told(Fault::Damaged("it has not as many numbers as its grid has points")));
        }
        if let Some([from, to]) = field.bitmap
            && to - from < points.div_ceil(8)
        {
            return Err(told(Fault::Damaged("its bitmap is too short for its grid")));
        }
        packing.look(&file, field.numbers).map_err(told)?;
        let [from, to] = field.numbers;
        let (takes, allowed) = (packing.memory_bytes(to - from), options.memory_mib.unwrap_or(512) << 20);
        if takes > allowed {
            let enough = takes.div_ceil(1 << 20);
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "{place}: unpacking {} takes {enough} MiB, more than is allowed; allow more memory",
                    packing.name()
                ),
            )
            .mended_by(Remedy::Memory { enough_mib: Some(enough) }));
        }
        let format = format!("GRIB 2 ({})", packing.name());
        let mut declared = Declared::new(grid.samples, packing.sample_type(), format);
        // Band numbers beside a file are those of GDAL.
        declared.band_number = u32::try_from(at + 1).unwrap_or(1);
        declared.place = Some(Said::new(grid.map, "the grid's definition"));
        declared.crs.text = Some(Said::new(grid.system, "the grid's definition"));
        let value = &mut declared.value;
        value.scale = Some(Said::new(packing.scale(), "the packing")).filter(|scale| scale.value != 1.0);
        value.offset =
            Some(Said::new(packing.reference(), "the packing")).filter(|offset| offset.value != 0.0);
        match field.product.meaning {
            Meaning::Height => value.unit = Some(Said::new(VerticalUnit::Metres(1.0), "the product")),
            Meaning::Geopotential => {
                value.unit = Some(Said::new(VerticalUnit::Metres(1.0 / STANDARD_GRAVITY), "the product"));
                declared.notes.push(format!(
                    "the field is a geopotential in m2/s2; divided by {STANDARD_GRAVITY} m/s2 it is a height"
                ));
            }
            Meaning::Other => declared.warnings.push(Warning::new(format!(
                "the field is {}, which is not known to be heights; its numbers are taken for heights",
                field.product.words
            ))),
        }
        if fields.len() > 1 {
            declared.notes.push(format!(
                "heights are field {} of {}: {}",
                at + 1,
                fields.len(),
                field.product.words
            ));
        }
        declared.warnings.extend(grid.warning.map(Warning::new));
        Ok(Self {
            path: path.to_owned(),
            declared,
            field: field.clone(),
            number: at + 1,
            packing,
            is_ploughed: grid.is_ploughed,
        })
    }
}

impl Reader for GribDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        let [from, to] = self.field.numbers;
        self.packing.memory_bytes(to - from)
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let file = input::open(&self.path, "cannot open the GRIB file")?;
        let place = || format!("field {}", self.number);
        let told = |fault: Fault| fault.told(&self.path, &place());
        let [wide, high] = self.declared.samples;
        let mut bitmap = self.field.bitmap.map(|[from, to]| Bits::new(&file, from, to));
        let mut numbers =
            guard(&self.path, place, || self.packing.begin(&file, self.field.numbers).map_err(told))?;
        let mut left = self.packing.points;
        let mut sequence = Sequence::new(sink, [wide, high]);
        let mut line = vec![f64::NAN; wide as usize];
        for row in 0..high {
            guard(&self.path, place, || {
                for sample in &mut line {
                    let is_there = match &mut bitmap {
                        Some(bitmap) => bitmap.number(1).map_err(told)? == 1,
                        None => true,
                    };
                    *sample = f64::NAN;
                    if is_there {
                        left = left.checked_sub(1).ok_or_else(|| {
                            told(Fault::Damaged("its bitmap has room for more numbers than it holds"))
                        })?;
                        *sample = numbers.next().map_err(told)?;
                    }
                }
                Ok(())
            })?;
            if self.is_ploughed && row % 2 == 1 {
                line.reverse();
            }
            sequence.put(&line)?;
        }
        Ok(())
    }
}

/// The number of the field that `asked` means, or of the only one that there can be.
fn choose(path: &Path, fields: &[Field], asked: Option<&str>) -> Result<usize, LayoutError> {
    if fields.is_empty() {
        return Err(Fault::Damaged("there is no field in it").told(path, "messages"));
    }
    let Some(word) = asked.map(str::trim) else {
        let ground: Vec<usize> = (0..fields.len()).filter(|at| fields[*at].product.is_ground).collect();
        return match (fields.len(), &ground[..]) {
            (1, _) => Ok(0),
            (_, [ground]) => Ok(*ground),
            _ => Err(LayoutError::unsupported(
                path,
                format!(
                    "it holds several fields, {}; say which one holds the heights",
                    listed(fields, |_| true)
                ),
            )
            .mended_by(Remedy::Band)),
        };
    };
    let wrong = |problem: String| {
        Err(LayoutError::Usage(format!("{}: {problem}", path.display())).mended_by(Remedy::Band))
    };
    if let Ok(number) = word.parse::<usize>() {
        return match number.checked_sub(1).filter(|at| *at < fields.len()) {
            Some(at) => Ok(at),
            None => wrong(format!("there is no field {number} in it; there are {}", fields.len())),
        };
    }
    let is_called = |field: &Field| field.product.is_called(word);
    let called: Vec<usize> = (0..fields.len()).filter(|at| is_called(&fields[*at])).collect();
    let ground: Vec<usize> = called.iter().copied().filter(|at| fields[*at].product.is_ground).collect();
    match (&called[..], &ground[..]) {
        ([one], _) | (_, [one]) => Ok(*one),
        ([], _) => wrong(format!(
            "there is no field \"{}\" in it; there are {}",
            harmless(word, 40),
            listed(fields, |_| true)
        )),
        _ => wrong(format!(
            "several fields are called \"{}\", {}; name one by its number",
            harmless(word, 40),
            listed(fields, is_called)
        )),
    }
}

/// Some fields with their numbers.
fn listed(fields: &[Field], is_meant: impl Fn(&Field) -> bool) -> String {
    let all = fields.iter().enumerate().filter(|(_, field)| is_meant(field));
    let mut names: Vec<String> =
        all.take(LISTED + 1).map(|(at, field)| format!("{}: {}", at + 1, field.product.words)).collect();
    let has_more = names.len() > LISTED;
    names.truncate(LISTED);
    format!("{}{}", names.join("; "), if has_more { "; and more" } else { "" })
}
