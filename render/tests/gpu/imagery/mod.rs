//! The image: where it lies, what of it is there, and how it looks.

mod looks;
mod places;
mod streaming;

use glam::DVec3;
use terrasoar_render::{Haze, ImageryShape, Look, View};

use crate::Test;
use crate::support::image::{Image, give};
use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;

pub fn tests() -> Vec<(&'static str, Test)> {
    [places::tests(), streaming::tests(), looks::tests()].concat()
}

const SIZE_PX: [u32; 2] = [240, 180];

/// Level ground, 1,280 m a side.
fn level_ground() -> Square {
    Square::new(6, [0, 0], [20.0, 20.0], |_, _| 100.0)
}

/// Straight down from so many metres above the level ground.
fn down(east_m: f64, north_m: f64, above_m: f64) -> View {
    let eye = DVec3::new(east_m, north_m, 100.0 + above_m);
    View { vertical_fov_rad: 0.5, ..View::look_at(eye, eye - DVec3::Z, SIZE_PX.into()) }
}

/// The image's own colours.
fn bare() -> Look {
    Look::default().imagery(1.0).shading(0.0).haze(Haze::Off).morph(false)
}

fn show_all(scene: &mut Scene<'_>, image: &Image, view: &View) {
    while give(&mut scene.renderer, image, view, usize::MAX, |_| false) > 0 {}
}

fn pixel(picture: &Picture, x: u32, y: u32) -> [u8; 4] {
    let at = 4 * (y * picture.size_px[0] + x) as usize;
    [0, 1, 2, 3].map(|i| picture.rgba[at + i])
}

/// Fields of eight finest texels: two dark colours of a chart, brighter ones left to the picture's shoulder.
fn chart(shape: ImageryShape) -> Image {
    Image::new(shape, |level, x, y| {
        let field = 8 >> level.min(3);
        if (x / field + y / field) % 2 == 0 { [200, 60, 30, 255] } else { [20, 90, 160, 255] }
    })
}
