//! Everything that GDAL opens, through the system's library: with the feature `gdal` only, because it needs GDAL 3.5 or later, a C++ library, where the program is built and where it runs.
//!
//! Files of formats that this package reads itself are not handed to it. Everything else that it opens is read block by block, even names that are no files (`/vsicurl/...`, `NETCDF:"a.nc":z`). Each
//! worker has a data set of its own, and GDAL's cache is held to [`CACHE_MIB`]. Where GDAL says that a sample is masked it is void.

use crate::options::OpenOptions;
use crate::parallel::each_task;
use crate::reader::{Declared, Reader, Said, VerticalUnit};
use crate::value::{self, Decode};
use crate::{WINDOW_SAMPLES, guard};
use gdal::raster::{ColorInterpretation, GdalDataType, RasterBand};
use gdal::{Dataset, Metadata};
use std::path::{Path, PathBuf};
use std::sync::Once;
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// GDAL's cache of blocks.
const CACHE_MIB: u64 = 64;
/// Largest block that is a window by itself, in samples.
const LARGEST_WINDOW: u64 = 1 << 20;
/// Blocks larger than this are refused, in samples: GDAL holds them as a whole.
const LARGEST_BLOCK: u64 = 1 << 28;

/// Whether a name is GDAL's own and no file's: a virtual path, or a data set in a file.
pub(crate) fn is_name(path: &Path) -> bool {
    let name = path.to_string_lossy();
    name.starts_with("/vsi") || (name.contains(':') && !path.exists())
}

/// A data set that GDAL opens.
#[derive(Debug)]
pub(crate) struct GdalDem {
    path: PathBuf,
    declared: Declared,
    pick: Pick,
    block: [u32; 2],
}

/// What is read of each pixel; bands are counted from 1.
#[derive(Debug, Clone)]
struct Pick {
    bands: Vec<usize>,
    decode: Option<Decode>,
    is_masked: bool,
}

impl GdalDem {
    /// Opens the data set.
    pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let dataset = dataset(path)?;
        let count = dataset.raster_count();
        if count == 0 {
            return Err(LayoutError::unsupported(path, inner_sets(&dataset)));
        }
        let pick = pick(path, &dataset, options)?;
        let band = self::band(path, &dataset, pick.bands[0])?;
        let (wide, high) = band.size();
        let side = |side: usize| u32::try_from(side).ok().filter(|side| (2..=i32::MAX as u32).contains(side));
        let (Some(wide), Some(high)) = (side(wide), side(high)) else {
            let problem = format!("{wide} x {high} samples are no terrain; at least 2 x 2 are needed");
            return Err(LayoutError::unsupported(path, problem));
        };
        let block = band.block_size();
        // GDAL answers for whatever a driver says.
        let block = [block.0, block.1].map(|side| u32::try_from(side).unwrap_or(u32::MAX).max(1));
        if u64::from(block[0].min(wide)) * u64::from(block[1].min(high)) > LARGEST_BLOCK {
            return Err(LayoutError::unsupported(
                path,
                "its blocks are larger than memory should be; write it again in tiles: gdal_translate -co TILED=YES -co COMPRESS=DEFLATE \
                 -co BIGTIFF=IF_SAFER INPUT output.tif",
            ));
        }
        let sample_type = match pick.decode {
            Some(_) => Decode::SAMPLE_TYPE,
            None => sample_type(path, band.band_type())?,
        };
        let format = format!("{} by GDAL", harmless(&dataset.driver().long_name(), 60));
        let mut declared = Declared::new([wide, high], sample_type, format);
        declare(&dataset, &band, &mut declared, pick.decode.is_some());
        if count > 1 && pick.decode.is_none() {
            let name = band.description().unwrap_or_default();
            let name = if name.is_empty() { String::new() } else { format!(" \"{}\"", harmless(&name, 40)) };
            declared.notes.push(format!("heights are band {}{name}", pick.bands[0]));
        }
        Ok(Self { path: path.to_owned(), declared, pick, block: [block[0].min(wide), block[1].min(high)] })
    }

    /// The windows that are read: whole blocks, as many side by side as make a window, or some rows of large ones.
    fn window(&self) -> [u32; 2] {
        let [columns, rows] = self.declared.samples;
        let [wide, high] = self.block;
        let samples = u64::from(wide) * u64::from(high);
        let fit = |width: u32| u32::try_from(WINDOW_SAMPLES / u64::from(width)).unwrap_or(u32::MAX).max(1);
        if samples > LARGEST_WINDOW {
            return [wide, fit(wide).min(high)];
        }
        if wide == columns {
            // Blocks of single rows are put together.
            let blocks = (WINDOW_SAMPLES / samples.max(1)).max(1);
            return [wide, u32::try_from(u64::from(high) * blocks).unwrap_or(u32::MAX).min(rows)];
        }
        let across = u64::from(wide) * (WINDOW_SAMPLES / samples.max(1)).max(1);
        [u32::try_from(across).unwrap_or(u32::MAX).min(columns), high]
    }
}

