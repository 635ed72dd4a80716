//! A material with a number of its own that changes from frame to frame: the height of the snow line, in three pictures.
//!
//!     cargo run --release -p terrasoar-scene --example step_7_bindings -- land.iqt

use std::error::Error;
use std::sync::{Arc, Mutex};
use terrasoar::ground::PictureEngine;
use terrasoar::refine::Culling;
use terrasoar::{MappedTerrain, View};
use terrasoar_render::{Look, Material, wgpu};
use terrasoar_scene::studio::Studio;

const SIZE_PX: [u32; 2] = [320, 180];

// begin: bindings
const SNOW: &str = "
@group(1) @binding(0) var<uniform> own_snow_line: vec4<f32>;

fn material(at: GroundPoint) -> vec4<f32> {
    let is_level = band(at.slope_deg, -1.0, 40.0, 10.0);
    return vec4(vec3(0.8), is_level * smoothstep(-30.0, 30.0, at.height_m - own_snow_line.x));
}";

/// The buffer of the device that draws now. Its first number is the height of the snow line in metres.
type SnowLine = Arc<Mutex<Option<wgpu::Buffer>>>;

/// Snow from a height on.
fn snow(snow_line: &SnowLine) -> Result<Material, terrasoar_render::RenderError> {
    let snow_line = Arc::clone(snow_line);
    // Called when the material is set, and again with the next device if this one is lost: so the buffer is made in here.
    Ok(Material::new(SNOW)?.bindings(move |device, _queue, layout| {
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("snow line"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("snow"),
            layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        });
        *snow_line.lock().expect("nothing panics with it held") = Some(buffer);
        group
    }))
}

/// Moves the snow line, in any frame.
fn set_snow_line(queue: &wgpu::Queue, snow_line: &SnowLine, height_m: f32) {
    if let Some(buffer) = &*snow_line.lock().expect("nothing panics with it held") {
        queue.write_buffer(buffer, 0, &height_m.to_le_bytes());
    }
}
// end: bindings

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or("land.iqt".into());
    let terrain = MappedTerrain::open(&path)?;
    let mut studio = Studio::new(terrain.file(), PictureEngine::Kinetic, Culling::Vertices, SIZE_PX.into())?;
    let snow_line = SnowLine::default();
    studio.set_material(Some(snow(&snow_line)?))?;
    let view = View::new([11300.0, 3000.0, 900.0], 45.0, -10.0).viewport(SIZE_PX);
    studio.fly(&view);
    for height_m in [400.0_f32, 250.0, 100.0] {
        set_snow_line(&studio.gpu().queue, &snow_line, height_m);
        let rgb = studio.picture(&view, &Look::default())?;
        let light = rgb.iter().map(|value| u64::from(*value)).sum::<u64>() / rgb.len() as u64;
        println!("snow from {height_m:.0} m: a mean of {light}");
    }
    Ok(())
}
