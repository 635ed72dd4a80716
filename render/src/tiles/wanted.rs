//! Which tiles a view asks for: those whose cells are about a pixel, and all coarser ones above them.
//!
//! The level a point needs depends on its place and the eye only ([`needed_level`]), not on the mesh, so shading
//! does not change when triangles do. The shader computes the same function; here it is bounded over boxes. Cost: the wanted tiles and their children, each a box test.

use glam::DVec3;

use super::{Pyramid, TILE_CELLS, TileId};
use crate::view::{FrameView, TerrainShape};

/// The flattest line of sight for which level ground still gets finer tiles along the line; the shader says the same.
const FLATTEST: f64 = 0.15;

/// Level at which a cell covers about a pixel, as a real number, negative where samples are larger than pixels.
///
/// `pixels_per_radian / distance` pixels see a metre across; along the line of sight a metre of level ground is
/// foreshortened by `steepness` (height over distance), and the level follows the geometric mean of both.
pub(crate) fn needed_level(distance_m: f64, steepness: f64, spacing_m: f64, pixels_per_radian: f64) -> f64 {
    let samples_across = distance_m / (pixels_per_radian * spacing_m);
    (samples_across / steepness.clamp(FLATTEST, 1.0).sqrt()).max(1e-9).log2()
}

/// Finds the wanted tiles of a view; keeps its arrays from frame to frame.
#[derive(Debug, Clone, Default)]
pub struct WantedTiles {
    found: Vec<(TileId, f64)>,
    tiles: Vec<TileId>,
}

impl WantedTiles {
    /// The tiles that `view` wants, coarse before fine and near before far.
    pub fn find(&mut self, pyramid: &Pyramid, terrain: &TerrainShape, view: &FrameView) -> &[TileId] {
        self.found.clear();
        let search = Search {
            pyramid,
            terrain,
            view,
            side_normals: view.side_normals(),
            spacing_m: (terrain.spacing_m[0] * terrain.spacing_m[1]).sqrt(),
            pixels_per_radian: view.pixels_per_radian(),
        };
        search.visit(&mut self.found, pyramid.root());
        self.found
            .sort_by(|(a, near), (b, far)| b.level.cmp(&a.level).then(near.total_cmp(far)).then(a.cmp(b)));
        self.tiles.clear();
        self.tiles.extend(self.found.iter().map(|(tile, _)| *tile));
        &self.tiles
    }
}

/// What every step of the descent asks.
struct Search<'a> {
    pyramid: &'a Pyramid,
    terrain: &'a TerrainShape,
    view: &'a FrameView,
    side_normals: [DVec3; 4],
    spacing_m: f64,
    pixels_per_radian: f64,
}

impl Search<'_> {
    fn visit(&self, found: &mut Vec<(TileId, f64)>, tile: TileId) {
        let (low, high) = bounds_m(self.terrain, self.view.vertical_exaggeration, tile);
        let eye = self.view.eye_m;
        let culled = self.side_normals.iter().any(|n| {
            let nearest = DVec3::select(n.cmplt(DVec3::ZERO), high, low);
            n.dot(nearest - eye) > 0.0
        });
        // The root is always wanted: what turns into view must not wait for it.
        if culled && tile != self.pyramid.root() {
            return;
        }
        let distance_m = (eye.clamp(low, high) - eye).length();
        found.push((tile, distance_m));
        let height_m = (eye.z - low.z).abs().max((eye.z - high.z).abs());
        let steepness = height_m / distance_m.max(1e-9);
        let needed = needed_level(distance_m, steepness, self.spacing_m, self.pixels_per_radian);
        if !culled && needed < f64::from(tile.level) {
            for child in self.pyramid.children(tile) {
                self.visit(found, child);
            }
        }
    }
}

/// The box around a tile's surface.
fn bounds_m(terrain: &TerrainShape, exaggeration: f64, tile: TileId) -> (DVec3, DVec3) {
    let first = tile.first_sample();
    let side = TILE_CELLS << tile.level;
    let corner = |i: usize, sample: u32| f64::from(sample.min(terrain.samples[i] - 1)) * terrain.spacing_m[i];
    let [bottom, top] = terrain.height_range_m.map(|h| h * exaggeration);
    (
        DVec3::new(corner(0, first[0]), corner(1, first[1]), bottom),
        DVec3::new(corner(0, first[0].saturating_add(side)), corner(1, first[1].saturating_add(side)), top),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERRAIN: TerrainShape =
        TerrainShape { spacing_m: [30.0, 30.0], samples: [8193, 8193], height_range_m: [0.0, 1500.0] };

    #[test]
    fn coarse_first_parents_always_and_fine_only_near() {
        let pyramid = Pyramid::over(TERRAIN.samples);
        let eye = DVec3::new(100_000.0, 100_000.0, 2500.0);
        let view = FrameView::look_at(eye, eye + DVec3::new(1000.0, 3000.0, -900.0), [800, 600]);
        let mut wanted = WantedTiles::default();
        let tiles = wanted.find(&pyramid, &TERRAIN, &view).to_vec();
        assert_eq!(tiles[0], pyramid.root());
        assert!(tiles.is_sorted_by(|a, b| a.level >= b.level));
        for tile in &tiles[1..] {
            assert!(tiles.contains(&tile.parent()), "a tile's parent is wanted too");
        }
        assert!(tiles.iter().any(|t| t.level == 0));
        assert!(tiles.len() < 600, "{} tiles", tiles.len());
    }

    #[test]
    fn a_point_has_the_tile_that_it_needs() {
        let pyramid = Pyramid::over(TERRAIN.samples);
        let eye = DVec3::new(50_000.0, 60_000.0, 3000.0);
        let view = FrameView::look_at(eye, eye + DVec3::new(3000.0, 1000.0, -700.0), [640, 480]);
        let tiles = WantedTiles::default().find(&pyramid, &TERRAIN, &view).to_vec();
        for i in 0..2000_u32 {
            let at = DVec3::new(
                f64::from(i * 7919 % 8192) * 30.0,
                f64::from(i * 104_729 % 8192) * 30.0,
                f64::from(i % 1500),
            );
            if view.side_normals().iter().any(|n| n.dot(at - view.eye_m) > 0.0) {
                continue;
            }
            let distance = at.distance(view.eye_m);
            let steep = (at.z - view.eye_m.z).abs() / distance;
            let level = needed_level(distance, steep, 30.0, view.pixels_per_radian()).floor().max(0.0) as u32;
            let level = level.min(pyramid.levels() - 1);
            let [x, y] = [at.x, at.y].map(|m| (m / 30.0) as u32 >> level >> TILE_CELLS.ilog2());
            let tile = TileId { level, x, y };
            assert!(tiles.contains(&tile), "{tile} for a point {distance} m away");
        }
    }
}