impl Reader for GdalDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        let [wide, high] = self.block.map(u64::from);
        // A block larger than the cache is held nevertheless.
        (CACHE_MIB << 20) + 8 * wide * high * self.pick.bands.len() as u64
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let [columns, rows] = self.declared.samples;
        let [wide, high] = self.window();
        let across = u64::from(columns.div_ceil(wide));
        let tasks = across * u64::from(rows.div_ceil(high));
        // Rows of a large block come from the cache, which many workers would empty for each other.
        let workers =
            if u64::from(self.block[0]) * u64::from(self.block[1]) > LARGEST_WINDOW { 1 } else { usize::MAX };
        each_task(
            tasks,
            workers,
            || dataset(&self.path),
            |dataset, task| {
                // Both lie in the grid, whose sides are 31-bit.
                let (col, row) = ((task % across) as u32 * wide, (task / across) as u32 * high);
                let window =
                    Window { col, row, width: wide.min(columns - col), height: high.min(rows - row) };
                sink.put(window, &self.read(dataset, window)?)
            },
        )
    }
}

impl GdalDem {
    fn read(&self, dataset: &Dataset, window: Window) -> Result<Vec<f64>, LayoutError> {
        let size = (window.width as usize, window.height as usize);
        let at = (window.col as isize, window.row as isize);
        let place = || format!("rows from {}", window.row);
        let failed = |error: gdal::errors::GdalError| {
            LayoutError::damaged(&self.path, place(), format!("{}; fetch the file again", said(&error)))
        };
        guard(&self.path, place, || {
            let mut bands = Vec::with_capacity(self.pick.bands.len());
            for number in &self.pick.bands {
                let band = dataset.rasterband(*number).map_err(failed)?;
                bands.push(band.read_as::<f64>(at, size, size, None).map_err(failed)?.into_shape_and_vec().1);
            }
            let mut samples = match (&self.pick.decode, &bands[..]) {
                (Some(decode), [red, green, blue]) => {
                    let colours = red.iter().zip(green).zip(blue);
                    colours.map(|((red, green), blue)| decode.height([*red, *green, *blue])).collect()
                }
                _ => bands.swap_remove(0),
            };
            if self.pick.is_masked {
                let band = dataset.rasterband(self.pick.bands[0]).map_err(failed)?;
                let mask = band
                    .open_mask_band()
                    .and_then(|mask| mask.read_as::<u8>(at, size, size, None))
                    .map_err(failed)?;
                let hidden = samples.iter_mut().zip(mask.data()).filter(|(_, seen)| **seen == 0);
                hidden.for_each(|(sample, _)| *sample = f64::NAN);
            }
            Ok(samples)
        })
    }
}

/// Opens a data set, quietly and with a small cache.
fn dataset(path: &Path) -> Result<Dataset, LayoutError> {
    static PREPARED: Once = Once::new();
    PREPARED.call_once(|| {
        // What GDAL has to say comes with the error; on the terminal it would be said twice.
        gdal::config::set_error_handler(|_, _, _| ());
        // Fails for names with a NUL alone.
        let _ = gdal::config::set_config_option("GDAL_CACHEMAX", &CACHE_MIB.to_string());
    });
    let open = || {
        Dataset::open(path).map_err(|error| {
            LayoutError::not_this_format(path, format!("GDAL does not open it either: {}", said(&error)))
        })
    };
    guard(path, || "header".into(), open)
}

/// GDAL's own words, shortened.
fn said(error: &gdal::errors::GdalError) -> String {
    match error {
        gdal::errors::GdalError::CplError { msg, .. } if !msg.is_empty() => {
            format!("GDAL says \"{}\"", harmless(msg, 200))
        }
        _ => "GDAL cannot read it".to_owned(),
    }
}

fn band<'d>(path: &Path, dataset: &'d Dataset, number: usize) -> Result<RasterBand<'d>, LayoutError> {
    dataset
        .rasterband(number)
        .map_err(|error| LayoutError::damaged(path, format!("band {number}"), said(&error)))
}

/// The data sets in a file that is none itself.
fn inner_sets(dataset: &Dataset) -> String {
    let list = dataset.metadata_domain("SUBDATASETS").unwrap_or_default();
    let names = list.iter().filter_map(|item| item.split_once("_NAME=").map(|(_, name)| harmless(name, 120)));
    let names: Vec<String> = names.take(12).collect();
    if names.is_empty() {
        return "it holds no grid of numbers; name the file that does".to_owned();
    }
    format!("it holds several data sets; name the one with the heights: {}", names.join(", "))
}

