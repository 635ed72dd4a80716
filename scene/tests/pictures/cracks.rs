//! Where ground covers the whole picture no pixel shows what is behind it, at any frame: the mesh has no cracks.

use super::rig::{Rig, view};
use super::{Outcome, Test, ensure};
use terrasoar::ground::PictureEngine;
use terrasoar::refine::Culling;
use terrasoar::view::View;
use terrasoar_render::{Gpu, Look};

pub const TESTS: &[Test] = &[
    ("cracks::none_along_a_flight", along_a_flight),
    ("cracks::none_where_clusters_are_culled", clusters),
    ("cracks::none_with_exaggeration", exaggerated),
];

const SIZE_PX: [u32; 2] = [400, 300];
const FRAMES: u32 = 14;

/// How the mesh is made.
type Made = (PictureEngine, Culling);
const PLAIN: Made = (PictureEngine::Kinetic, Culling::Vertices);

/// A frame of a flight that descends, turns, rolls and zooms, and never sees beyond the terrain: its highest line of sight is 12 degrees down.
fn frame(i: u32) -> View {
    let t = f64::from(i) / f64::from(FRAMES - 1);
    let fov_deg = 24.0 + 22.0 * (5.0 * t).cos();
    let roll_deg = 50.0 * (3.0 * t).sin();
    let eye_km = [70.0 + 18.0 * t, 64.0 + 9.0 * t, 9.0 - 3.4 * t];
    // Half the diagonal of the picture.
    let reach_deg = (5.0 / 3.0 * (0.5 * fov_deg.to_radians()).tan()).atan().to_degrees();
    view(eye_km, [70.0 * t, -13.0 - reach_deg - 20.0 * t, roll_deg], fov_deg, SIZE_PX)
}

fn check(gpu: &Gpu, (engine, culling): Made, exaggeration: f64, tolerance_px: f64) -> Outcome {
    let mut rig = Rig::new(gpu, engine, culling, SIZE_PX);
    for i in 0..FRAMES {
        let mut view = View { tolerance_px, vertical_exaggeration: exaggeration, ..frame(i) };
        // The ground comes nearer by as much as it grows; the eye keeps its height above it.
        view.eye_m.z += 4400.0 * (exaggeration - 1.0);
        rig.ground.update(&view);
        for morph in [true, false] {
            rig.draw(&view, &Look::default().morph(morph));
            let holes = rig.depth_m().iter().filter(|d| d.is_infinite()).count();
            ensure(holes == 0, || format!("frame {i}, morph {morph}: {holes} pixels show the sky"))?;
        }
    }
    Ok(())
}

fn along_a_flight(gpu: &Gpu) -> Outcome {
    // That sky is seen where there is some.
    let level = view([80.0, 70.0, 6.0], [0.0, 0.0, 0.0], 40.0, SIZE_PX);
    let mut rig = Rig::plain(gpu, SIZE_PX);
    rig.shoot(&level, &Look::default());
    let sky = rig.depth_m().iter().filter(|d| d.is_infinite()).count();
    ensure(sky > 40_000, || format!("only {sky} pixels of sky in a level view"))?;
    check(gpu, PLAIN, 1.0, 1.0)?;
    // Large triangles move farthest.
    check(gpu, PLAIN, 1.0, 12.0)?;
    check(gpu, (PictureEngine::Soar, Culling::Vertices), 1.0, 4.0)
}

fn clusters(gpu: &Gpu) -> Outcome {
    check(gpu, (PictureEngine::Kinetic, Culling::Clusters), 1.0, 4.0)
}

fn exaggerated(gpu: &Gpu) -> Outcome {
    check(gpu, PLAIN, 2.5, 2.0)
}
