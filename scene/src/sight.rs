//! Where an eye that keeps its way will be, and a terrain's shape in the renderer's terms.

use std::f64::consts::FRAC_PI_2;
use terrasoar::view::View;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::TerrainShape;

/// Frames ahead of the eye that tiles of the image are asked for.
const FRAMES_AHEAD: f64 = 24.0;

/// Where a steady eye will be in some frames.
pub(super) fn ahead(before: &View, now: &View) -> View {
    let turned = |before: f64, now: f64| now + FRAMES_AHEAD * (now - before).sin();
    View {
        eye_m: now.eye_m + FRAMES_AHEAD * (now.eye_m - before.eye_m),
        yaw_rad: turned(before.yaw_rad, now.yaw_rad),
        pitch_rad: turned(before.pitch_rad, now.pitch_rad).clamp(-FRAC_PI_2, FRAC_PI_2),
        ..*now
    }
}

/// What the renderer needs to know of a terrain.
pub fn shape(terrain: &Terrain) -> TerrainShape {
    let grid = terrain.grid();
    TerrainShape {
        spacing_m: grid.spacing_m(),
        samples: grid.samples(),
        height_range_m: terrain.header().height_range_m,
    }
}
