//! One triangle strip through a conforming mesh, a vertex at a time.
//!
//! Based on: P. Lindstrom, V. Pascucci, "Visualization of Large Terrains Made Easy", IEEE Visualization 2001: vertices alternate in the parity of
//! their level; where two of the same parity meet, the second-last vertex again turns the strip.
//!
//! Invariant: the strip is the first `len` places of its room, which keeps its size from frame to frame. So appending checks the room once and then only
//! writes.

use terrasoar_layout::grid::GridPoint;

/// Places that a room has at the least.
const LEAST_ROOM: usize = 4096;

/// A strip, of whatever stands for a vertex, and room for the next one.
#[derive(Debug, Default)]
pub(super) struct Strip<T> {
    room: Vec<T>,
    len: usize,
}

impl<T: Copy + Default> Strip<T> {
    /// An empty strip whose room is what `room` has.
    pub(super) fn in_room(room: Vec<T>) -> Self {
        Self { room, len: 0 }
    }

    /// The strip as a list of its own length.
    pub(super) fn into_vec(mut self) -> Vec<T> {
        self.room.truncate(self.len);
        self.room
    }

    /// The strip.
    pub(super) fn as_slice(&self) -> &[T] {
        &self.room[..self.len]
    }

    /// Starts over with the vertex `first`, at `at`, twice. The room goes with the builder until [`StripBuilder::finish`] brings it back.
    pub(super) fn start(&mut self, at: GridPoint, first: T) -> StripBuilder<T> {
        self.len = 0;
        let mut room = std::mem::take(&mut self.room);
        if room.len() < LEAST_ROOM {
            room.resize(LEAST_ROOM, first);
        }
        room[..2].fill(first);
        StripBuilder { room, end: 0, last: [at; 2], parity: 1 }
    }
}

/// A strip under construction.
#[derive(Debug)]
pub(super) struct StripBuilder<T> {
    room: Vec<T>,
    /// Place of the last vertex but one: the strip has two vertices more.
    end: usize,
    /// The last vertex but one and the last.
    last: [GridPoint; 2],
    parity: u32,
}

impl<T: Copy + Default> StripBuilder<T> {
    /// Continues to the vertex at `at`, unless it is one of the last two.
    #[inline(always)]
    pub(super) fn append(&mut self, at: GridPoint, parity: u32, vertex: T) {
        if at == self.last[0] || at == self.last[1] {
            return;
        }
        let Some(places) = self.room.get_mut(self.end..).and_then(|places| places.first_chunk_mut::<4>())
        else {
            self.make_room();
            return self.append_in_new_room(at, parity, vertex);
        };
        if parity == self.parity {
            places[2] = places[0];
            places[3] = vertex;
            self.end += 2;
        } else {
            places[2] = vertex;
            self.end += 1;
            self.last[0] = self.last[1];
        }
        self.last[1] = at;
        self.parity = parity;
    }

    /// Ends the strip with `vertex`, wherever it lies, and gives it to `strip`.
    pub(super) fn finish(mut self, vertex: T, strip: &mut Strip<T>) {
        let len = self.end + 2;
        if len == self.room.len() {
            self.make_room();
        }
        self.room[len] = vertex;
        *strip = Strip { room: self.room, len: len + 1 };
    }

    #[cold]
    #[inline(never)]
    fn append_in_new_room(&mut self, at: GridPoint, parity: u32, vertex: T) {
        self.append(at, parity, vertex);
    }

    #[cold]
    #[inline(never)]
    fn make_room(&mut self) {
        let places = 2 * self.room.len();
        self.room.resize(places, T::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the definition, on vertices of any order, over strips longer than the first room.
    #[test]
    fn a_strip_is_what_the_paper_says() {
        let mut random = 12345u32;
        let mut next = |below: u32| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 16) % below
        };
        let mut strip = Strip::default();
        for _ in 0..3 {
            let mut plain = vec![0u32, 0];
            let mut last_parity = 1;
            let mut builder = strip.start(GridPoint::new(0, 0), 0);
            for _ in 0..6000 {
                let (id, parity) = (next(7), next(2));
                builder.append(GridPoint::new(id, 0), parity, id);
                if plain[plain.len() - 2..].contains(&id) {
                    continue;
                }
                if parity == last_parity {
                    plain.push(plain[plain.len() - 2]);
                }
                plain.push(id);
                last_parity = parity;
            }
            builder.finish(9, &mut strip);
            plain.push(9);
            assert_eq!(strip.as_slice(), plain);
        }
    }
}
