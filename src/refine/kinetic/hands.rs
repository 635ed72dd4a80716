//! Work that many hands share: arrays filled, and parts of arrays changed, by as many threads as there are.
//!
//! Invariant: what comes out is the same whatever the number of threads; each element is made by itself, from its number alone. Little work is done by the thread that asks, and all of it
//! where there are no threads. Cost: the work, and some microseconds to share it.

use super::capacity::grow;
#[cfg(feature = "files")]
use rayon::prelude::*;
use std::cell::Cell;
use std::ops::Range;

/// Elements that one thread takes at the least.
const SHARE: usize = 2048;

thread_local! {
    /// Whether this thread shares nothing.
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Does something without sharing work of this thread: what is asked of a store of records is asked in the same order then, each time.
pub(crate) fn alone<T>(work: impl FnOnce() -> T) -> T {
    /// Puts back what was, on a panic too.
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            IS_ALONE.set(self.0);
        }
    }
    let _before = Before(IS_ALONE.replace(true));
    work()
}

/// Whether work on so many elements is shared, so many at the least by each.
#[cfg(feature = "files")]
pub(super) fn is_shared(count: usize, share: usize) -> bool {
    count >= 2 * share && !IS_ALONE.get() && rayon::current_num_threads() > 1
}

#[cfg(not(feature = "files"))]
pub(super) fn is_shared(_: usize, _: usize) -> bool {
    false
}

/// Appends `make(0)` and so on to an array.
pub(super) fn extend<T: Send>(array: &mut Vec<T>, count: usize, make: impl Fn(usize) -> T + Sync + Send) {
    extend_by(SHARE, array, count, make);
}

/// As [`extend`], shared where each thread makes `share` elements at the least.
pub(super) fn extend_by<T: Send>(
    share: usize,
    array: &mut Vec<T>,
    count: usize,
    make: impl Fn(usize) -> T + Sync + Send,
) {
    grow(array, count);
    #[cfg(feature = "files")]
    if is_shared(count, share) {
        return array.par_extend((0..count).into_par_iter().with_min_len(share).map(make));
    }
    let _ = share;
    array.extend((0..count).map(make));
}

/// Appends to a list what `make` puts into one for each part of `0..count`, in order.
pub(super) fn gather<T: Copy + Send + Sync>(
    list: &mut Vec<T>,
    count: usize,
    make: impl Fn(Range<usize>, &mut Vec<T>) + Sync,
) {
    #[cfg(feature = "files")]
    if is_shared(count, SHARE) {
        let part = |i: usize| {
            let mut made = Vec::new();
            make(SHARE * i..count.min(SHARE * (i + 1)), &mut made);
            made
        };
        let parts: Vec<Vec<T>> = (0..count.div_ceil(SHARE)).into_par_iter().map(part).collect();
        list.reserve_exact(parts.iter().map(Vec::len).sum());
        return parts.iter().for_each(|made| list.extend_from_slice(made));
    }
    make(0..count, list);
}

/// Changes an array part by part; `change` is told where a part begins.
pub(super) fn change<T: Send>(array: &mut [T], change: impl Fn(usize, &mut [T]) + Sync) {
    #[cfg(feature = "files")]
    if is_shared(array.len(), SHARE) {
        let parts = array.par_chunks_mut(SHARE).enumerate();
        return parts.for_each(|(i, part)| change(SHARE * i, part));
    }
    change(0, array);
}

/// Appends `count` elements like `blank`, and has `make` set them part by part; it is told where a part begins.
pub(super) fn extend_parts<T: Copy + Send + Sync>(
    array: &mut Vec<T>,
    count: usize,
    blank: T,
    make: impl Fn(usize, &mut [T]) + Sync,
) {
    let before = array.len();
    grow(array, count);
    array.resize(before + count, blank);
    change(&mut array[before..], make);
}

/// Does two things, side by side if they are worth it.
pub(super) fn both(count: usize, one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    #[cfg(feature = "files")]
    if is_shared(count, SHARE) {
        rayon::join(one, other);
        return;
    }
    let _ = count;
    one();
    other();
}
