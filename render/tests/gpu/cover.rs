//! No background shows through a terrain that covers the picture: not at any frame of a flight, however vertices move.

use glam::DVec3;
use terrasoar_render::{Gpu, Look, View};

use crate::support::landscape::hills;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("cover::flight_with_morph", |gpu| flight(gpu, true, 1.0)),
        ("cover::flight_without_morph", |gpu| flight(gpu, false, 1.0)),
        ("cover::flight_exaggerated", |gpu| flight(gpu, true, 2.5)),
        ("cover::flight_flattened", |gpu| flight(gpu, true, 0.4)),
        ("cover::half_empty_mesh_shows_sky", half_empty),
    ]
}

/// Downward views along a path, turning, rolling and zooming.
fn flight(gpu: &Gpu, morph: bool, exaggeration: f64) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    let look = Look::default().morph(morph);
    for frame in 0..16 {
        let t = f64::from(frame);
        let eye = DVec3::new(1600.0 + 90.0 * t, 1900.0 + 60.0 * t, 1250.0 * exaggeration + 10.0 * t);
        let ahead = DVec3::new(0.35 * (0.4 * t).sin(), 0.35 * (0.4 * t).cos(), -1.0);
        let mut view = View::look_at(eye, eye + ahead, [240, 180].into());
        view.roll_rad = 0.7 * t;
        view.vertical_fov_rad = if frame % 3 == 2 { 0.15 } else { 0.6 };
        view.vertical_exaggeration = exaggeration;
        view.tolerance_px = 3.0;
        scene.show(&square.refine(&view));
        scene.draw(&view, &look);
        let sky = scene.depth_m().iter().filter(|d| d.is_infinite()).count();
        ensure(sky == 0, || format!("{sky} background pixels in frame {frame}"))?;
    }
    Ok(())
}

/// The test above can fail: where triangles are missing there is sky.
fn half_empty(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    let eye = DVec3::new(640.0, 640.0, 1500.0);
    let view = View::look_at(eye, eye - DVec3::Z, [120, 90].into());
    let mut mesh = square.down_to(0);
    mesh.triangles.truncate(mesh.triangles.len() / 2);
    scene.show(&mesh);
    scene.draw(&view, &Look::default());
    let sky = scene.depth_m().iter().filter(|d| d.is_infinite()).count();
    ensure((3000..8000).contains(&sky), || format!("{sky} of 10800 pixels are sky"))
}
