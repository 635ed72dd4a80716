//! A mesh is a mesh: what the device has been told in changes looks as what it is told at once.

use super::rig::{Rig, view};
use super::{Outcome, Test, ensure};
use terrasoar::ground::PictureEngine;
use terrasoar::refine::Culling;
use terrasoar::view::View;
use terrasoar_render::{Gpu, LOOKS, Look};

pub const TESTS: &[Test] = &[
    ("engines::kinetic_looks_as_soar", kinetic_looks_as_soar),
    ("engines::clusters_look_as_vertices", clusters_look_as_soar),
    ("engines::streamed_looks_as_mapped", streamed_looks_as_mapped),
    ("engines::unseen_updates_are_made_up_for", unseen_updates),
    ("engines::a_new_device_shows_the_same", new_device),
    ("engines::another_way_of_culling_shows_the_same", other_culling),
];

const SIZE_PX: [u32; 2] = [360, 240];

/// Low over the Cascades, turning, rolling and zooming.
fn frame(i: u32) -> View {
    let t = f64::from(i);
    let view =
        view([96.0 + 0.9 * t, 60.0 + 0.7 * t, 3.2], [30.0 + 5.0 * t, -12.0, 4.0 * t], 45.0 - t, SIZE_PX);
    View { vertical_exaggeration: 1.3, ..view }
}

/// Pixels that differ, and the largest difference of a channel.
fn difference(a: &[u8], b: &[u8]) -> (usize, u8) {
    let pixels = a.as_chunks::<4>().0.iter().zip(b.as_chunks::<4>().0);
    let most = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    (pixels.filter(|(a, b)| a != b).count(), most)
}

fn same(a: &[u8], b: &[u8], of: impl Fn() -> String) -> Outcome {
    let (pixels, most) = difference(a, b);
    ensure(pixels == 0, || format!("{}: {pixels} pixels differ, by up to {most}", of()))
}

fn against_soar(gpu: &Gpu, culling: Culling) -> Outcome {
    let mut kinetic = Rig::new(gpu, PictureEngine::Kinetic, culling, SIZE_PX);
    let mut soar = Rig::new(gpu, PictureEngine::Soar, culling, SIZE_PX);
    for i in 0..10 {
        let view = frame(i);
        let (name, _) = LOOKS[i as usize % LOOKS.len()];
        let look = Look::named(name).unwrap().morph(i % 3 > 0);
        let [a, b] = [kinetic.shoot(&view, &look), soar.shoot(&view, &look)];
        same(&a, &b, || format!("frame {i} in look {name}"))?;
    }
    Ok(())
}

fn kinetic_looks_as_soar(gpu: &Gpu) -> Outcome {
    against_soar(gpu, Culling::Vertices)
}

fn clusters_look_as_soar(gpu: &Gpu) -> Outcome {
    against_soar(gpu, Culling::Clusters)
}

fn streamed_looks_as_mapped(gpu: &Gpu) -> Outcome {
    let mut mapped = Rig::plain(gpu, SIZE_PX);
    // Less than the file has, so that pages are given up on the way.
    let mut streamed = Rig::streamed(gpu, SIZE_PX, 3 << 20);
    let look = Look::default();
    for i in [0, 1, 2, 3, 20, 0, 25, 9] {
        let view = frame(i);
        let [a, b] = [mapped.shoot(&view, &look), streamed.shoot_settled(&view, &look)];
        same(&a, &b, || format!("frame {i}"))?;
    }
    Ok(())
}

fn unseen_updates(gpu: &Gpu) -> Outcome {
    let [mut always, mut now_and_then, mut once] = [(); 3].map(|()| Rig::plain(gpu, SIZE_PX));
    let look = Look::default();
    let mut pictures = [Vec::new(), Vec::new(), Vec::new()];
    for i in 0..10 {
        let view = frame(i);
        pictures[0] = always.shoot(&view, &look);
        now_and_then.ground.update(&view);
        if i == 2 || i == 9 {
            pictures[1] = now_and_then.draw(&view, &look);
        }
        once.ground.update(&view);
    }
    pictures[2] = once.draw(&frame(9), &look);
    same(&pictures[0], &pictures[1], || "seen twice".into())?;
    same(&pictures[0], &pictures[2], || "seen once".into())
}

fn new_device(gpu: &Gpu) -> Outcome {
    let other = Gpu::headless_blocking().map_err(|e| e.to_string())?;
    let mut rig = Rig::plain(gpu, SIZE_PX);
    let look = Look::default();
    for i in 0..4 {
        rig.shoot(&frame(i), &look);
    }
    let before = rig.draw(&frame(3), &look);
    rig.move_to(&other, SIZE_PX);
    same(&before, &rig.draw(&frame(3), &look), || "the frame that was lost".into())?;
    // Changes go on from there.
    let after = rig.shoot(&frame(4), &look);
    let mut fresh = Rig::plain(gpu, SIZE_PX);
    same(&after, &fresh.shoot(&frame(4), &look), || "the frame after".into())
}

/// Pixels from the rim of a picture within which triangles may reach out of sight.
const RIM_PX: usize = 16;

/// Whether two pictures are the same but at their rim.
fn differs_at_the_rim_alone(a: &[u8], b: &[u8]) -> Outcome {
    let [wide, high] = SIZE_PX.map(|px| px as usize);
    let bytes = a.len() / (wide * high);
    for (pixel, (x, y)) in a.chunks(bytes).zip(b.chunks(bytes)).enumerate().filter(|(_, (x, y))| x != y) {
        let (column, row) = (pixel % wide, pixel / wide);
        let from_rim = column.min(wide - 1 - column).min(row).min(high - 1 - row);
        ensure(from_rim < RIM_PX, || format!("pixel {column}, {row} is {x:?} and {y:?}"))?;
    }
    Ok(())
}

/// The way of culling changes in flight, over the pages that are there.
fn other_culling(gpu: &Gpu) -> Outcome {
    let mut streamed = Rig::streamed(gpu, SIZE_PX, 3 << 20);
    let look = Look::default();
    for (i, culling) in (0..).zip([Culling::Clusters, Culling::Vertices, Culling::Clusters]) {
        streamed.shoot_settled(&frame(i), &look);
        ensure(streamed.ground.set_culling(culling), || "streamed ground can".into())?;
        // The two ways draw another mesh out of sight, and so where sight ends: nowhere else do their pictures differ.
        let mut other = Rig::plain(gpu, SIZE_PX);
        let [a, b] = [streamed.shoot_settled(&frame(i), &look), other.shoot(&frame(i), &look)];
        differs_at_the_rim_alone(&a, &b).map_err(|why| format!("{culling:?}: {why}"))?;
        let mut fresh = Rig::new(gpu, PictureEngine::Kinetic, culling, SIZE_PX);
        let [a, b] = [streamed.shoot_settled(&frame(i), &look), fresh.shoot(&frame(i), &look)];
        same(&a, &b, || format!("the same frame, {culling:?}"))?;
        let [a, b] = [streamed.shoot_settled(&frame(i + 5), &look), fresh.shoot(&frame(i + 5), &look)];
        same(&a, &b, || format!("another frame, {culling:?}"))?;
    }
    let mut fresh = Rig::plain(gpu, SIZE_PX);
    ensure(!fresh.ground.set_culling(Culling::Clusters), || "others cannot".into())
}