/// Which bands are read.
fn pick(path: &Path, dataset: &Dataset, options: &OpenOptions) -> Result<Pick, LayoutError> {
    let count = dataset.raster_count();
    let bands = (1..=count).map(|number| band(path, dataset, number)).collect::<Result<Vec<_>, _>>()?;
    let is_masked = |number: usize| {
        let flags = bands[number - 1].mask_flags();
        flags.is_ok_and(|flags| {
            !flags.is_all_valid() && !flags.is_nodata() && (flags.is_per_dataset() || flags.is_alpha())
        })
    };
    if let Some(text) = &options.decode {
        if count < 3 {
            return Err(LayoutError::Usage(format!(
                "{}: heights are unpacked from three bands, and this data set has {count}; read it as it is",
                path.display()
            )));
        }
        return Ok(Pick {
            bands: vec![1, 2, 3],
            decode: Some(value::decode(text)?),
            is_masked: is_masked(1),
        });
    }
    let names: Vec<String> = bands.iter().map(|band| band.description().unwrap_or_default()).collect();
    let number = if let Some(word) = &options.band {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        value::band(path, word, count, &names)? + 1
    } else {
        let is_alpha = |band: &RasterBand<'_>| band.color_interpretation() == ColorInterpretation::AlphaBand;
        let choices: Vec<usize> = (1..=count).filter(|number| !is_alpha(&bands[number - 1])).collect();
        let [number] = choices[..] else {
            let known: Vec<String> = (1..)
                .zip(&names)
                .filter(|(_, name)| !name.is_empty())
                .take(12)
                .map(|(n, name)| format!("{n} \"{}\"", harmless(name, 40)))
                .collect();
            let known = if known.is_empty() { String::new() } else { format!(" ({})", known.join(", ")) };
            let problem = format!(
                "this is a data set of {} bands{known}; say which one holds the heights",
                choices.len()
            );
            return Err(LayoutError::unsupported(path, problem).mended_by(Remedy::Band));
        };
        number
    };
    Ok(Pick { bands: vec![number], decode: None, is_masked: is_masked(number) })
}

fn sample_type(path: &Path, kind: GdalDataType) -> Result<SampleType, LayoutError> {
    Ok(match (kind.is_integer(), kind.is_signed(), kind.bits()) {
        (true, false, 8) => SampleType::U8,
        (true, true, 8) => SampleType::I8,
        (true, false, 16) => SampleType::U16,
        (true, true, 16) => SampleType::I16,
        (true, false, 32) => SampleType::U32,
        (true, true, 32) => SampleType::I32,
        (true, false, 64) => SampleType::U64,
        (true, true, 64) => SampleType::I64,
        (false, _, 16 | 32) => SampleType::F32,
        (false, _, 64) => SampleType::F64,
        _ => {
            let problem = "its samples are of a type that is no height; convert them: gdal_translate -ot Float32 INPUT output.tif";
            return Err(LayoutError::unsupported(path, problem));
        }
    })
}

/// What GDAL says of place, system and values.
fn declare(dataset: &Dataset, band: &RasterBand<'_>, declared: &mut Declared, is_decoded: bool) {
    let said = "GDAL";
    if let Ok([x, a, b, y, d, e]) = dataset.geo_transform() {
        let map = [x + 0.5 * (a + b), a, b, y + 0.5 * (d + e), d, e];
        let is_sound = map.iter().all(|value| value.is_finite()) && a * e != b * d;
        declared.place = is_sound.then(|| Said::new(map, said));
    }
    let system = dataset.spatial_ref().and_then(|system| system.to_wkt());
    declared.crs.text = system.ok().filter(|text| !text.is_empty()).map(|text| Said::new(text, said));
    if is_decoded {
        return;
    }
    let value = &mut declared.value;
    value.scale = band.scale().filter(|scale| *scale != 1.0).map(|scale| Said::new(scale, said));
    value.offset = band.offset().filter(|offset| *offset != 0.0).map(|offset| Said::new(offset, said));
    let unit = band.unit();
    value.unit = (!unit.is_empty()).then(|| Said::new(VerticalUnit::Name(unit), said));
    let nodata = match declared.sample_type {
        SampleType::I64 => band.no_data_value_i64().map(|number| number.to_string()),
        SampleType::U64 => band.no_data_value_u64().map(|number| number.to_string()),
        _ => band.no_data_value().map(|number| number.to_string()),
    };
    value.nodata.extend(nodata.map(|text| Said::new(text, said)));
}
