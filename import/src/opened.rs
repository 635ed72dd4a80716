//! From what a file says to a DEM that can be built: the one layer between every reader and the build.
//!
//! Here a file's statements become a reference system, metres, a direction and voids, once for all formats. Samples pass through: voids become NaN, then rows and columns are turned north-up.
//! Cost: a copy of each window where there are voids to look for or rows to turn.

use crate::beside::Beside;
use crate::crs::{self, Kind, System};
use crate::heights::{Heights, heights};
use crate::mask::Masking;
use crate::options::OpenOptions;
use crate::placement::{Lie, Spacing, Turn, Turning, spacing, turned_by};
use crate::reader::{Declared, Reader};
use crate::value::{Suspicion, Voids};
use crate::warp::Warp;
use std::path::Path;
use terrasoar_layout::dem::{About, DemInfo, DemSource, SampleSink, UnitOf, Warning, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// Longest text of a system that is kept.
const MAX_CRS_CHARS: usize = 16_000;

/// A data set as the build wants it.
pub(crate) struct OpenedDem {
    reader: Box<dyn Reader>,
    info: DemInfo,
    voids: Voids,
    mask: Option<Masking>,
    turn: Turn,
    warp: Option<Warp>,
    suspicion: Suspicion,
    /// Warnings of what was declared.
    warnings: Vec<Warning>,
    /// Whether samples are heights on the Earth whose unit is known.
    is_earth: bool,
    unit_is_known: bool,
    z_scale: f64,
    system: System,
}

/// What is known of a data set apart from its place.
pub(crate) struct Known {
    pub(crate) system: System,
    pub(crate) heights: Heights,
    pub(crate) voids: Voids,
    pub(crate) mask: Option<Masking>,
    pub(crate) warnings: Vec<Warning>,
}

impl OpenedDem {
    pub(crate) fn new(
        path: &Path,
        reader: Box<dyn Reader>,
        beside: Beside,
        options: &OpenOptions,
    ) -> Result<Self, LayoutError> {
        let mut declared = reader.declared().clone();
        let mask = beside.complete(&mut declared, options)?;
        let mut warnings = declared.warnings.clone();
        let mut system = crs::resolve(&declared.crs, options.crs.as_deref(), &mut warnings)?;
        let map = declared.place.as_mut().map(|place| &mut place.value);
        warnings.extend(crs::eastings_first(&mut system, map));
        let voids = Voids::new(path, &declared.value.nodata, &options.nodata, declared.sample_type)?
            .within(declared.value.valid.as_ref().map(|valid| valid.value), declared.sample_type);
        let heights = heights(&declared.value, &system, options, options.decode.is_some(), &mut warnings)?;
        Self::known(path, reader, declared, Known { system, heights, voids, mask, warnings }, options)
    }

    /// As [`new`](Self::new), of a data set of which all but the place is `known`.
    pub(crate) fn known(
        path: &Path,
        reader: Box<dyn Reader>,
        declared: Declared,
        known: Known,
        options: &OpenOptions,
    ) -> Result<Self, LayoutError> {
        let Known { mut system, heights, voids, mask, mut warnings } = known;
        let file_map = declared.place.as_ref().map(|place| place.value);
        let lie = match file_map {
            Some(map) if !options.as_stored => Lie::of(&map, system.signs, declared.samples),
            _ => Lie::Along(Turn::default()),
        };
        let turn = match lie {
            Lie::Along(turn) => turn,
            Lie::Across => Turn::default(),
        };
        let mut samples = turn.samples(declared.samples);
        let mut map = file_map.map(|map| turn.map(map, declared.samples));
        let (mut placed, notes) = (Vec::new(), declared.notes.clone());
        if !turn.is_none() {
            placed.push(turn.words().to_owned());
        }
        let is_stated = options.spacing_is_stated || options.reproject.is_some();
        // What the unit of coordinates is may have to be guessed, and is needed before a warp.
        let mut found = spacing(path, &mut system, map, samples, is_stated, &mut warnings)?;
        let mut sample_type = declared.sample_type;
        let warp =
            Warp::plan(path, &system, map, samples, declared.sample_type, lie == Lie::Across, options)?;
        if let Some(warp) = &warp {
            if lie == Lie::Across && options.reproject.is_none() {
                warnings.push(Warning::new(format!(
                    "the grid is turned by {:.2} degrees against north; it was resampled north-up, {}",
                    turned_by(&file_map.unwrap_or_default(), system.signs),
                    warp.method()
                )));
            }
            (samples, map, sample_type) = (warp.samples(), Some(warp.map()), warp.sample_type());
            placed.push(warp.words());
            if let Some(doubt) = warp.doubt() {
                let target = warp.system().map_or("", |target| target.name.as_str());
                warnings.push(Warning::new(crs::shift_in_doubt(doubt, &system.name, target)));
            }
            if let Some(target) = warp.system() {
                system = System { vertical: system.vertical.clone(), ..target.clone() };
            }
            found = spacing(path, &mut system, map, samples, options.spacing_is_stated, &mut warnings)?;
        }
        let is_earth = system.radius_m.is_none_or(crs::is_earth) && system.kind != Kind::Local;
        let info = describe(
            &declared,
            &system,
            &heights,
            &found,
            map,
            samples,
            sample_type,
            &voids,
            [placed, notes],
        );
        let z_scale = options.z_scale.unwrap_or(1.0);
        // A factor that was typed is an answer to what advises one.
        let is_answered = |warning: &Warning| {
            z_scale != 1.0 && matches!(&warning.mended_by, Some((Remedy::HeightFactor, _)))
        };
        warnings.retain(|warning| !is_answered(warning));
        Ok(Self {
            reader,
            info,
            voids,
            mask,
            turn,
            warp,
            suspicion: Suspicion::new(),
            warnings,
            is_earth,
            unit_is_known: heights.unit_is_known,
            z_scale,
            system,
        })
    }

    /// The reference system.
    pub(crate) fn system(&self) -> &System {
        &self.system
    }

    /// Whether the unit of heights was found, not assumed.
    pub(crate) fn unit_is_known(&self) -> bool {
        self.unit_is_known
    }

    /// What was declared and may be wrong, before any sample was looked at.
    pub(crate) fn declared_warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Values named as "no data" that no sample had so far.
    pub(crate) fn unmatched(&self) -> Vec<String> {
        self.voids.unmatched()
    }

    /// What the reader saw while it streamed.
    pub(crate) fn seen_by_reader(&self) -> Vec<Warning> {
        self.reader.warnings()
    }

    /// Raw samples in north-up order, as far as that is exact.
    fn stream_turned(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let turning = Turning { turn: self.turn, samples: self.reader.declared().samples, sink };
        let sink: &dyn SampleSink = if self.turn.is_none() { sink } else { &turning };
        let voiding = Voiding { voids: &self.voids, suspicion: &self.suspicion, sink };
        match &self.mask {
            None => self.reader.stream(&voiding),
            Some(mask) => mask.stream(&*self.reader, &voiding),
        }
    }
}

impl DemSource for OpenedDem {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn warnings(&self) -> Vec<Warning> {
        let mut warnings = self.warnings.clone();
        warnings.extend(self.reader.warnings());
        let [scale_m, offset_m] =
            [self.info.height_scale, self.info.height_offset_m].map(|m| m * self.z_scale);
        let unit_is_known = self.unit_is_known || self.z_scale != 1.0;
        warnings.extend(self.suspicion.warnings(scale_m, offset_m, self.is_earth, unit_is_known));
        for value in self.voids.unmatched() {
            warnings.push(
                Warning::new(format!(
                    "no sample is {}, which was named as \"no data\"",
                    harmless(&value, 40)
                ))
                .mended_by(Remedy::Nodata, "VALUE"),
            );
        }
        warnings
    }

    fn memory_bytes(&self) -> u64 {
        let warp = self.warp.as_ref().map_or(0, Warp::memory_bytes);
        let mask = self.mask.as_ref().map_or(0, Masking::memory_bytes);
        self.reader.memory_bytes() + warp + mask
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        match &self.warp {
            None => self.stream_turned(sink),
            Some(warp) => warp.stream(&|store| self.stream_turned(store), sink),
        }
    }
}

/// What is said of the data set once all is known.
#[allow(clippy::too_many_arguments, reason = "each is a part of what was found, and they meet here alone")]
fn describe(
    declared: &Declared,
    system: &System,
    heights: &Heights,
    found: &Spacing,
    map: Option<[f64; 6]>,
    samples: [u32; 2],
    sample_type: terrasoar_layout::dem::SampleType,
    voids: &Voids,
    [placed, notes]: [Vec<String>; 2],
) -> DemInfo {
    let mut georeference = crs::georeference(system, map);
    georeference.spacing_m = found.metres;
    georeference.centre_latitude_deg = found.latitude_deg;
    let mut origins = Vec::new();
    let mut say = |what: &str, words: String| {
        if !words.is_empty() {
            origins.push((what.to_owned(), words));
        }
    };
    say("place", declared.place.as_ref().map(|place| format!("from {}", place.by)).unwrap_or_default());
    say("reference system", if system.by.is_empty() { String::new() } else { format!("from {}", system.by) });
    say("spacing", found.words.clone());
    say("heights", heights.words.clone());
    let void_texts: Vec<String> = voids.texts().map(|text| harmless(text, 40)).collect();
    let by: Vec<&str> = declared.value.nodata.iter().map(|said| said.by.as_str()).collect();
    if !void_texts.is_empty() {
        let by = if by.is_empty() { "as typed".to_owned() } else { format!("from {}", by.join(", ")) };
        say("no data", format!("{} {by}", void_texts.join(", ")));
    }
    for words in placed {
        say("placement", words);
    }
    for words in &declared.aloud {
        say("tiles", words.clone());
    }
    for note in notes {
        say("note", note);
    }
    let vertical = system.vertical.as_ref();
    let about = About {
        crs_text: if system.text.chars().count() <= MAX_CRS_CHARS {
            system.text.clone()
        } else {
            String::new()
        },
        horizontal_unit: system.unit.as_ref().map(|unit| match unit.size {
            crate::reader::HorizontalSize::Metres(size) => {
                UnitOf { name: unit.name.clone(), size, is_angle: false }
            }
            crate::reader::HorizontalSize::Radians(size) => {
                UnitOf { name: unit.name.clone(), size, is_angle: true }
            }
        }),
        vertical_name: vertical.map(|vertical| vertical.name.clone()).unwrap_or_default(),
        vertical_epsg: vertical.and_then(|vertical| vertical.code),
        vertical_unit: Some(heights.unit.clone()),
        origins,
        warnings: Vec::new(),
    };
    DemInfo {
        samples_wide: samples[0],
        samples_high: samples[1],
        sample_type,
        height_scale: heights.scale_m,
        height_offset_m: heights.offset_m,
        georeference,
        format: declared.format.clone(),
        about,
    }
}

/// Passes samples on with voids as NaN.
struct Voiding<'a> {
    voids: &'a Voids,
    suspicion: &'a Suspicion,
    sink: &'a dyn SampleSink,
}

impl SampleSink for Voiding<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        if self.voids.is_idle() {
            self.suspicion.look(samples);
            return self.sink.put(window, samples);
        }
        let mut samples = samples.to_vec();
        self.voids.apply(&mut samples);
        self.suspicion.look(&samples);
        self.sink.put(window, &samples)
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.sink.put_void(window)
    }
}
