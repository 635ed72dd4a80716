//! Tests of squares of up to 2^20 steps, larger than those that files have: the order itself has no end.

use super::*;
use crate::grid::Grid;

fn grid(k: u32) -> Grid {
    Grid { k, samples: [(1 << k) + 1; 2], spacing_m: [1.0; 2] }
}

/// Section 2 of FORMAT.md as it is written, bit by bit, in numbers of 128 bits.
fn defined_slot(k: u32, p: GridPoint) -> u128 {
    let spread = |v: u128| (0..64).map(|bit| (v >> bit & 1) << (2 * bit)).sum::<u128>();
    let (x, y) = (u128::from(p.x()), u128::from(p.y()));
    let t = (0..k).find(|t| (x | y) >> t & 1 == 1).unwrap();
    let d = k - 1 - t;
    if (x & y) >> t & 1 == 1 {
        let (cx, cy) = (x >> (t + 1), y >> (t + 1));
        return (5 * 4u128.pow(d) + 7) / 3 + 2 * spread(cy) + spread(cx ^ cy);
    }
    let (u, w) = (x >> t, y >> t);
    let (a, b) = ((u + w - 1) / 2, (w + 2u128.pow(d + 1) - u - 1) / 2);
    (8 * 4u128.pow(d) + 7) / 3 + 2 * spread(a ^ (2u128.pow(d) - 1)) + spread(a ^ b ^ 2u128.pow(d))
}

/// Places in squares of more steps than 16 bits count, where slots pass 2^41: near corners, centre and borders, and anywhere.
fn places(k: u32) -> impl Iterator<Item = GridPoint> {
    let n = 1u32 << k;
    let ends = [0, 1, 2, 3, 65_535, 65_536, 65_537, n / 2 - 1, n / 2, n / 2 + 1, n - 2, n - 1, n];
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut next = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % (u64::from(n) + 1)) as u32
    };
    // Coarse vertices are as likely as fine ones.
    let anywhere = (0..40_000u32).map(move |i| {
        let t = i % k;
        GridPoint::new(next() >> t << t, next() >> t << t)
    });
    ends.into_iter().flat_map(move |y| ends.map(|x| GridPoint::new(x, y))).chain(anywhere)
}

#[test]
fn slots_of_large_squares_are_those_of_the_definition() {
    for k in 1..=20 {
        let corners = corners(k);
        for p in places(k.max(17)).map(|p| GridPoint::new(p.x() & ((1 << k) - 1), p.y() & ((1 << k) - 1))) {
            if !corners.contains(&p) {
                assert_eq!(u128::from(slot_of(k, p)), defined_slot(k, p), "{p:?} of {k}");
            }
        }
    }
    for k in 17..=20 {
        let (corners, mut largest) = (corners(k), 0);
        for p in places(k).filter(|p| !corners.contains(p)) {
            let slot = slot_of(k, p);
            assert_eq!(u128::from(slot), defined_slot(k, p), "{p:?} of {k}");
            assert_eq!(point_of(k, slot), Some(p));
            let level = grid(k).level(p);
            let slots = level_slots(k, level);
            assert!(slots.contains(&slot), "{p:?} of {k}");
            assert_eq!(along::first_along(k, level, p), Some(slot), "{p:?} of {k}");
            let offset = slot - slots.start;
            let (t, is_white) = (level / 2, level & 1);
            let cell = BlockCells::new(k, level, offset / BLOCK_SLOTS * BLOCK_SLOTS)
                .cell((offset % BLOCK_SLOTS) as usize);
            assert_eq!(
                cell,
                ((p.y() >> (t + is_white)) as usize, (p.x() >> (t + 1)) as usize),
                "{p:?} of {k}"
            );
            largest = largest.max(slot);
        }
        assert!(largest > 1 << (2 * k), "{largest}");
    }
}

/// From the roots to the finest level, by slots alone, around places anywhere in the square.
#[test]
fn walks_down_large_squares_agree_with_the_closed_form() {
    for (k, target) in (17..=20).flat_map(|k| places(k).step_by(40).map(move |p| (k, p))) {
        let (g, c) = (grid(k), corners(k));
        let centre = GridPoint::new(1 << (k - 1), 1 << (k - 1));
        let inside = |t: [GridPoint; 3]| {
            let cross = |p: GridPoint, q: GridPoint| {
                (i64::from(q.x()) - i64::from(p.x())) * (i64::from(target.y()) - i64::from(p.y()))
                    - (i64::from(q.y()) - i64::from(p.y())) * (i64::from(target.x()) - i64::from(p.x()))
            };
            let signs = [cross(t[0], t[1]), cross(t[1], t[2]), cross(t[2], t[0])];
            signs.iter().all(|s| *s >= 0) || signs.iter().all(|s| *s <= 0)
        };
        let roots = ROOTS.map(|(split, [b, d])| ([centre, c[b], c[d]], split));
        let (mut triangle, mut split) = roots.into_iter().find(|(t, _)| inside(*t)).unwrap();
        let mut apex = CENTRE_SLOT;
        for level in (0..2 * k - 1).rev() {
            let [a, b, d] = triangle;
            let v = b.midpoint(d);
            assert_eq!((slot_of(k, v), g.level(v)), (split, level), "{v:?} of {k}");
            let next = child_slots(apex, split);
            let side = usize::from(!inside([v, b, a]));
            triangle = [[v, b, a], [v, a, d]][side];
            (apex, split) = (split, next[side]);
        }
    }
}
