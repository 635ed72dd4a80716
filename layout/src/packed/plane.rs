//! Planes of numbers with a ring of one around them, and heights predicted from the twelve nearest coarser ones (FORMAT.md, section 9.3).
//!
//! With steps s between a vertex and the corners of its diamond: the four corners count ten times, the eight next coarser vertices around count back. It is exact on cubics. How uneven these are gives
//! the class, in whose context the difference is coded.

use super::model::HEIGHT_CLASSES;
use std::ops::{Add, Sub};

/// A plane of numbers with a ring of one around it.
#[derive(Debug, Default)]
pub(crate) struct Plane<T> {
    row: usize,
    cells: Vec<T>,
}

impl<T: Copy + Default> Plane<T> {
    /// So many columns and rows, besides the ring. What is in it is not said.
    #[inline(always)]
    pub(crate) fn resize(&mut self, wide: usize, high: usize) {
        self.row = wide + 2;
        self.cells.resize(self.row * (high + 2), T::default());
    }

    /// As [`Plane::resize`], filled with `value`, the ring too.
    #[inline(always)]
    pub(crate) fn fill(&mut self, wide: usize, high: usize, value: T) {
        self.resize(wide, high);
        self.cells.fill(value);
    }

    /// `count` cells from column `x` on of row `y`, where -1 is the ring's.
    #[inline(always)]
    pub(crate) fn row(&self, x: isize, y: isize, count: usize) -> &[T] {
        let from = (y + 1) as usize * self.row + (x + 1) as usize;
        &self.cells[from..from + count]
    }

    #[inline(always)]
    pub(crate) fn row_mut(&mut self, x: isize, y: isize, count: usize) -> &mut [T] {
        let from = (y + 1) as usize * self.row + (x + 1) as usize;
        &mut self.cells[from..from + count]
    }

    #[inline(always)]
    pub(crate) fn at(&self, x: isize, y: isize) -> T {
        self.cells[(y + 1) as usize * self.row + (x + 1) as usize]
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, x: isize, y: isize, value: T) {
        self.cells[(y + 1) as usize * self.row + (x + 1) as usize] = value;
    }
}

/// How heights are predicted, a row at a time.
///
/// A type and no function that is handed on: what is called through a function is compiled for any processor.
pub(crate) trait Prediction<T> {
    /// What it has to say of the ground around.
    type Around;

    /// Given the corners of diamonds, two opposite pairs, and the eight vertices around.
    fn row(near: [&[T]; 4], far: [&[T]; 8], predicted: &mut [T], around: &mut [Self::Around]);
}

/// A square lattice of `m` cells a side, and what refines it to the next.
#[derive(Debug, Default)]
pub(crate) struct Lattices<T> {
    /// The lattice itself, of m + 1 vertices a side.
    pub(crate) coarse: Plane<T>,
    /// Centres of its cells, m x m.
    pub(crate) whites: Plane<T>,
    next: Plane<T>,
}

impl<T: Copy + Default> Lattices<T> {
    /// Takes the whites of `m` cells a side, row by row.
    #[inline(always)]
    pub(crate) fn take_whites(&mut self, m: usize, whites: &[T]) {
        self.whites.resize(m, m);
        for (j, row) in whites.chunks_exact(m).enumerate() {
            self.whites.row_mut(0, j as isize, m).copy_from_slice(row);
        }
    }

    /// Takes lattice, whites, and midpoints of edges that run `east` and `north`, m in each of m + 1 rows and m + 1 in each of m, together for the next coarse lattice.
    #[inline(always)]
    pub(crate) fn merge(&mut self, m: usize, east: &[T], north: &[T]) {
        let side = 2 * m + 1;
        self.next.resize(side, side);
        for (j, east) in east.chunks_exact(m).enumerate() {
            let y = j as isize;
            interleave(self.next.row_mut(0, 2 * y, side), self.coarse.row(0, y, m + 1), east);
        }
        for (j, north) in north.chunks_exact(m + 1).enumerate() {
            let y = j as isize;
            interleave(self.next.row_mut(0, 2 * y + 1, side), north, self.whites.row(0, y, m));
        }
        std::mem::swap(&mut self.coarse, &mut self.next);
    }
}

