//! Numbers of tiles: a square world of Mercator's map, halved at each zoom, columns counted from the west and rows from the north.
//!
//! A place is a part of the world's side, 0 to 1 from the west and from the north. Cost: none.

use std::f64::consts::PI;
use std::fmt;
use terrasoar_layout::portable::{ln_1p, sin_cos};

/// Deepest zoom that is read: a texel is some millimetres then.
pub(super) const MAX_ZOOM: u8 = 30;
/// Half the side of the world on the map in metres: half the equator of the sphere of 6378137 m.
const HALF_WORLD_M: f64 = 6_378_137.0 * PI;
/// Parts of a texel by which bounds may miss its edge and still mean it: files round them.
const SNAP_TEXELS: f64 = 0.05;

/// A tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Tile {
    pub(super) zoom: u8,
    pub(super) x: u32,
    /// From the north.
    pub(super) y: u32,
}

impl Tile {
    /// The tile so many zooms above that holds it; `None` above the world.
    pub(super) fn above(self, levels: u8) -> Option<Self> {
        let zoom = self.zoom.checked_sub(levels)?;
        Some(Self { zoom, x: self.x >> levels, y: self.y >> levels })
    }

    /// Its row counted from the south.
    pub(super) fn row_from_south(self) -> u32 {
        last(self.zoom) - self.y
    }
}

impl fmt::Display for Tile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}/{}", self.zoom, self.x, self.y)
    }
}

/// The last column and row of a zoom.
pub(super) fn last(zoom: u8) -> u32 {
    ((1u64 << zoom.min(MAX_ZOOM)) - 1) as u32
}

/// Columns and rows of tiles, first and last of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) x: [u32; 2],
    pub(super) y: [u32; 2],
}

impl Span {
    /// That of one tile.
    pub(super) fn of(tile: Tile) -> Self {
        Self { x: [tile.x; 2], y: [tile.y; 2] }
    }

    pub(super) fn holds(&self, tile: Tile) -> bool {
        (self.x[0]..=self.x[1]).contains(&tile.x) && (self.y[0]..=self.y[1]).contains(&tile.y)
    }

