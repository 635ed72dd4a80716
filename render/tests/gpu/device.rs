//! The device itself: repeatable, timed, lost and made anew.

use glam::DVec3;
use terrasoar_render::{
    Gpu, ImageryShape, Look, RenderError, Renderer, RendererOptions, TerrainShape, TileFormat, View, wgpu,
};

use crate::support::landscape::hills;
use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("device::two_runs_are_identical", repeatable),
        ("device::loss_is_reported_and_survived", loss),
        ("device::frames_are_timed", timed),
        ("device::memory_does_not_follow_the_side_of_the_terrain", memory),
    ]
}

fn view() -> View {
    View::look_at(DVec3::new(300.0, -400.0, 1300.0), DVec3::new(1400.0, 1400.0, 400.0), [200, 150].into())
}

fn picture(gpu: &Gpu, square: &Square) -> Picture {
    let view = view();
    let mut scene = Scene::new(gpu, square);
    scene.show(&square.refine(&view));
    scene.give_tiles(&view);
    scene.draw(&view, &Look::default())
}

fn repeatable(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    let other = Gpu::headless_blocking().map_err(|e| e.to_string())?;
    let first = picture(gpu, &square);
    ensure(first == picture(gpu, &square), || "one device draws two pictures".to_owned())?;
    ensure(first == picture(&other, &square), || "two devices draw two pictures".to_owned())
}

fn loss(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let doomed = Gpu::headless_blocking().map_err(|e| e.to_string())?;
    let before = picture(&doomed, &square);
    doomed.watch.check().map_err(|e| e.to_string())?;
    doomed.device.destroy();
    // What is lost shows when it is next used.
    let _ = doomed.device.poll(wgpu::PollType::Poll);
    for _ in 0..2 {
        let lost = doomed.watch.check();
        ensure(matches!(lost, Err(RenderError::DeviceLost { .. })), || format!("{lost:?}"))?;
    }
    ensure(picture(gpu, &square) == before, || "the picture on another device differs".to_owned())
}

fn timed(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let view = view();
    let mut scene = Scene::with(gpu, &square, RendererOptions::default().timestamps(true));
    scene.show(&square.refine(&view));
    let mut time_ms = None;
    for _ in 0..5 {
        scene.draw(&view, &Look::default());
        time_ms = scene.renderer.gpu_time_ms();
    }
    let expected = gpu.capabilities.timestamps;
    ensure(time_ms.is_some() == expected && time_ms.is_none_or(|t| t > 0.0), || format!("{time_ms:?}"))
}

/// Neither the light's tiles nor a picture's take memory for ground that is not shown.
fn memory(gpu: &Gpu) -> Outcome {
    let bytes = |side: u32| {
        let terrain =
            TerrainShape { spacing_m: [10.0; 2], samples: [side + 1; 2], height_range_m: [0.0, 1000.0] };
        let made = Renderer::new(&gpu.device, &gpu.queue, terrain, RendererOptions::default());
        let mut renderer = made.map_err(|e| e.to_string())?;
        let bare = renderer.device_bytes();
        let image = ImageryShape::new(TileFormat::Rgba8, [4 * side; 2], [0.0; 2], [2.5; 2]);
        renderer.set_imagery(&image, image.format, Renderer::IMAGERY_BYTES).map_err(|e| e.to_string())?;
        Ok::<_, String>([bare, renderer.device_bytes()])
    };
    let [small, vast] = [bytes(1 << 13)?, bytes(1 << 20)?];
    ensure(small == vast, || format!("{small:?} bytes at 8,193 samples a side, {vast:?} at 1,048,577"))
}
