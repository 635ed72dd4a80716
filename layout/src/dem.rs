//! The meeting point of import and build: what a digital elevation model says about
//! itself ([`DemInfo`]) and how its samples arrive ([`DemSource::stream`]).
//!
//! A source pushes rectangular windows of raw samples into a [`SampleSink`], in any order and
//! from any number of threads; it never holds the whole grid. Windows are in source order: row 0
//! is the northernmost row, column 0 the westernmost. A void is NaN. Cost: each sample is decoded
//! once and pushed once.

use crate::error::LayoutError;
use crate::remedy::Remedy;

/// Storage type of the samples of a DEM, as its file declares it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleType {
    /// Unsigned 8-bit integers.
    U8,
    /// Signed 8-bit integers.
    I8,
    /// Unsigned 16-bit integers.
    U16,
    /// Signed 16-bit integers.
    I16,
    /// Unsigned 32-bit integers.
    U32,
    /// Signed 32-bit integers.
    I32,
    /// Unsigned 64-bit integers; beyond 2^53 they arrive as the nearest double.
    U64,
    /// Signed 64-bit integers; beyond 2^53 they arrive as the nearest double.
    I64,
    /// IEEE half precision.
    F16,
    /// IEEE single precision.
    F32,
    /// IEEE double precision.
    F64,
}

impl SampleType {
    /// Whether every value of the type is a whole number.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// Whether every value of the type is exactly representable as `f32`.
    pub fn fits_f32(self) -> bool {
        matches!(self, Self::U8 | Self::I8 | Self::U16 | Self::I16 | Self::F16 | Self::F32)
    }
}

/// Unit of the horizontal coordinates of a DEM's reference system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HorizontalUnit {
    /// The file does not say.
    #[default]
    Unknown,
    /// Metres.
    Metre,
    /// Degrees of longitude and latitude.
    Degree,
    /// International feet, 0.3048 m.
    Foot,
    /// US survey feet, 1200/3937 m.
    UsSurveyFoot,
}

/// Where a DEM lies on the ground.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Georeference {
    /// EPSG code of the horizontal reference system, if the file names one.
    pub epsg: Option<u32>,
    /// Name of the reference system in words; empty if unknown.
    pub crs_name: String,
    /// Unit of the coordinates that `pixel_to_crs` yields.
    pub unit: HorizontalUnit,
    /// Affine map from *sample centres* (column, row; row 0 northernmost in file order) to reference-system
    /// coordinates: `x = m[0] + m[1]*col + m[2]*row`, `y = m[3] + m[4]*col + m[5]*row`.
    pub pixel_to_crs: Option<[f64; 6]>,
    /// Radius of the body's equator in metres when the file names one other than the Earth's.
    pub body_radius_m: Option<f64>,
    /// Metres between samples on the ground, along columns and along rows, at the centre; `None` to have them follow from `unit` and `pixel_to_crs`.
    pub spacing_m: Option<[f64; 2]>,
    /// Latitude of the centre in degrees, where `spacing_m` was converted from angles.
    pub centre_latitude_deg: Option<f64>,
}

/// A unit of coordinates or heights.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct UnitOf {
    /// Its name in words.
    pub name: String,
    /// Metres a unit, or radians where `is_angle`.
    pub size: f64,
    /// Whether it measures angles.
    pub is_angle: bool,
}

/// What a terrain file keeps of a DEM in words: for people, and for programs that bring coordinates into other systems.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct About {
    /// The reference system in full, as WKT or a PROJ string; empty if unknown.
    pub crs_text: String,
    /// Unit of the coordinates.
    pub horizontal_unit: Option<UnitOf>,
    /// What heights are measured from: "NAVD88 height"; empty if unknown.
    pub vertical_name: String,
    /// EPSG code of the vertical system.
    pub vertical_epsg: Option<u32>,
    /// Unit in which the file gives heights.
    pub vertical_unit: Option<UnitOf>,
    /// What was found where: `("heights", "band 1, unit ft, from GDAL's metadata")`.
    pub origins: Vec<(String, String)>,
    /// What may make the ground wrong, in words.
    pub warnings: Vec<String>,
}

impl About {
    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// What may make the ground wrong, in words for the person who asked for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// What was seen, and what was assumed.
    pub words: String,
    /// What to ask for if that is wrong, and with which value: `(Remedy::Nodata, "-9999")`.
    pub mended_by: Option<(Remedy, String)>,
}

impl Warning {
    /// A warning that nothing on the command line mends.
    pub fn new(words: impl Into<String>) -> Self {
        Self { words: words.into(), mended_by: None }
    }

    /// The warning, and what mends it.
    #[must_use]
    pub fn mended_by(mut self, remedy: Remedy, value: impl Into<String>) -> Self {
        self.mended_by = Some((remedy, value.into()));
        self
    }
}

