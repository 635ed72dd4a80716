//! How arrays grow and lists shrink, so that memory follows the present mesh and not the largest there ever was.

/// Lists below this many bytes are left as they are.
const SMALL_BYTES: usize = 32 << 10;
/// Lists of more bytes are given back by another thread.
const LARGE_BYTES: usize = 1 << 20;
/// A list is cut down when a frame uses less than one part in so many of it.
pub(super) const UNUSED: usize = 32;
/// The same after a frame that made most of the mesh, and with it lists that say nothing about the next ones.
pub(super) const UNUSED_BY_NEW: usize = 8;

/// Makes room for `more` elements in an array that lives as long as the mesh: by a sixteenth, where doubling would hold half of it empty. Large arrays are mapped elsewhere, not copied.
pub(super) fn grow<T>(array: &mut Vec<T>, more: usize) {
    if array.capacity() - array.len() < more {
        array.reserve_exact(more.max(array.len() / 16));
    }
}

/// Gives back what an array that has become shorter holds beyond its length, once that is half of it.
pub(super) fn shorten<T>(array: &mut Vec<T>) {
    if array.capacity() > 2 * array.len() {
        array.shrink_to(array.len() + array.len() / 8);
    }
}

/// Gives back most of a list's memory if a frame that used `used` of it has no need of it, but for one part in `unused`: after the first frame, or a jump.
pub(super) fn settle<T: Copy + Send + 'static>(list: &mut Vec<T>, used: usize, unused: usize) {
    let bytes = list.capacity() * size_of::<T>();
    if bytes > SMALL_BYTES && used < list.capacity() / unused {
        let least = (4 * used).max(SMALL_BYTES / size_of::<T>());
        // What is in use now is given back by the next frame.
        if list.len() > list.capacity() / 2 {
            return;
        }
        if bytes < LARGE_BYTES {
            return list.shrink_to(least);
        }
        let mut small = Vec::with_capacity(least.max(list.len()));
        small.extend_from_slice(list);
        give_up(std::mem::replace(list, small));
    }
}

/// Gives back what an array holds beyond its length, if that is most of it: less than one part in `parts` is in use.
pub(in crate::refine::kinetic) fn give_back<T: Copy + Send + 'static>(array: &mut Vec<T>, parts: usize) {
    if array.capacity() * size_of::<T>() > LARGE_BYTES && array.len() < array.capacity() / parts {
        let mut small = Vec::with_capacity(array.len() + array.len() / 8);
        small.extend_from_slice(array);
        give_up(std::mem::replace(array, small));
    }
}

/// Gives memory back beside the frame: the system takes a millisecond for some ten megabytes.
#[cfg(feature = "files")]
pub(in crate::refine::kinetic) fn give_up<T: Send + 'static>(list: Vec<T>) {
    rayon::spawn(move || drop(list));
}

#[cfg(not(feature = "files"))]
pub(in crate::refine::kinetic) fn give_up<T>(list: Vec<T>) {
    drop(list);
}
