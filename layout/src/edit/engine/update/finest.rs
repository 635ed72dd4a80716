//! The finest levels: all that their vertices look at lies side by side in [`Near`](crate::edit::engine::near::Near).
//!
//! A vertex is done here if its diamond lies in the data's interior, so that neither padding nor the square's border has a say, and if it is plain. The error of those above the
//! finest two levels comes from all samples of the two triangles, as in a build. The triangles are mirror images, so samples are taken two at a time, one of each.
//!
//! Voids need no question: their codes are not numbers, so no distance of theirs is larger than another, and none from a plane through one of them.

use super::Update;
use crate::bound::{Below, FIRST_SCANNED, Rules, larger};
use crate::file::header::ErrorKind;
use crate::grid::GridPoint;
use crate::grid::record::{RecordCodec, VertexClass};

/// What the vertices of one of the finest levels have in common.
struct Finest {
    /// Square metres over the ground to the children, in the order of [`children`].
    ground2: [f64; 4],
    is_scanned: bool,
}

impl<C: RecordCodec> Update<'_, C> {
    fn finest<const LEVEL: u32>(&self) -> Finest {
        let step = 1u32 << (LEVEL / 2);
        let is_white = LEVEL & 1 == 1;
        let [dx, dy] = self.rules.grid.spacing_m();
        let [e, n] = [dx, dy].map(|d| d * f64::from(if is_white { step } else { step / 2 }));
        let [beside, across] = if is_white { [e * e, n * n] } else { [e * e + n * n; 2] };
        Finest {
            ground2: [beside, beside, across, across],
            is_scanned: LEVEL >= FIRST_SCANNED && self.rules.error_kind == ErrorKind::Bounded,
        }
    }

    /// Makes the records of a row's vertices from column `first` to `last` anew.
    #[inline(always)]
    pub(super) fn renew_row<const LEVEL: u32>(&mut self, y: u32, first: u32, last: u32) {
        let s = 1u32 << (LEVEL / 2);
        let of = &self.finest::<LEVEL>();
        let [wide, high] = self.rules.grid.samples();
        let is_inside = y >= s && y + s < high;
        let mut x = first;
        while x <= last {
            let is_done = is_inside && x >= s && x + s < wide && self.renew_near::<LEVEL>(x, y, of);
            if !is_done {
                self.renew(GridPoint::new(x, y), LEVEL);
            }
            x += 2 * s;
        }
    }

    /// Makes the record of a vertex in the data's interior anew, if it is plain; else returns false.
    #[inline(always)]
    fn renew_near<const LEVEL: u32>(&mut self, x: u32, y: u32, of: &Finest) -> bool {
        let (rules, near) = (self.rules, &self.scratch.near);
        let s = 1usize << (LEVEL / 2);
        let (at, row) = (near.index(x, y), near.row_length());
        let old = near.raw(at);
        if !C::is_plain(old) && rules.codec.decode(old, LEVEL).class != VertexClass::Plain {
            return false;
        }
        let code = near.value(at);
        let mut below = Below::default();
        if LEVEL > 0 {
            let [a, b, c, d] = children::<LEVEL>(at, row);
            let [a, b, c, d] = [near.raw(a), near.raw(b), near.raw(c), near.raw(d)];
            let height_m = code * rules.scale.height_step_m;
            below = if C::is_plain(a) & C::is_plain(b) & C::is_plain(c) & C::is_plain(d) {
                // Not by a function of arrays: those are not always compiled into what calls them.
                let [a, b] = [rules.codec.decode(a, LEVEL - 1), rules.codec.decode(b, LEVEL - 1)];
                let [c, d] = [rules.codec.decode(c, LEVEL - 1), rules.codec.decode(d, LEVEL - 1)];
                Below::of_plain(&[a, b, c, d], &of.ground2, height_m, rules.scale.height_base_m)
            } else {
                below_any(rules, LEVEL, [a, b, c, d], &of.ground2, height_m)
            };
        }
        let own_m = if of.is_scanned {
            f64::from(rules.scanned_error_m(farthest::<LEVEL>(near.samples(), at, row, [x, y])))
        } else {
            let apart = match Edge::of::<LEVEL>([x, y]) {
                Edge::Upright => s * row,
                Edge::Level => s,
                Edge::Rising => s * row + s,
                Edge::Falling => s * row - s,
            };
            rules.step_error_m(code, [near.value(at - apart), near.value(at + apart)])
        };
        let slot = near.slot(at);
        let new = rules.encode_plain(LEVEL, code, own_m, &below);
        if new == Some(old) {
            return true;
        }
        let v = GridPoint::new(x, y);
        let Some(new) = new else {
            self.fail(v);
            return true;
        };
        self.ground.pages.write(v, slot, old, new);
        self.scratch.near.set_raw(at, new);
        self.scratch.here.push((v, old));
        true
    }
}

