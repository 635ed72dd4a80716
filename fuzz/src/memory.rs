//! How much memory a body takes, and the most that it may.
//!
//! Counted is what the libraries' own code allocates, on all threads. Code in C (Zstandard) allocates apart from that; the fuzzer's limit for the process holds it.

use peak_alloc::PeakAlloc;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// Does the work, which must not have more than `allowed` bytes beyond those of now at any time.
pub(crate) fn within(allowed: usize, work: impl FnOnce()) {
    let before = HEAP.current_usage();
    HEAP.reset_peak_usage();
    work();
    let peak = HEAP.peak_usage().saturating_sub(before);
    assert!(peak <= allowed, "{peak} bytes of memory, and {allowed} are in proportion to the input");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "in proportion to the input")]
    fn memory_that_was_given_back_counts() {
        within(1 << 20, || drop(std::hint::black_box(vec![1u8; 4 << 20])));
    }
}