/// A row of one more than twice as many cells, from those at even and at odd places.
#[inline(always)]
fn interleave<T: Copy>(row: &mut [T], even: &[T], odd: &[T]) {
    let (pairs, last) = row.as_chunks_mut::<2>();
    for ((pair, even), odd) in pairs.iter_mut().zip(even).zip(odd) {
        *pair = [*even, *odd];
    }
    last.copy_from_slice(&even[odd.len()..]);
}

impl<T: Copy + Default + Add<Output = T> + Sub<Output = T>> Lattices<T> {
    /// Continues the coarse lattice in straight lines over the border.
    #[inline(always)]
    pub(crate) fn ring_coarse(&mut self, m: usize) {
        let (e, m) = (&mut self.coarse, m as isize);
        for y in 0..=m {
            e.set(-1, y, e.at(0, y) + e.at(0, y) - e.at(1, y));
            e.set(m + 1, y, e.at(m, y) + e.at(m, y) - e.at(m - 1, y));
        }
        for x in -1..=m + 1 {
            e.set(x, -1, e.at(x, 0) + e.at(x, 0) - e.at(x, 1));
            e.set(x, m + 1, e.at(x, m) + e.at(x, m) - e.at(x, m - 1));
        }
    }

    /// Continues the whites over the border, so that the border's edges have the mean of either side.
    #[inline(always)]
    pub(crate) fn ring_whites(&mut self, m: usize) {
        let (e, w, m) = (&self.coarse, &mut self.whites, m as isize);
        for y in 0..m {
            w.set(-1, y, e.at(0, y) + e.at(0, y + 1) - w.at(0, y));
            w.set(m, y, e.at(m, y) + e.at(m, y + 1) - w.at(m - 1, y));
        }
        for x in -1..=m {
            w.set(x, -1, e.at(x, 0) + e.at(x + 1, 0) - w.at(x, 0));
            w.set(x, m, e.at(x, m) + e.at(x + 1, m) - w.at(x, m - 1));
        }
    }

    /// Predicts all whites, row by row.
    #[inline(always)]
    pub(crate) fn predict_whites<P: Prediction<T>>(
        &self,
        m: usize,
        predicted: &mut [T],
        around: &mut [P::Around],
    ) {
        for (j, (predicted, around)) in
            predicted.chunks_exact_mut(m).zip(around.chunks_exact_mut(m)).enumerate()
        {
            let e = |dx: isize, dy: isize| self.coarse.row(dx, j as isize + dy, m);
            let far = [e(-1, 0), e(-1, 1), e(2, 0), e(2, 1), e(0, -1), e(1, -1), e(0, 2), e(1, 2)];
            P::row([e(0, 0), e(1, 1), e(1, 0), e(0, 1)], far, predicted, around);
        }
    }

    /// The same of all blacks: those on edges that run east, row by row, then the others.
    #[inline(always)]
    pub(crate) fn predict_blacks<P: Prediction<T>>(
        &self,
        m: usize,
        predicted: &mut [T],
        around: &mut [P::Around],
    ) {
        let of_east = m * (m + 1);
        let (east, north) = predicted.split_at_mut(of_east);
        let (east_around, north_around) = around.split_at_mut(of_east);
        let rows = east.chunks_exact_mut(m).zip(east_around.chunks_exact_mut(m));
        for (j, (predicted, around)) in rows.enumerate() {
            let e = |dx: isize, dy: isize| self.coarse.row(dx, j as isize + dy, m);
            let w = |dx: isize, dy: isize| self.whites.row(dx, j as isize + dy, m);
            let far = [w(-1, -1), w(-1, 0), w(1, -1), w(1, 0), e(0, -1), e(1, -1), e(0, 1), e(1, 1)];
            P::row([e(0, 0), e(1, 0), w(0, -1), w(0, 0)], far, predicted, around);
        }
        let rows = north.chunks_exact_mut(m + 1).zip(north_around.chunks_exact_mut(m + 1));
        for (j, (predicted, around)) in rows.enumerate() {
            let e = |dx: isize, dy: isize| self.coarse.row(dx, j as isize + dy, m + 1);
            let w = |dx: isize, dy: isize| self.whites.row(dx, j as isize + dy, m + 1);
            let far = [w(-1, -1), w(0, -1), w(-1, 1), w(0, 1), e(-1, 0), e(-1, 1), e(1, 0), e(1, 1)];
            P::row([e(0, 0), e(0, 1), w(-1, 0), w(0, 0)], far, predicted, around);
        }
    }
}