/// What children add up to of which one is perhaps not plain.
#[inline(never)]
fn below_any<C: RecordCodec>(
    rules: &Rules<C>,
    level: u32,
    raws: [C::Raw; 4],
    ground2: &[f64; 4],
    height_m: f64,
) -> Below {
    let children = raws.map(|raw| rules.codec.decode(raw, level - 1));
    Below::of(&children, ground2, height_m, rules.scale.height_base_m)
}

/// Indices of the children of the vertex at index `at`, in rows of `row`: first those whose distance is the one along the row, for white vertices.
#[inline(always)]
fn children<const LEVEL: u32>(at: usize, row: usize) -> [usize; 4] {
    let s = 1usize << (LEVEL / 2);
    if LEVEL & 1 == 1 {
        [at + s, at - s, at + s * row, at - s * row]
    } else {
        let h = s / 2;
        let (south, north) = (at - h * row, at + h * row);
        [south - h, south + h, north - h, north + h]
    }
}

/// How the edge runs that a vertex splits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Edge {
    Upright,
    Level,
    Rising,
    Falling,
}

impl Edge {
    /// See [`Grid::edge_ends`](crate::grid::Grid::edge_ends).
    #[inline(always)]
    fn of<const LEVEL: u32>([x, y]: [u32; 2]) -> Self {
        let (column, row) = (x >> (LEVEL / 2), y >> (LEVEL / 2));
        match (LEVEL & 1 == 1, row & 1 == 1) {
            (false, true) => Self::Upright,
            (false, false) => Self::Level,
            (true, _) if (column ^ row) & 2 == 0 => Self::Rising,
            (true, _) => Self::Falling,
        }
    }
}

/// Codes by which the farthest sample is off the triangles of the vertex at column and row `v`, which has index `at` in rows of `row`.
#[inline(always)]
fn farthest<const LEVEL: u32>(samples: &[f64], at: usize, row: usize, v: [u32; 2]) -> f64 {
    let s = 1usize << (LEVEL / 2);
    match Edge::of::<LEVEL>(v) {
        Edge::Upright => farthest_upright(samples, at, row, s),
        Edge::Level => farthest_level(samples, at, row, s),
        Edge::Rising => farthest_rising(samples, at, row, s),
        Edge::Falling => farthest_falling(samples, at, row, s),
    }
}

/// Distances of two samples, each from its own plane, and the larger of each and of those before.
#[inline(always)]
fn both(best: &mut [f64; 2], values: [f64; 2], base: [f64; 2], rise: [f64; 2]) {
    for i in 0..2 {
        best[i] = larger(best[i], (values[i] - (base[i] + rise[i])).abs());
    }
}

/// For the vertex at index `at` of an edge of length 2 `s` that runs north; the triangles lie to the west and the east. The planes are those of [`Plane`](crate::bound::Plane), by the same operations.
#[inline(always)]
fn farthest_upright(samples: &[f64], at: usize, row: usize, s: usize) -> f64 {
    let per = 1.0 / s as f64;
    let [b, d] = [samples[at - s * row], samples[at + s * row]];
    let apexes = [samples[at - s], samples[at + s]];
    let middle = 0.5 * (b + d);
    let up = (d - b) * (0.5 * per);
    // Away from the edge on both sides.
    let out = [(apexes[0] - middle) * per, (apexes[1] - middle) * per];
    let mut best = [0.0; 2];
    for j in 0..2 * s - 1 {
        let dy = j as f64 - (s - 1) as f64;
        let base = [middle + up * dy; 2];
        let reach = s - 1 - j.abs_diff(s - 1);
        let centre = at + (j + 1) * row - s * row;
        let line = &samples[centre - (s - 1)..centre + s];
        for i in 0..=reach {
            let values = [line[s - 1 - i], line[s - 1 + i]];
            both(&mut best, values, base, [out[0] * i as f64, out[1] * i as f64]);
        }
    }
    larger(best[0], best[1])
}

/// For the vertex at index `at` of an edge of length 2 `s` that runs east; the triangles lie to the south and the north.
#[inline(always)]
fn farthest_level(samples: &[f64], at: usize, row: usize, s: usize) -> f64 {
    let per = 1.0 / s as f64;
    let [b, d] = [samples[at - s], samples[at + s]];
    let apexes = [samples[at - s * row], samples[at + s * row]];
    let middle = 0.5 * (b + d);
    let along = (d - b) * (0.5 * per);
    let out = [(apexes[0] - middle) * per, (apexes[1] - middle) * per];
    let mut best = [0.0; 2];
    for j in 0..s {
        let base = [middle + out[0] * j as f64, middle + out[1] * j as f64];
        let reach = s - 1 - j;
        let line = |centre: usize| &samples[centre - (s - 1)..centre + s];
        let lines = [line(at - j * row), line(at + j * row)];
        for i in 0..=2 * reach {
            let rise = along * (i as f64 - reach as f64);
            both(&mut best, [lines[0][j + i], lines[1][j + i]], base, [rise; 2]);
        }
    }
    larger(best[0], best[1])
}

