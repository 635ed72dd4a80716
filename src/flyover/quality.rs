//! For which pictures a replay is made, and within which bounds.

use super::{EngineKind, ReplayError};
use crate::flight::FlightFrame;
use crate::refine::Culling;
use crate::view::{ErrorMetric, View, Viewport};
use terrasoar_layout::read::terrain::Terrain;

/// Picture, precision and bounds of a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Quality {
    /// Size of the picture.
    pub viewport: Viewport,
    /// Tolerance in pixels, 0.01 to 10,000.
    pub tolerance_px: f64,
    /// How errors are measured on the screen.
    pub metric: ErrorMetric,
    /// What heights are multiplied by, 0.01 to 100.
    pub vertical_exaggeration: f64,
    /// Where what lies out of view is left out.
    pub culling: Culling,
    /// Vertex tests of one frame that [`EngineKind::Kinetic`] may make; other engines know no bounds.
    pub budget_tests: Option<u64>,
    /// Memory for pages, which are read when a frame needs them, whatever the terrain; without it as [`Terrain::cache_bytes`] has it.
    pub cache_bytes: Option<u64>,
}

impl Default for Quality {
    fn default() -> Self {
        Self {
            viewport: Viewport::default(),
            tolerance_px: 1.0,
            metric: ErrorMetric::default(),
            vertical_exaggeration: 1.0,
            culling: Culling::default(),
            budget_tests: None,
            cache_bytes: None,
        }
    }
}

impl Quality {
    /// This quality with a picture of another size.
    pub fn viewport(self, viewport: Viewport) -> Self {
        Self { viewport, ..self }
    }

    /// This quality with another tolerance in pixels.
    pub fn tolerance_px(self, tolerance_px: f64) -> Self {
        Self { tolerance_px, ..self }
    }

    /// This quality with errors measured in another way.
    pub fn metric(self, metric: ErrorMetric) -> Self {
        Self { metric, ..self }
    }

    /// This quality with heights multiplied by another number.
    pub fn vertical_exaggeration(self, vertical_exaggeration: f64) -> Self {
        Self { vertical_exaggeration, ..self }
    }

    /// This quality with another way of culling.
    pub fn culling(self, culling: Culling) -> Self {
        Self { culling, ..self }
    }

    /// This quality with so many vertex tests a frame at most.
    pub fn budget_tests(self, budget_tests: u64) -> Self {
        Self { budget_tests: Some(budget_tests), ..self }
    }

    /// This quality with pages that are read into so many bytes of memory when they are needed.
    pub fn cache_bytes(self, cache_bytes: impl Into<Option<u64>>) -> Self {
        Self { cache_bytes: cache_bytes.into(), ..self }
    }
}

impl Quality {
    /// Checks it, and that `kind` can fly over `terrain` at all.
    pub(super) fn check(self, terrain: &Terrain, kind: EngineKind) -> Result<Self, ReplayError> {
        let steps = terrain.grid().side_steps();
        if kind == EngineKind::Naive && steps > crate::refine::naive::MOST_STEPS {
            return Err(ReplayError::TooLargeForNaive { steps });
        }
        if !(0.01..=10_000.0).contains(&self.tolerance_px) {
            return Err(ReplayError::Tolerance(self.tolerance_px));
        }
        if !(0.01..=100.0).contains(&self.vertical_exaggeration) {
            return Err(ReplayError::Exaggeration(self.vertical_exaggeration));
        }
        let Viewport { width_px, height_px } = self.viewport;
        if [width_px, height_px].iter().any(|p| !(1..=65_536).contains(p)) {
            return Err(ReplayError::Viewport(self.viewport));
        }
        Ok(self)
    }

    /// A frame of a flight at this quality.
    pub fn view(self, frame: &FlightFrame) -> View {
        let view = frame.view(self.viewport, self.tolerance_px);
        View { vertical_exaggeration: self.vertical_exaggeration, metric: self.metric, ..view }
    }
}
