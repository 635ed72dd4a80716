//! Which tiles a view asks for: those whose cells are about a pixel, and all coarser ones above them.
//!
//! The level a point needs depends on its place and the eye only ([`needed_level`]), not on the mesh, so shading
//! does not change when triangles do. The shader computes the same function; here it is bounded over boxes as high as the terrain. Cost: the
//! wanted tiles and their children, each a box test.

use glam::DVec3;

use super::Pyramid;
use crate::view::TerrainShape;
use terrasoar::view::View;
use terrasoar_layout::imagery::TileId;

/// The flattest line of sight for which level ground still gets finer tiles along the line; the shader says the same.
const FLATTEST: f64 = 0.15;

/// Where the cells of a pyramid lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Raster {
    /// South-west corner of the first cell, metres.
    pub origin_m: [f64; 2],
    /// Metres a cell.
    pub cell_m: [f64; 2],
    /// Cells east and north.
    pub cells: [u32; 2],
    /// Lowest and highest ground, before exaggeration.
    pub height_range_m: [f64; 2],
    /// Below this steepness of the line of sight the level rises no more; 1 where foreshortening is left to the filter.
    pub flattest: f64,
}

impl From<&TerrainShape> for Raster {
    fn from(terrain: &TerrainShape) -> Self {
        Self {
            origin_m: [0.0; 2],
            cell_m: terrain.spacing_m,
            cells: terrain.samples.map(|n| n - 1),
            height_range_m: terrain.height_range_m,
            flattest: FLATTEST,
        }
    }
}

/// Level at which a cell covers about a pixel, as a real number, negative where samples are larger than pixels.
///
/// `pixels_per_radian / distance` pixels see a metre across; along the line of sight a metre of level ground is
/// foreshortened by `steepness` (height over distance), and the level follows the geometric mean of both.
pub(crate) fn needed_level(distance_m: f64, steepness: f64, raster: &Raster, pixels_per_radian: f64) -> f64 {
    let cell_m = (raster.cell_m[0] * raster.cell_m[1]).sqrt();
    let cells_across = distance_m / (pixels_per_radian * cell_m);
    (cells_across / steepness.clamp(raster.flattest, 1.0).sqrt()).max(1e-9).log2()
}

/// Finds the wanted tiles of a view; keeps its arrays from frame to frame.
#[derive(Debug, Clone, Default)]
pub(crate) struct WantedTiles {
    found: Vec<(TileId, f64)>,
    tiles: Vec<TileId>,
}

impl WantedTiles {
    /// The tiles of slopes that `view` wants, coarse before fine and near before far.
    pub fn find(&mut self, pyramid: &Pyramid, terrain: &TerrainShape, view: &View) -> &[TileId] {
        self.find_on(pyramid, &terrain.into(), view, |_| true)
    }

    /// What was found last.
    pub(crate) fn last(&self) -> &[TileId] {
        &self.tiles
    }

    /// The same for any pyramid, without tiles that do not exist and what is below them.
    pub(crate) fn find_on(
        &mut self,
        pyramid: &Pyramid,
        raster: &Raster,
        view: &View,
        exists: impl Fn(TileId) -> bool,
    ) -> &[TileId] {
        self.found.clear();
        let search = Search {
            pyramid,
            raster,
            view,
            side_normals: view.side_normals(),
            pixels_per_radian: view.pixels_per_radian(),
            exists,
        };
        for root in pyramid.roots() {
            search.visit(&mut self.found, root);
        }
        self.found.sort_unstable_by(|(a, near), (b, far)| {
            b.level.cmp(&a.level).then(near.total_cmp(far)).then(a.cmp(b))
        });
        self.tiles.clear();
        self.tiles.extend(self.found.iter().map(|(tile, _)| *tile));
        &self.tiles
    }
}

/// What every step of the descent asks.
struct Search<'a, E> {
    pyramid: &'a Pyramid,
    raster: &'a Raster,
    view: &'a View,
    side_normals: [DVec3; 4],
    pixels_per_radian: f64,
    exists: E,
}

impl<E: Fn(TileId) -> bool> Search<'_, E> {
    fn visit(&self, found: &mut Vec<(TileId, f64)>, tile: TileId) {
        let (low, high) = self.bounds_m(tile);
        let eye = self.view.eye_m;
        let culled = self.side_normals.iter().any(|n| {
            let nearest = DVec3::select(n.cmplt(DVec3::ZERO), high, low);
            n.dot(nearest - eye) > 0.0
        });
        // The coarsest level is always wanted: what turns into view must not wait for it.
        if culled && tile.level + 1 < self.pyramid.levels() || !(self.exists)(tile) {
            return;
        }
        let distance_m = (eye.clamp(low, high) - eye).length();
        found.push((tile, distance_m));
        let height_m = (eye.z - low.z).abs().max((eye.z - high.z).abs());
        let steepness = height_m / distance_m.max(1e-9);
        let needed = needed_level(distance_m, steepness, self.raster, self.pixels_per_radian);
        if !culled && needed < f64::from(tile.level) {
            for child in self.pyramid.children(tile) {
                self.visit(found, child);
            }
        }
    }

    /// The box around a tile's surface.
    fn bounds_m(&self, tile: TileId) -> (DVec3, DVec3) {
        let raster = self.raster;
        let [south_west, north_east] = self.pyramid.corners(tile).map(|cells| {
            [0, 1].map(|i| {
                raster.origin_m[i] + cells[i].min(u64::from(raster.cells[i])) as f64 * raster.cell_m[i]
            })
        });
        let [bottom, top] = raster.height_range_m.map(|h| h * self.view.vertical_exaggeration);
        (DVec3::new(south_west[0], south_west[1], bottom), DVec3::new(north_east[0], north_east[1], top))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiles::TILE_CELLS;

    const TERRAIN: TerrainShape =
        TerrainShape { spacing_m: [30.0, 30.0], samples: [8193, 8193], height_range_m: [0.0, 1500.0] };

    #[test]
    fn coarse_first_parents_always_and_fine_only_near() {
        let pyramid = Pyramid::over(TERRAIN.samples);
        let eye = DVec3::new(100_000.0, 100_000.0, 2500.0);
        let view = View::look_at(eye, eye + DVec3::new(1000.0, 3000.0, -900.0), [800, 600].into());
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
        let view = View::look_at(eye, eye + DVec3::new(3000.0, 1000.0, -700.0), [640, 480].into());
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
            let level = needed_level(distance, steep, &(&TERRAIN).into(), view.pixels_per_radian())
                .floor()
                .max(0.0) as u32;
            let level = level.min(pyramid.levels() - 1);
            let [x, y] = [at.x, at.y].map(|m| (m / 30.0) as u32 >> level >> TILE_CELLS.ilog2());
            let tile = TileId { level, x, y };
            assert!(tiles.contains(&tile), "{tile} for a point {distance} m away");
        }
    }
}
