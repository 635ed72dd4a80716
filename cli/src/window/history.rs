//! The figures of the latest frames, for the graphs.
//!
//! A fixed number of frames is kept; what is older is forgotten.

use std::collections::VecDeque;

/// Frames that are kept.
pub(crate) const FRAMES: usize = 240;

/// What a frame took.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Figures {
    /// Milliseconds from the frame before, or of the work alone after a rest.
    pub frame_ms: f64,
    /// Milliseconds of the mesh update.
    pub update_ms: f64,
    /// Triangles of the mesh.
    pub triangles: u64,
    /// Vertex tests.
    pub tests: u64,
    /// Vertices split and merged.
    pub changes: u64,
    /// Bytes of the mesh sent to the device.
    pub patch_bytes: u64,
    /// Record pages read.
    pub pages: u64,
    /// Bytes of records read.
    pub record_bytes: u64,
    /// Pages that came from storage.
    pub pages_come: u64,
    /// Bytes of image tiles sent to the device.
    pub image_bytes: u64,
    /// Vertices that wait for a page.
    pub late: u64,
}

/// A figure by name, unit and value.
pub(crate) type Series = (&'static str, &'static str, fn(&Figures) -> f64);

/// What is shown as graphs.
pub(crate) const SERIES: &[Series] = &[
    ("frame", "ms", |f| f.frame_ms),
    ("mesh update", "ms", |f| f.update_ms),
    ("triangles", "", |f| f.triangles as f64),
    ("vertex tests", "", |f| f.tests as f64),
    ("splits + merges", "", |f| f.changes as f64),
    ("patch", "B", |f| f.patch_bytes as f64),
    ("record pages", "", |f| f.pages as f64),
    ("record bytes", "B", |f| f.record_bytes as f64),
    ("pages from storage", "", |f| f.pages_come as f64),
    ("image tiles", "B", |f| f.image_bytes as f64),
    ("vertices late", "", |f| f.late as f64),
];

/// The latest frames.
#[derive(Debug, Default)]
pub(crate) struct History(VecDeque<Figures>);

impl History {
    /// Adds a frame.
    pub(crate) fn push(&mut self, figures: Figures) {
        if self.0.len() == FRAMES {
            self.0.pop_front();
        }
        self.0.push_back(figures);
    }

    /// The frames, oldest first.
    pub(crate) fn iter(&self) -> impl ExactSizeIterator<Item = &Figures> {
        self.0.iter()
    }

    /// The newest frame.
    pub(crate) fn last(&self) -> Option<&Figures> {
        self.0.back()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_are_forgotten() {
        let mut history = History::default();
        for tests in 0..1000 {
            history.push(Figures { tests, ..Default::default() });
        }
        assert_eq!(history.iter().len(), FRAMES);
        assert_eq!(history.last().unwrap().tests, 999);
        assert_eq!(history.iter().next().unwrap().tests, 1000 - FRAMES as u64);
    }
}
