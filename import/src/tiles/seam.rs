//! A part of a pyramid that goes on beyond 180 degrees: its two halves, side by side as one grid.
//!
//! Columns are counted on past the world's last one. Both halves are of one zoom; what lies between them, or above or below one of them, is void. Cost: two plans.

use super::Pyramid;
use super::grid::last;
use crate::options::TileOptions;
use std::path::Path;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Pyramids side by side.
pub(super) struct Halves {
    /// Each with the column and row of the whole where it begins.
    pub(super) all: Vec<(Pyramid, [u32; 2])>,
    /// Columns and rows.
    pub(super) size: [u64; 2],
    /// First column and row in the world of its zoom.
    pub(super) first: [u64; 2],
    /// Why one half is not there.
    pub(super) missing: Option<String>,
}

impl Halves {
    /// What the options ask for: a part of the world, or two where west lies east of east.
    ///
    /// # Errors
    /// As [`Pyramid::open`].
    pub(super) fn open(path: &Path, options: &TileOptions) -> Result<Self, LayoutError> {
        let open = |bounds: Option<[f64; 4]>, zoom: Option<u8>| {
            Pyramid::open(path, &TileOptions { bounds_deg: bounds, zoom, ..options.clone() }, None)
        };
        let [west, east] = match options.bounds_deg {
            Some([west, south, east, north]) if west > east && west < 180.0 && east > -180.0 => {
                [[west, south, 180.0, north], [-180.0, south, east, north]].map(Some)
            }
            whole => return Ok(Self::of(vec![open(whole, options.zoom)?])),
        };
        Ok(match (open(west, options.zoom), open(east, options.zoom)) {
            (Ok(a), Ok(b)) if a.plan.zoom == b.plan.zoom => Self::of(vec![a, b]),
            (Ok(a), Ok(b)) => {
                let zoom = Some(a.plan.zoom.min(b.plan.zoom));
                Self::of(vec![open(west, zoom)?, open(east, zoom)?])
            }
            // On one side there are no tiles.
            (Ok(one), Err(error @ (LayoutError::Unmet { .. } | LayoutError::Usage(_))))
            | (Err(error @ (LayoutError::Unmet { .. } | LayoutError::Usage(_))), Ok(one)) => {
                Self { missing: Some(error.to_string()), ..Self::of(vec![one]) }
            }
            (Err(error), _) | (_, Err(error)) => return Err(error),
        })
    }

    /// Of pyramids of one zoom, from the west.
    fn of(pyramids: Vec<Pyramid>) -> Self {
        let top = pyramids.iter().map(|pyramid| pyramid.plan.first[1]).min().unwrap_or(0);
        let west = pyramids.first().map_or(0, |pyramid| pyramid.plan.first[0]);
        let (mut size, mut all) = ([0; 2], Vec::new());
        for pyramid in pyramids {
            let plan = &pyramid.plan;
            let world = (u64::from(last(plan.zoom)) + 1) * u64::from(plan.side);
            // The eastern half begins once more at 0.
            let col = if plan.first[0] < west { plan.first[0] + world } else { plan.first[0] } - west;
            let row = plan.first[1] - top;
            size = [size[0].max(col + u64::from(plan.size[0])), size[1].max(row + u64::from(plan.size[1]))];
            // What is larger than a terrain is refused before it is read.
            all.push((pyramid, [col, row].map(|at| u32::try_from(at).unwrap_or(u32::MAX))));
        }
        Self { all, size, first: [west, top], missing: None }
    }

    /// Whether tiles of both are of one size.
    pub(super) fn is_even(&self) -> bool {
        self.all.iter().all(|(pyramid, _)| pyramid.plan.side == self.all[0].0.plan.side)
    }

    /// Hands on what no half covers, as voids.
    pub(super) fn put_rest(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        // Below the side of a terrain.
        let [wide, high] = self.size.map(|side| side as u32);
        let void = |col: u32, row: u32, width: u32, height: u32| match width > 0 && height > 0 {
            true => sink.put_void(Window { col, row, width, height }),
            false => Ok(()),
        };
        let mut col = 0;
        for (pyramid, [left, top]) in &self.all {
            let [width, height] = pyramid.plan.size;
            void(col, 0, left - col, high)?;
            void(*left, 0, width, *top)?;
            void(*left, top + height, width, high - top - height)?;
            col = left + width;
        }
        void(col, 0, wide - col, high)
    }
}

/// Hands windows on that are counted from elsewhere.
pub(super) struct Shifted<'a> {
    pub(super) sink: &'a dyn SampleSink,
    pub(super) by: [u32; 2],
}

impl Shifted<'_> {
    fn window(&self, window: Window) -> Window {
        Window { col: window.col + self.by[0], row: window.row + self.by[1], ..window }
    }
}

impl SampleSink for Shifted<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.sink.put(self.window(window), samples)
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.sink.put_void(self.window(window))
    }
}
