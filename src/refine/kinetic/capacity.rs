//! How arrays grow and lists shrink, so that memory follows the present mesh and not the largest there ever was.

/// Lists below this many bytes are left as they are.
const SMALL_BYTES: usize = 32 << 10;
/// A list is cut down when a frame uses less than one part in so many of it.
const UNUSED: usize = 32;

/// Makes room for `more` elements in an array that lives as long as the mesh: by an eighth, where doubling would hold half of it empty.
pub(super) fn grow<T>(array: &mut Vec<T>, more: usize) {
    if array.capacity() - array.len() < more {
        array.reserve_exact(more.max(array.len() / 8));
    }
}

/// Gives back most of a list's memory if a frame that used `used` of it has no need of it: after the first frame, or a jump.
pub(super) fn settle<T>(list: &mut Vec<T>, used: usize) {
    if list.capacity() * size_of::<T>() > SMALL_BYTES && used < list.capacity() / UNUSED {
        list.shrink_to((4 * used).max(SMALL_BYTES / size_of::<T>()));
    }
}
