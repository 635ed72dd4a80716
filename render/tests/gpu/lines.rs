//! Contour lines: on slopes where heights say, and not over level ground that happens to lie at the height of a line.

use glam::DVec3;
use terrasoar_render::{Contours, Gpu, Haze, Look, Surface, View};

use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("lines::level_ground_at_the_height_of_a_line_is_no_line", level),
        ("lines::gentle_slopes_keep_their_lines", gentle),
    ]
}

const SPACING_M: f64 = 10.0;

fn look(interval_m: f32) -> Look {
    let look = Look::default().surface(Surface::Plain).shading(0.0).haze(Haze::Off).morph(false);
    look.contours(Contours::default().interval_m(interval_m).opacity(1.0))
}

/// Pixels that are darkened by lines.
fn lines(picture: &Picture) -> Vec<bool> {
    // Plain ground is of one grey, sRGB 190 and thereabouts; the lines are brown.
    picture.rgba.as_chunks::<4>().0.iter().map(|[r, ..]| *r < 160).collect()
}

fn drawn(gpu: &Gpu, square: &Square, view: &View, look: &Look) -> Picture {
    let mut scene = Scene::new(gpu, square);
    scene.show(&square.down_to(0));
    scene.give_tiles(view);
    scene.draw(view, look)
}

/// Plateaus at the height of a line in the west, from the sea to high mountains, and a slope in the east; from above and aslant.
fn level(gpu: &Gpu) -> Outcome {
    for height_m in [0.0, 300.0, 2400.0, -400.0, 8800.0] {
        let land = move |x: f64, _: f64| height_m + 5.0 * (x - 40.0).max(0.0);
        let square = Square::new(6, [0, 0], [SPACING_M; 2], land);
        for (eye_m, at_m) in [
            ([300.0, 320.0, height_m + 900.0], [301.0, 321.0, height_m]),
            ([320.0, -400.0, height_m + 260.0], [330.0, 320.0, height_m]),
            ([-800.0, 900.0, height_m + 111.1], [330.0, 320.0, height_m]),
        ] {
            let view = View::look_at(DVec3::from_array(eye_m), DVec3::from_array(at_m), [240, 180].into());
            let picture = drawn(gpu, &square, &view, &look(100.0));
            let bare = drawn(gpu, &square, &view, &look(100.0).contours(None));
            let marked = lines(&picture).iter().zip(lines(&bare)).filter(|(is, was)| **is && !was).count();
            let ground = bare
                .rgba
                .as_chunks::<4>()
                .0
                .iter()
                .filter(|[r, g, b, _]| r.abs_diff(*g) < 6 && g.abs_diff(*b) < 9)
                .count();
            ensure(ground > 2000, || format!("{ground} pixels of ground from {eye_m:?}"))?;
            // The slope of 120 m has a line or two, each some pixels wide and a picture high.
            ensure(marked < ground / 12, || {
                format!("{marked} of {ground} pixels at {height_m} m from {eye_m:?} are lines")
            })?;
        }
    }
    Ok(())
}

/// One in a thousand, near and far: each line is there from side to side.
fn gentle(gpu: &Gpu) -> Outcome {
    for base_m in [0.0, 3000.0] {
        let square = Square::new(6, [0, 0], [SPACING_M; 2], move |x, _| base_m + 0.01 * (x - 31.7));
        let eye = DVec3::new(320.0, 320.0, base_m + 600.0);
        let view = View::look_at(eye, eye - DVec3::Z, [120, 90].into());
        // 0.64 m from end to end: the line of height 0 runs through the middle, 3 m from the eye.
        let marked = lines(&drawn(gpu, &square, &view, &look(1.0)));
        for row in marked.as_chunks::<120>().0.iter().skip(5).take(80) {
            let wide = row.iter().filter(|is| **is).count();
            ensure((1..=3).contains(&wide), || format!("a line of {wide} pixels at {base_m} m"))?;
        }
    }
    Ok(())
}