/// For the centre at index `at` of a square of side 2 `s` whose diagonal rises from south-west to north-east.
#[inline(always)]
fn farthest_rising(samples: &[f64], at: usize, row: usize, s: usize) -> f64 {
    let [b, d] = [samples[at - s * row - s], samples[at + s * row + s]];
    let [south_east, north_west] = [samples[at - s * row + s], samples[at + s * row - s]];
    let per = 0.5 / s as f64;
    let east = [(south_east - b) * per, (d - north_west) * per];
    let north = [(d - south_east) * per, (north_west - b) * per];
    farthest_halves(samples, at, row, s, 0.5 * (b + d), east, north, |j| j)
}

/// For the centre at index `at` of a square of side 2 `s` whose diagonal falls from north-west to south-east.
#[inline(always)]
fn farthest_falling(samples: &[f64], at: usize, row: usize, s: usize) -> f64 {
    let [b, d] = [samples[at - s * row + s], samples[at + s * row - s]];
    let [south_west, north_east] = [samples[at - s * row - s], samples[at + s * row + s]];
    let per = 0.5 / s as f64;
    let east = [(north_east - d) * per, (b - south_west) * per];
    let north = [(north_east - b) * per, (d - south_west) * per];
    farthest_halves(samples, at, row, s, 0.5 * (b + d), east, north, |j| 2 * (s - 1) - j)
}

/// For the halves of a square around index `at`: the one that holds its east side, in row `j` from column `first(j)` on, both counted from the square's inner corner, and its image about the centre. Planes rise by
/// `east` and `north` a step from `middle`.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "two planes over a square")]
fn farthest_halves(
    samples: &[f64],
    at: usize,
    row: usize,
    s: usize,
    middle: f64,
    east: [f64; 2],
    north: [f64; 2],
    first: impl Fn(usize) -> usize,
) -> f64 {
    let mut best = [0.0; 2];
    for j in 0..2 * s - 1 {
        let dy = j as f64 - (s - 1) as f64;
        let base = [middle + north[0] * dy, middle + north[1] * -dy];
        let line = |centre: usize| &samples[centre - (s - 1)..centre + s];
        let lines = [line(at + (j + 1) * row - s * row), line(at + (s - 1) * row - j * row)];
        for i in first(j)..2 * s - 1 {
            let dx = i as f64 - (s - 1) as f64;
            both(&mut best, [lines[0][i], lines[1][2 * (s - 1) - i]], base, [east[0] * dx, east[1] * -dx]);
        }
    }
    larger(best[0], best[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bound::{
        Plane, Samples, farthest_diagonal as diagonal, farthest_level as level, farthest_upright as upright,
    };
    use proptest::prelude::*;

    /// Samples a side.
    const SIDE: u32 = 33;

    struct Window(Vec<f64>);

    impl Samples for Window {
        fn corner(&self, x: u32, y: u32) -> (GridPoint, f64) {
            (GridPoint::new(x, y), self.0[(y * SIDE + x) as usize])
        }

        fn row(&self, plane: &Plane, from: u32, to: u32, y: u32) -> f64 {
            plane.farthest_in_row(from, y, &self.0[(y * SIDE + from) as usize..=(y * SIDE + to) as usize])
        }
    }

    /// All vertices of a level in the window's interior against a build's way.
    fn check<const LEVEL: u32>(window: &Window) {
        let s = 1u32 << (LEVEL / 2);
        let odd = |v: u32| (v / s) % 2 == 1;
        for y in (s..SIDE - s).step_by(s as usize) {
            for x in (s..SIDE - s).step_by(s as usize) {
                let is_of_level = if LEVEL % 2 == 1 { odd(x) && odd(y) } else { odd(x) != odd(y) };
                if !is_of_level {
                    continue;
                }
                let edge = Edge::of::<LEVEL>([x, y]);
                let built = match edge {
                    Edge::Upright => upright(window, x, y, s),
                    Edge::Level => level(window, x, y, s),
                    edge => diagonal(window, x, y, s, edge == Edge::Rising),
                };
                let found = farthest::<LEVEL>(&window.0, (y * SIDE + x) as usize, SIDE as usize, [x, y]);
                assert_eq!(found.to_bits(), built.to_bits(), "level {LEVEL}, {edge:?} at ({x}, {y})");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn errors_of_fine_levels_are_those_of_a_build(
            codes in prop::collection::vec(prop_oneof![8 => 0.0..65535.0f64, 1 => Just(f64::NAN)], (SIDE * SIDE) as usize),
            is_whole: bool,
        ) {
            let window = Window(if is_whole { codes.iter().map(|code| code.round_ties_even()).collect() } else { codes });
            check::<2>(&window);
            check::<3>(&window);
            check::<4>(&window);
            check::<5>(&window);
            check::<6>(&window);
            check::<7>(&window);
        }
    }
}
