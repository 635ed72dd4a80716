//! The mesh on the device: patches, growth, draws, and what they cost.

use glam::DVec3;
use terrasoar_render::{Gpu, Look, MeshPatch, RenderError, RendererOptions, View};

use crate::support::landscape::hills;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::support::stream::Stream;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("patches::incremental_equals_at_once", incremental),
        ("patches::growth_keeps_the_picture", growth),
        ("patches::one_indirect_draw_equals_many_direct", indirect),
        ("patches::many_patches_in_one_submission", one_submission),
        ("patches::refused_patches_change_nothing", refused),
    ]
}

fn over(t: f64) -> View {
    let eye = DVec3::new(400.0 + 25.0 * t, 300.0 + 15.0 * t, 1400.0);
    let mut view = View::look_at(eye, eye + DVec3::new(1.0, 1.2, -0.5), [200, 150].into());
    view.tolerance_px = 3.0;
    view
}

/// The stream of patches ends in the same picture as the last mesh alone, and each costs its own size.
fn incremental(gpu: &Gpu) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    let mut stream = Stream::default();
    let mut largest = 0;
    for frame in 0..30 {
        let mesh = square.refine(&over(f64::from(frame)));
        let (stats, [vertices, triangles]) = stream.advance(&mut scene, &mesh);
        let own = 36 * u64::from(vertices) + 16 * u64::from(triangles);
        ensure(stats.bytes == own, || format!("frame {frame}: {} bytes for a patch of {own}", stats.bytes))?;
        if frame > 0 {
            largest = largest.max(stats.bytes);
        }
    }
    let last = over(29.0);
    let mesh = square.refine(&last);
    let whole = 36 * mesh.slots.len() as u64 + 16 * mesh.triangles.len() as u64;
    ensure(4 * largest < whole, || format!("a patch of {largest} bytes where the mesh has {whole}"))?;
    let streamed = scene.draw(&last, &Look::default());
    let mut fresh = Scene::new(gpu, &square);
    fresh.show(&mesh);
    ensure(fresh.draw(&last, &Look::default()) == streamed, || "pictures differ".to_owned())
}

fn growth(gpu: &Gpu) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let view = over(0.0);
    let mut grown = Scene::new(gpu, &square);
    let mesh = square.down_to(0);
    // In parts, so that what was there before must survive several growths.
    let entries = square.entries(&mesh.slots);
    let triangles: Vec<_> = (0..).zip(mesh.triangles.iter().copied()).collect();
    let mut grown_bytes = 0;
    for part in entries.chunks(7000) {
        grown_bytes += grown.apply(&MeshPatch { vertices: part, ..Default::default() }).grown_bytes;
    }
    let mut uploaded = 0;
    for part in triangles.chunks(50_000) {
        uploaded += part.len() as u32;
        let draws = [0..uploaded];
        grown_bytes +=
            grown.apply(&MeshPatch { triangles: part, draws: &draws, ..Default::default() }).grown_bytes;
    }
    ensure(grown_bytes > 0, || "nothing grew".to_owned())?;
    let mut fresh = Scene::new(gpu, &square);
    fresh.show(&mesh);
    let look = Look::default();
    ensure(fresh.draw(&view, &look) == grown.draw(&view, &look), || "pictures differ".to_owned())
}

fn indirect(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    let mesh = square.down_to(0);
    let triangles: Vec<_> = (0..).zip(mesh.triangles.iter().copied()).collect();
    // Every third triangle is left out, and the order is not ascending.
    let draws: Vec<_> = (0..triangles.len() as u32 / 3).rev().map(|i| 3 * i..3 * i + 2).collect();
    let patch = MeshPatch { vertices: &square.entries(&mesh.slots), triangles: &triangles, draws: &draws };
    let view = over(0.0);
    let [direct, indirect] = [false, true].map(|multi_draw| {
        let mut scene = Scene::with(gpu, &square, RendererOptions::default().multi_draw(multi_draw));
        scene.apply(&patch);
        scene.draw_counted(&view, &Look::default())
    });
    ensure(direct.1.draw_calls > 64 && indirect.1.draw_calls == 2, || {
        format!("{} and {} draw calls", direct.1.draw_calls, indirect.1.draw_calls)
    })?;
    ensure(direct.1.triangles == 2 * draws.len() as u64, || "triangles are miscounted".to_owned())?;
    ensure(direct.0 == indirect.0, || "pictures differ".to_owned())
}

fn one_submission(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    let mesh = square.down_to(2);
    let mut scene = Scene::new(gpu, &square);
    let entries = square.entries(&mesh.slots);
    let triangles: Vec<_> = (0..).zip(mesh.triangles.iter().copied()).collect();
    let draws = [0..triangles.len() as u32];
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let wrong = [(entries[0].0, entries[1].1), (triangles[0].0, entries[1].1)];
    for patch in [
        MeshPatch { vertices: &wrong, ..Default::default() },
        MeshPatch { vertices: &entries, ..Default::default() },
        MeshPatch { triangles: &triangles, draws: &draws, ..Default::default() },
    ] {
        scene.renderer.apply(&mut encoder, &patch).map_err(|e| e.to_string())?;
    }
    gpu.queue.submit([encoder.finish()]);
    let mut fresh = Scene::new(gpu, &square);
    fresh.show(&mesh);
    let (view, look) = (over(0.0), Look::default());
    ensure(fresh.draw(&view, &look) == scene.draw(&view, &look), || "pictures differ".to_owned())
}

fn refused(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let (view, look) = (over(0.0), Look::default());
    let before = scene.draw(&view, &look);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let far = [(u32::MAX, square.vertices[0])];
    let too_large = scene.renderer.apply(&mut encoder, &MeshPatch { vertices: &far, ..Default::default() });
    ensure(matches!(too_large, Err(RenderError::TooLarge { .. })), || format!("{too_large:?}"))?;
    let outside =
        scene.renderer.apply(&mut encoder, &MeshPatch { draws: &[0..1_000_000_000], ..Default::default() });
    ensure(matches!(outside, Err(RenderError::RangeOutside { .. })), || format!("{outside:?}"))?;
    gpu.queue.submit([encoder.finish()]);
    ensure(scene.draw(&view, &look) == before, || "the picture changed".to_owned())
}
