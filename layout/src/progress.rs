//! How far long work has come.

/// Hears how a build gets on.
pub trait Progress: Sync {
    /// A stage begins that will work through `samples` samples.
    fn stage(&self, name: &'static str, samples: u64);
    /// More samples of the stage are done.
    fn advance(&self, samples: u64);
}

/// Hears nothing.
#[derive(Debug, Clone, Copy)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str, _: u64) {}
    fn advance(&self, _: u64) {}
}
