//! An array that grows without moving: it is kept in chunks of equal length, so that no frame copies what the frames before have made.
//!
//! Invariant: all chunks but the last one in use are full. Cost: one more look-up an access, into a list of chunks that stays in the nearest cache.

use terrasoar_layout::read::prefetch::prefetch;

/// An array of `T` in chunks of 2^BITS elements.
#[derive(Debug, Clone)]
pub(crate) struct Chunked<T, const BITS: u32> {
    /// All full but the last one, and those after it, which are empty.
    chunks: Vec<Vec<T>>,
    len: usize,
}

impl<T: Copy, const BITS: u32> Default for Chunked<T, BITS> {
    fn default() -> Self {
        Self { chunks: Vec::new(), len: 0 }
    }
}

impl<T: Copy, const BITS: u32> Chunked<T, BITS> {
    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        (self.chunks.len() << BITS) * size_of::<T>() + self.chunks.capacity() * size_of::<Vec<T>>()
    }

    /// Appends an element; returns its place.
    pub(crate) fn push(&mut self, value: T) -> usize {
        let at = self.len;
        if at >> BITS == self.chunks.len() {
            self.chunks.push(Vec::with_capacity(1 << BITS));
        }
        self.chunks[at >> BITS].push(value);
        self.len += 1;
        at
    }

    /// Takes all elements out; memory stays.
    pub(crate) fn clear(&mut self) {
        self.chunks.iter_mut().for_each(Vec::clear);
        self.len = 0;
    }

    /// Takes out the chunks that hold nothing.
    pub(crate) fn take_empty(&mut self) -> Vec<Vec<T>> {
        self.chunks.split_off(self.len.div_ceil(1 << BITS))
    }

    /// Asks memory for an element, which may not be there.
    #[inline(always)]
    pub(crate) fn prefetch(&self, at: usize) {
        if let Some(chunk) = self.chunks.get(at >> BITS) {
            prefetch(chunk, at & ((1 << BITS) - 1));
        }
    }
}

impl<T, const BITS: u32> std::ops::Index<usize> for Chunked<T, BITS> {
    type Output = T;

    #[inline(always)]
    fn index(&self, at: usize) -> &T {
        &self.chunks[at >> BITS][at & ((1 << BITS) - 1)]
    }
}

impl<T, const BITS: u32> std::ops::IndexMut<usize> for Chunked<T, BITS> {
    #[inline(always)]
    fn index_mut(&mut self, at: usize) -> &mut T {
        &mut self.chunks[at >> BITS][at & ((1 << BITS) - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_an_array() {
        let mut array = Chunked::<u32, 3>::default();
        for i in 0..100 {
            assert_eq!(array.push(i), i as usize);
        }
        array[50] = 7;
        array.prefetch(1000);
        assert!((0..100).all(|i| array[i] == if i == 50 { 7 } else { i as u32 }));
        assert!(array.bytes() >= 13 * 8 * size_of::<u32>());
    }
}
