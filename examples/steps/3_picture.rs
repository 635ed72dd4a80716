//! A picture of the ground without a window, with a material of WGSL: what a material looks like is quickly seen so.
//!
//!     cargo run --release -p terrasoar-scene --example step_3_picture -- land.iqt picture.png

use std::error::Error;
use std::fs::File;
use terrasoar::ground::PictureEngine;
use terrasoar::refine::Culling;
use terrasoar::{MappedTerrain, View};
use terrasoar_render::{Look, Material};
use terrasoar_scene::studio::Studio;

const SIZE_PX: [u32; 2] = [960, 540];

// begin: wgsl
const MATERIAL: &str = "
fn material(at: GroundPoint) -> vec4<f32> {
    let grass = vec3(0.09, 0.16, 0.04);
    let sand = vec3(0.42, 0.34, 0.22);
    let rock = vec3(0.20, 0.18, 0.17);
    let snow = vec3(0.80, 0.84, 0.90);
    // By height: sand below 40 m, snow above 350 m, each fading over some tens of metres.
    var colour = mix(grass, sand, band(at.height_m, -1e9, 40.0, 30.0));
    colour = mix(colour, snow, band(at.height_m, 350.0, 1e9, 80.0));
    // By slope: bare rock where it is steeper than 44 degrees.
    colour = mix(colour, rock, band(at.slope_deg, 44.0, 90.0, 10.0));
    return vec4(colour, 1.0);
}";
// end: wgsl

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let path = words.next().unwrap_or("land.iqt".into());
    let out = words.next().unwrap_or("picture.png".into());

    let terrain = MappedTerrain::open(&path)?;
    let mut studio = Studio::new(terrain.file(), PictureEngine::Kinetic, Culling::Vertices, SIZE_PX.into())?;
    // begin: set
    let material = Material::new(MATERIAL)?;
    studio.set_material(Some(material))?;
    // end: set

    let view = View::new([11300.0, 3000.0, 900.0], 45.0, -10.0).viewport(SIZE_PX);
    studio.fly(&view);
    let rgb = studio.picture(&view, &Look::default())?;

    let mut encoder = png::Encoder::new(File::create(&out)?, SIZE_PX[0], SIZE_PX[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&rgb)?;
    println!("{out}");
    Ok(())
}
