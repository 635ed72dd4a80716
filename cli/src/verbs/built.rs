//! What a build tells when it is done: words or one JSON object.

use super::output::{decimal, grouped};
use super::progress::short;
use super::terrain;
use serde::Serialize;
use std::path::Path;
use terrasoar_layout::build::compact_step_m;
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::words::number;

/// What came of a build.
#[derive(Debug, Serialize)]
pub(super) struct Built {
    file: String,
    samples: [u32; 2],
    spacing_m: [f64; 2],
    height_range_m: [f64; 2],
    record: &'static str,
    record_bytes: usize,
    /// Null where heights are kept as the data has them, in no steps.
    height_step_m: Option<f64>,
    heights_rounded: bool,
    /// What compact records would round heights to, and the bytes of the terrain file then; null where records are compact, or exact ones were asked for.
    compact_step_m: Option<f64>,
    compact_bytes: Option<u64>,
    nodata_samples: u64,
    bytes: u64,
    bytes_per_sample: f64,
    seconds: f64,
}

impl Built {
    /// `bytes` is what the file takes, packed or not. `chosen`: whether the kind of records was left to the build.
    pub(super) fn of(out: &Path, header: &Header, chosen: bool, bytes: u64, seconds: f64) -> Self {
        let samples = header.grid.samples();
        let compact_step_m = compact_step_m(header).filter(|_| chosen);
        // Of its pages those with records alone become fewer.
        let times = (header.record_kind.bytes() / RecordKind::Compact.bytes()) as u64;
        let fewer = header.stored_pages - header.stored_pages.div_ceil(times);
        let compact_bytes = header.file_bytes.saturating_sub(fewer * PAGE_BYTES as u64);
        Self {
            file: out.display().to_string(),
            samples,
            spacing_m: header.grid.spacing_m(),
            height_range_m: header.height_range_m,
            record: header.record_kind.name(),
            record_bytes: header.record_kind.bytes(),
            height_step_m: header.record_kind.has_height_codes().then_some(header.scale.height_step_m),
            heights_rounded: header.heights_rounded,
            compact_step_m,
            compact_bytes: compact_step_m.map(|_| compact_bytes),
            nodata_samples: header.nodata_samples,
            bytes,
            bytes_per_sample: bytes as f64 / samples.map(f64::from).iter().product::<f64>(),
            seconds,
        }
    }

    /// Where heights are kept exactly: what rounding them would come to.
    pub(super) fn compact_note(&self) -> Option<String> {
        let (step_m, bytes) = (self.compact_step_m?, self.compact_bytes?);
        let share = if self.record_bytes > 8 { "a quarter" } else { "half" };
        Some(format!(
            "note: heights are kept exactly; --height-step {step} would round them to {step} m, at most {half} m away, and take {share} of the records' bytes: about {} without packing",
            grouped(bytes),
            step = number(step_m),
            half = number(step_m / 2.0)
        ))
    }

    pub(super) fn text(&self, header: &Header) -> String {
        let [wide, high] = self.samples.map(u64::from);
        let samples = wide * high;
        let voids = match self.nodata_samples {
            0 => "no voids".to_owned(),
            voids => format!("{} voids ({:.3} %)", grouped(voids), 100.0 * voids as f64 / samples as f64),
        };
        let filled = header.about.origins.iter().find(|(what, _)| what == "voids");
        let filled = filled.map(|(_, words)| format!("; {words}")).unwrap_or_default();
        let rounded = match self.height_step_m.filter(|_| self.heights_rounded) {
            Some(step_m) if step_m < 1e-9 => format!(", heights rounded to {} m", number(step_m)),
            Some(step_m) => format!(", heights rounded to {} m", decimal(step_m, 9)),
            None => String::new(),
        };
        format!(
            "{}: {} x {} samples in {:.1} s ({} samples/s), {} bytes ({:.2} a sample)\n\
             {} records of {} bytes{rounded}, {} error, spacing {} ({})\n\
             {voids}{filled}",
            self.file,
            grouped(wide),
            grouped(high),
            self.seconds,
            short(samples as f64 / self.seconds.max(1e-9)),
            grouped(self.bytes),
            self.bytes_per_sample,
            self.record,
            self.record_bytes,
            header.error_kind.name(),
            terrain::spacing(header),
            terrain::spacing_origin(header)
        )
    }
}
