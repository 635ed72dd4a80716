//! How ground is streamed: plain values.

use crate::refine::Culling;
use crate::refine::kinetic::Budget;
use crate::stream::Prefetch;
use std::time::Duration;

/// How pages of a terrain are brought, and what the engine may do with them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StreamOptions {
    /// Memory for record pages in bytes, 72 KiB at the least; 64 MiB by default. What the mesh takes comes on top.
    pub cache_bytes: u64,
    /// Threads that read, as many reads as are under way at once; 4 by default.
    pub threads: usize,
    /// Longest that the first update waits for its pages; half a second by default. Later ones never wait, and with a wait of zero none does.
    pub first_wait: Duration,
    /// Where what lies out of view is left out.
    pub culling: Culling,
    /// How pages are asked for before they are needed.
    pub prefetch: Prefetch,
    /// What one update may do; without bounds by default.
    pub budget: Budget,
    /// Memory in MiB for rewriting the file in the background where an edit needs heights that its records cannot hold; 512 by default. With 0 such edits are refused instead.
    pub room_mib: u64,
}

impl Default for StreamOptions {
    fn default() -> Self {
        Self {
            cache_bytes: 64 << 20,
            threads: 4,
            first_wait: Duration::from_millis(500),
            culling: Culling::default(),
            prefetch: Prefetch::default(),
            budget: Budget::default(),
            room_mib: 512,
        }
    }
}

impl StreamOptions {
    /// These options with so many mebibytes of memory for record pages.
    pub fn cache_mib(self, mebibytes: u64) -> Self {
        self.cache_bytes(mebibytes.saturating_mul(1 << 20))
    }

    /// These options with so many bytes of memory for record pages.
    pub fn cache_bytes(self, cache_bytes: u64) -> Self {
        Self { cache_bytes, ..self }
    }

    /// These options with so many threads that read.
    pub fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// These options with another longest wait of the first update.
    pub fn first_wait(self, first_wait: Duration) -> Self {
        Self { first_wait, ..self }
    }

    /// These options with another way of culling.
    pub fn culling(self, culling: Culling) -> Self {
        Self { culling, ..self }
    }

    /// These options with another way of asking ahead.
    pub fn prefetch(self, prefetch: Prefetch) -> Self {
        Self { prefetch, ..self }
    }

    /// These options with so much memory for rewriting the file where an edit needs heights that its records cannot hold; with 0 such edits are refused.
    pub fn room_mib(self, room_mib: u64) -> Self {
        Self { room_mib, ..self }
    }

    /// These options with bounds on what one update may do.
    pub fn budget(self, budget: Budget) -> Self {
        Self { budget, ..self }
    }
}
