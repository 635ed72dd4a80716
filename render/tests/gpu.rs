mod support;
use glam::DVec3;
use support::{landscape::hills, refiner::Square, scene::Scene};
use terrasoar_render::*;
fn main() {
    let gpu = Gpu::headless_blocking().unwrap();
    println!("{:?}", gpu.capabilities);
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    println!("{:?}", square.terrain);
    let mut view = FrameView::look_at(DVec3::new(600.0, 200.0, 1900.0), DVec3::new(2800.0, 3600.0, 600.0), [960, 640]);
    view.tolerance_px = 2.0;
    let mut scene = Scene::new(&gpu, &square);
    let t = std::time::Instant::now();
    let mesh = square.refine(&view);
    println!("{} triangles {:?}", mesh.triangles.len(), t.elapsed());
    println!("{:?}", scene.show(&mesh));
    scene.give_tiles(&view);
    println!("{:?}", scene.renderer.tile_stats());
    for (name, _) in LOOKS {
        let t = std::time::Instant::now();
        let picture = scene.draw(&view, &Look::named(name).unwrap());
        println!("{name} {:?}", t.elapsed());
        image::save_buffer(format!("/tmp/look-{name}.png"), &picture.rgba, 960, 640, image::ColorType::Rgba8).unwrap();
    }
}