    /// Columns and rows that are in both.
    pub(super) fn shared(self, other: Self) -> Option<Self> {
        let both = |a: [u32; 2], b: [u32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        let shared = Self { x: both(self.x, other.x), y: both(self.y, other.y) };
        (shared.x[0] <= shared.x[1] && shared.y[0] <= shared.y[1]).then_some(shared)
    }

    /// Columns and rows from the first to the last of both.
    pub(super) fn around(self, other: Self) -> Self {
        let all = |a: [u32; 2], b: [u32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self { x: all(self.x, other.x), y: all(self.y, other.y) }
    }

    /// The tiles of the zoom above that hold them.
    pub(super) fn above(self) -> Self {
        Self { x: self.x.map(|x| x / 2), y: self.y.map(|y| y / 2) }
    }

    pub(super) fn sides(&self) -> [u64; 2] {
        [self.x, self.y].map(|[first, last]| u64::from(last - first) + 1)
    }

    pub(super) fn count(&self) -> u64 {
        let [wide, high] = self.sides();
        wide * high
    }

    /// Tile number `i` of the span, row by row.
    pub(super) fn tile(&self, zoom: u8, i: u64) -> Tile {
        let wide = self.sides()[0];
        // Both are below the sides, which are numbers of tiles.
        Tile { zoom, x: self.x[0] + (i % wide) as u32, y: self.y[0] + (i / wide) as u32 }
    }
}

/// A rectangle of the world: west, north, east and south, as parts of its side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Area(pub(super) [f64; 4]);

impl Area {
    /// All of it.
    pub(super) const WORLD: Self = Self([0.0, 0.0, 1.0, 1.0]);

    /// Of west, south, east and north in degrees; `None` where they hold nothing.
    pub(super) fn of_degrees([west, south, east, north]: [f64; 4]) -> Option<Self> {
        let is_sound = [west, south, east, north].iter().all(|value| value.is_finite())
            && west < east
            && south < north
            && (-90.0..=90.0).contains(&south)
            && (-90.0..=90.0).contains(&north);
        let x = |degrees: f64| (degrees / 360.0 + 0.5).clamp(0.0, 1.0);
        // Half the difference of these logarithms is the inverse hyperbolic sine of the tangent.
        let y = |degrees: f64| {
            let sine = sin_cos(degrees.to_radians()).0;
            (0.5 - (ln_1p(sine) - ln_1p(-sine)) / (4.0 * PI)).clamp(0.0, 1.0)
        };
        let area = [x(west), y(north), x(east), y(south)];
        (is_sound && area[0] < area[2] && area[1] < area[3]).then_some(Self(area))
    }

    /// What is in both.
    pub(super) fn shared(self, other: Self) -> Option<Self> {
        let ([w, n, e, s], [w2, n2, e2, s2]) = (self.0, other.0);
        let both = [w.max(w2), n.max(n2), e.min(e2), s.min(s2)];
        (both[0] < both[2] && both[1] < both[3]).then_some(Self(both))
    }

    /// First texel and the one behind the last, across and down, of a zoom whose tiles have so many texels on a side.
    pub(super) fn texels(&self, zoom: u8, side: u32) -> [[u64; 2]; 2] {
        let all = (1u64 << zoom) * u64::from(side);
        let span = |low: f64, high: f64| {
            let first = (low * all as f64 + SNAP_TEXELS).floor().max(0.0) as u64;
            let end = ((high * all as f64 - SNAP_TEXELS).ceil().max(0.0) as u64).min(all);
            let first = first.min(all - 1);
            [first, end.max(first + 1)]
        };
        [span(self.0[0], self.0[2]), span(self.0[1], self.0[3])]
    }

    /// The tiles of a zoom that it touches.
    pub(super) fn tiles(&self, zoom: u8) -> Span {
        const SIDE: u32 = 256;
        let [x, y] = self.texels(zoom, SIDE).map(|[first, end]| {
            [first / u64::from(SIDE), (end - 1) / u64::from(SIDE)].map(|tile| tile as u32)
        });
        Span { x, y }
    }
}

/// The map from centres of texels to coordinates of EPSG:3857, of the texels from (column, row) `first` on.
pub(super) fn place(zoom: u8, side: u32, first: [u64; 2]) -> [f64; 6] {
    let step = 2.0 * HALF_WORLD_M / ((1u64 << zoom) as f64 * f64::from(side));
    let [x, y] = first.map(|texel| (texel as f64 + 0.5) * step);
    [x - HALF_WORLD_M, step, 0.0, HALF_WORLD_M - y, 0.0, -step]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_become_texels_and_tiles() {
        let quarter = Area::of_degrees([-180.0, 0.0, 0.0, 85.051_128_779_806_6]).unwrap();
        assert_eq!(quarter.tiles(1), Span { x: [0, 0], y: [0, 0] });
        assert_eq!(quarter.tiles(3), Span { x: [0, 3], y: [0, 3] });
        assert_eq!(quarter.texels(3, 512), [[0, 2048], [0, 2048]]);
        // Rounded to seven digits, as PMTiles do, bounds still mean the edges.
        let near = Area::of_degrees([0.000_000_04, -45.0, 90.000_000_04, 0.000_000_02]).unwrap();
        assert_eq!(near.tiles(10).x, [512, 767]);
        assert_eq!(near.tiles(10).y[0], 512);
        assert_eq!(Area::WORLD.tiles(30).count(), 1 << 60);
        for wrong in [[1.0, 0.0, 0.0, 1.0], [0.0, 5.0, 1.0, 5.0], [0.0, 0.0, f64::NAN, 1.0]] {
            assert_eq!(Area::of_degrees(wrong), None);
        }
    }

    #[test]
    fn texels_lie_on_the_map_as_areas() {
        // One tile of 256 is the world: its first texel's centre is half a step from the corner.
        let m = place(0, 256, [0, 0]);
        assert!((m[1] - 156_543.033_928_040_97).abs() < 1e-6);
        assert!((m[0] + 20_037_508.342_789_244 - m[1] / 2.0).abs() < 1e-6 && m[3] == -m[0]);
        assert!((place(1, 256, [256, 0])[0] - m[1] / 4.0).abs() < 1e-6);
    }
}
