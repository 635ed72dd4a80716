//! Kept pictures, one a look and some of what else is to be seen.

use glam::DVec3;
use terrasoar_render::{Contours, Gpu, LOOKS, Look, Sun, View, ramps::RAMPS};

use crate::Outcome;
use crate::support::image::{Image, drape, give};
use crate::support::landscape::hills;
use crate::support::picture::check_snapshot;
use crate::support::refiner::Square;
use crate::support::scene::Scene;

const SIZE_PX: [u32; 2] = [160, 120];

pub fn names() -> impl Iterator<Item = String> {
    let looks = LOOKS.iter().map(|(name, _)| format!("look-{name}"));
    let ramps = RAMPS.iter().map(|ramp| format!("ramp-{}", ramp.name));
    let more =
        ["sunset", "mesh-normals", "walls", "roll", "smooth-edges", "chart", "photo-map"].map(str::to_owned);
    looks.chain(ramps).chain(more)
}

pub fn check(gpu: &Gpu, name: &str) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let eye = DVec3::new(600.0, 200.0, 1500.0);
    let mut view = View::look_at(eye, DVec3::new(2800.0, 3600.0, 500.0), SIZE_PX.into());
    view.tolerance_px = 2.0;
    let mut look = Look::default();
    if let Some(known) = name.strip_prefix("look-").and_then(Look::named) {
        look = known;
    } else if let Some(ramp) = RAMPS.iter().find(|r| name.strip_prefix("ramp-") == Some(r.name)) {
        look.ramp = ramp;
    }
    let mut walls = false;
    match name {
        "sunset" => {
            look.sun = Sun::default().azimuth_rad(0.75).elevation_rad(0.09);
            view = View::look_at(eye, DVec3::new(2800.0, 3600.0, 1350.0), SIZE_PX.into());
        }
        "mesh-normals" => look.tile_normals = false,
        "walls" => {
            walls = true;
            view = View::look_at(
                DVec3::new(-3600.0, -4200.0, 4300.0),
                DVec3::new(2560.0, 2560.0, 0.0),
                SIZE_PX.into(),
            );
        }
        "roll" => {
            view.roll_rad = 0.6;
            view.vertical_exaggeration = 1.6;
            view.eye_m.z = 2200.0;
        }
        "photo-map" => {
            look = look.imagery(0.6).contours(Contours::default());
            view = View::look_at(
                DVec3::new(2560.0, 2559.0, 6800.0),
                DVec3::new(2560.0, 2560.0, 0.0),
                SIZE_PX.into(),
            );
        }
        "smooth-edges" => look.multisample = true,
        "chart" => {
            look.contours = Some(Contours::default().interval_m(50.0));
            look.rock = 0.0;
            view = View::look_at(
                DVec3::new(2560.0, 2560.0, 6800.0),
                DVec3::new(2560.0, 2560.0, 0.0),
                SIZE_PX.into(),
            );
        }
        _ => {}
    }
    // A larger picture to look at: TERRASOAR_LOOK=4 makes pictures of four times the size in the temporary folder.
    let larger = std::env::var("TERRASOAR_LOOK").ok().and_then(|v| v.parse::<u32>().ok());
    if let Some(times) = larger {
        view.viewport = SIZE_PX.map(|s| s * times).into();
    }
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.refine(&view));
    scene.give_tiles(&view);
    if look.imagery > 0.0 {
        let image = Image::fields(&square.terrain);
        drape(&mut scene, &image, 64);
        while give(&mut scene.renderer, &image, &view, usize::MAX, |_| false) > 0 {}
    }
    if walls {
        scene.renderer.set_walls(&border(&square, &view), 0.0);
    }
    let picture = scene.draw(&view, &look);
    if larger.is_some() {
        picture.save(&std::env::temp_dir().join(format!("terrasoar-{name}.png")));
        return Ok(());
    }
    check_snapshot(name, &picture)
}

/// Edges of the mesh along the square's border: those of the triangles with two corners on one side.
fn border(square: &Square, view: &View) -> Vec<[u32; 2]> {
    let last = square.side - 1;
    let side_of = |slot: u32| {
        let [x, y] = [slot % square.side, slot / square.side];
        [x == 0, y == 0, x == last, y == last]
    };
    let mut edges = Vec::new();
    for [a, b, c] in square.refine(view).triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            if side_of(from).iter().zip(side_of(to)).any(|(f, t)| *f && t) {
                edges.push([from, to]);
            }
        }
    }
    edges
}
