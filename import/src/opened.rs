//! From what a file says to a DEM that can be built: the one layer between every reader and the build.
//!
//! What a reader declares is turned into metres, north and voids here, once for all formats.

use crate::crs::georeference;
use crate::options::{Direction, OpenOptions};
use crate::reader::{Reader, VerticalUnit};
use crate::value::{US_SURVEY_FOOT_M, Voids, unit_m};
use std::path::Path;
use terrasoar_layout::dem::{DemInfo, DemSource, SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// A data set as the build wants it.
pub(crate) struct OpenedDem {
    reader: Box<dyn Reader>,
    info: DemInfo,
    voids: Voids,
}

impl OpenedDem {
    pub(crate) fn new(
        path: &Path,
        reader: Box<dyn Reader>,
        options: &OpenOptions,
    ) -> Result<Self, LayoutError> {
        let declared = reader.declared();
        let voids = Voids::new(path, &declared.value.nodata, &options.nodata, declared.sample_type)?;
        let value = &declared.value;
        let unit = value.unit.as_ref().and_then(|unit| match &unit.value {
            VerticalUnit::Name(name) => unit_m(name),
            VerticalUnit::Metres(metres) => Some(*metres),
            VerticalUnit::Code(9002) => Some(0.3048),
            VerticalUnit::Code(9003) => Some(US_SURVEY_FOOT_M),
            VerticalUnit::Code(_) => None,
        });
        let sign = match options.positive.or(value.direction.as_ref().map(|said| said.value)) {
            Some(Direction::Down) => -1.0,
            Some(Direction::Up) | None => 1.0,
        };
        let metres = sign * unit.unwrap_or(1.0);
        let info = DemInfo {
            samples_wide: declared.samples[0],
            samples_high: declared.samples[1],
            sample_type: declared.sample_type,
            height_scale: value.scale.as_ref().map_or(1.0, |said| said.value) * metres,
            height_offset_m: value.offset.as_ref().map_or(0.0, |said| said.value) * metres,
            georeference: georeference(&declared.crs, declared.place.as_ref().map(|place| place.value)),
            format: declared.format.clone(),
        };
        Ok(Self { reader, info, voids })
    }
}

impl DemSource for OpenedDem {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn memory_bytes(&self) -> u64 {
        self.reader.memory_bytes()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        if self.voids.is_idle() {
            return self.reader.stream(sink);
        }
        self.reader.stream(&Voiding { voids: &self.voids, sink })
    }
}

/// Passes samples on with voids as NaN.
struct Voiding<'a> {
    voids: &'a Voids,
    sink: &'a dyn SampleSink,
}

impl SampleSink for Voiding<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let mut samples = samples.to_vec();
        self.voids.apply(&mut samples);
        self.sink.put(window, &samples)
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.sink.put_void(window)
    }
}