/// Vertices of a row that are predicted together.
const TOGETHER: usize = 8;

/// Heights of whole numbers, and their classes.
pub(crate) struct Whole;

impl Prediction<i32> for Whole {
    type Around = u8;

    #[inline(always)]
    fn row(near: [&[i32]; 4], far: [&[i32]; 8], predicted: &mut [i32], classes: &mut [u8]) {
        let count = predicted.len();
        let mut done = 0;
        // The last ones together with some that were predicted before.
        while done < count && count >= TOGETHER {
            let from = done.min(count - TOGETHER);
            predict_some::<TOGETHER>(near, far, from, predicted, classes);
            done = from + TOGETHER;
        }
        (done..count).for_each(|from| predict_some::<1>(near, far, from, predicted, classes));
    }
}

/// Some of a row, by copies of it: then the compiler knows that what is written is none of what is read.
#[inline(always)]
fn predict_some<const N: usize>(
    near: [&[i32]; 4],
    far: [&[i32]; 8],
    from: usize,
    predicted: &mut [i32],
    classes: &mut [u8],
) {
    let copy = |row: &[i32]| {
        let mut copy = [0; N];
        copy.copy_from_slice(&row[from..from + N]);
        copy
    };
    let ([a, b, c, d], far) = (near.map(copy), far.map(copy));
    let (mut heights, mut of_classes) = ([0; N], [0; N]);
    for i in 0..N {
        let around: i32 = far.iter().map(|row| row[i]).sum();
        let corners = a[i] + b[i] + c[i] + d[i];
        heights[i] = (10 * corners - around + 16) >> 5;
        let twist = (a[i] + b[i] - c[i] - d[i]).abs();
        let curve = (2 * corners - around).abs();
        let range = a[i].max(b[i]).max(c[i].max(d[i])) - a[i].min(b[i]).min(c[i].min(d[i]));
        of_classes[i] = class_of(8 * twist + curve + 2 * range);
    }
    predicted[from..from + N].copy_from_slice(&heights);
    classes[from..from + N].copy_from_slice(&of_classes);
}

/// Half octaves of a number from 4 on, as a class.
#[inline(always)]
fn class_of(uneven: i32) -> u8 {
    // Exponent and first bit of the mantissa; whole numbers this small are exact.
    let halves = ((uneven as f32).to_bits() >> 22) as i32;
    (halves - 258).clamp(0, i32::from(HEIGHT_CLASSES) - 1) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_half_octaves() {
        for (uneven, class) in
            [(0, 0), (3, 0), (5, 0), (6, 1), (7, 1), (8, 2), (12, 3), (4096, 20), (9 << 19, 31)]
        {
            assert_eq!(class_of(uneven), class, "{uneven}");
        }
    }

    /// What a cubic surface predicts is what it is, inside, to the rounding.
    #[test]
    fn smooth_ground_is_predicted() {
        let f = |x: f64, y: f64| 900.0 + 20.0 * x - 3.0 * y + x * y - 0.5 * x * x + 0.1 * y * y * y;
        let m = 6;
        let mut lattices = Lattices::default();
        lattices.coarse.resize(m + 1, m + 1);
        for (x, y) in (0..=m as isize).flat_map(|y| (0..=m as isize).map(move |x| (x, y))) {
            lattices.coarse.set(x, y, f(x as f64, y as f64).round() as i32);
        }
        lattices.ring_coarse(m);
        let (mut predicted, mut classes) = (vec![0; m * m], vec![0; m * m]);
        lattices.predict_whites::<Whole>(m, &mut predicted, &mut classes);
        for (x, y) in (1..m - 1).flat_map(|y| (1..m - 1).map(move |x| (x, y))) {
            let exact = f(x as f64 + 0.5, y as f64 + 0.5);
            assert!((f64::from(predicted[y * m + x]) - exact).abs() < 1.3, "{x} {y}");
        }
    }
}