/// What a DEM file says about itself.
#[derive(Debug, Clone, PartialEq)]
pub struct DemInfo {
    /// Samples from west to east, at least 2.
    pub samples_wide: u32,
    /// Samples from north to south, at least 2.
    pub samples_high: u32,
    /// Storage type of the samples.
    pub sample_type: SampleType,
    /// Metres of height a raw unit; below 0 where raw numbers count downward.
    pub height_scale: f64,
    /// Metres of height at raw value 0.
    pub height_offset_m: f64,
    /// Where it lies.
    pub georeference: Georeference,
    /// Name of the format in words, for messages: "16-bit PNG", "VTP BT 1.3".
    pub format: String,
    /// What is kept of it in words.
    pub about: About,
}

/// A rectangle of samples in source order: row 0 northernmost, column 0 westernmost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub col: u32,
    /// First row.
    pub row: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Takes windows of raw samples from a [`DemSource`].
pub trait SampleSink: Sync {
    /// Takes `window.width * window.height` raw samples, rows from north to south, voids NaN.
    /// The window lies inside the DEM; every sample of the DEM is pushed exactly once.
    ///
    /// # Errors
    /// Whatever keeps the sink from storing them, such as a full disk; the source stops and passes it on.
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError>;

    /// As [`put`](SampleSink::put) of voids alone, of a window of any size. A build takes neither time nor memory for them, so a source that knows of
    /// regions without heights says so here.
    ///
    /// # Errors
    /// As [`put`](SampleSink::put).
    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        let row = vec![f64::NAN; window.width as usize];
        (window.row..window.row + window.height)
            .try_for_each(|row_number| self.put(Window { row: row_number, height: 1, ..window }, &row))
    }

    /// Whether all of a window is void, whatever samples come for it. A source that would make them up, because its file left them out, asks before and says
    /// [`put_void`](SampleSink::put_void) instead.
    fn is_void(&self, _window: Window) -> bool {
        false
    }
}

/// An elevation data set that can be read window by window.
pub trait DemSource: Sync {
    /// What the data set says about itself.
    fn info(&self) -> &DemInfo;

    /// What was seen that may make the ground wrong. Complete once [`stream`](DemSource::stream) has ended well.
    fn warnings(&self) -> Vec<Warning> {
        Vec::new()
    }

    /// Memory in bytes that [`stream`](DemSource::stream) takes beyond a megabyte or two a thread.
    fn memory_bytes(&self) -> u64 {
        0
    }

    /// Pushes every sample exactly once into `sink`, decoding on the current rayon pool where the
    /// format allows it. Holds a few windows at a time, never the whole grid.
    ///
    /// # Errors
    /// Damage in the data, naming the file and the place; or the sink's own error.
    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError>;
}

/// Elevation data held in memory: generated terrain, tests, data from elsewhere in a program.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryDem {
    info: DemInfo,
    /// Raw samples, rows from the south.
    samples: Vec<f64>,
}

impl MemoryDem {
    /// A DEM of `samples` (wide, high) whose raw sample at column x east and row y north is `sample(x, y)`, NaN for a void. It has
    /// no georeference and its raw unit is a metre; see [`MemoryDem::info_mut`].
    pub fn from_fn(
        samples: [u32; 2],
        sample_type: SampleType,
        mut sample: impl FnMut(u32, u32) -> f64,
    ) -> Self {
        let [samples_wide, samples_high] = samples;
        let info = DemInfo {
            samples_wide,
            samples_high,
            sample_type,
            height_scale: 1.0,
            height_offset_m: 0.0,
            georeference: Georeference::default(),
            format: "memory".into(),
            about: About::default(),
        };
        let points = (0..samples_high).flat_map(|y| (0..samples_wide).map(move |x| (x, y)));
        Self { info, samples: points.map(|(x, y)| sample(x, y)).collect() }
    }

    /// The raw sample at column `x` east and row `y` north.
    ///
    /// # Panics
    /// Outside the DEM.
    pub fn sample(&self, x: u32, y: u32) -> f64 {
        self.samples[y as usize * self.info.samples_wide as usize + x as usize]
    }

    /// What the DEM says about itself, to be changed. Its size must stay as it is.
    pub fn info_mut(&mut self) -> &mut DemInfo {
        &mut self.info
    }
}

impl DemSource for MemoryDem {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let width = self.info.samples_wide;
        for (y, samples) in self.samples.chunks_exact(width as usize).enumerate() {
            let row = self.info.samples_high - 1 - y as u32;
            sink.put(Window { col: 0, row, width, height: 1 }, samples)?;
        }
        Ok(())
    }
}
