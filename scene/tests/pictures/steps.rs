//! Materials over real ground, through a loss of the device; and the steps for embedders that take pictures.

use super::rig::{Rig, view};
use super::{Outcome, Test, ensure, examples};
use std::path::Path;
use std::process::Command;
use terrasoar_import::synth::{self, SynthOptions};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
use terrasoar_render::{Gpu, Haze, Layer, Layers, Look, Material, wgpu};

pub const TESTS: &[Test] = &[
    ("steps::a_material_stays_after_the_loss_of_the_device", stays),
    ("steps::a_wrong_material_leaves_the_one_before", wrong),
    ("steps::pictures_are_taken", pictures),
];

const SIZE_PX: [u32; 2] = [240, 160];

fn look() -> Look {
    Look::default().haze(Haze::Off).shading(0.0)
}

fn layers() -> Result<Material, String> {
    let [green, white, red] = [0x208040, 0xf0f0f0, 0xa02020].map(|rgb| Layer::plain(8, rgb));
    Layers::new(8)
        .over(green)
        .over(white.heights_m([1200.0, f32::INFINITY], 100.0))
        .over(red.slopes_deg([30.0, 90.0], 5.0))
        .material()
        .map_err(|e| e.to_string())
}

fn stays(gpu: &Gpu) -> Outcome {
    let view = view([80.0, 60.0, 30.0], [120.0, -40.0, 0.0], 50.0, SIZE_PX);
    let doomed = Gpu::headless_blocking().map_err(|e| e.to_string())?;
    let mut rig = Rig::plain(&doomed, SIZE_PX);
    let bare = rig.shoot(&view, &look());
    rig.scene.set_material(Some(layers()?)).map_err(|e| e.to_string())?;
    let before = rig.draw(&view, &look());
    ensure(before != bare, || "the material is not seen".into())?;
    doomed.device.destroy();
    let _ = doomed.device.poll(wgpu::PollType::Poll);
    rig.move_to(gpu, SIZE_PX);
    ensure(rig.draw(&view, &look()) == before, || "after the loss another picture is drawn".into())?;
    rig.scene.set_material(None).map_err(|e| e.to_string())?;
    ensure(rig.draw(&view, &look()) == bare, || "the material is not gone".into())
}

fn wrong(gpu: &Gpu) -> Outcome {
    let view = view([80.0, 60.0, 30.0], [120.0, -40.0, 0.0], 50.0, SIZE_PX);
    let mut rig = Rig::plain(gpu, SIZE_PX);
    rig.scene.set_material(Some(layers()?)).map_err(|e| e.to_string())?;
    let before = rig.shoot(&view, &look());
    let unbound = "@group(1) @binding(0) var<uniform> own_a: vec4<f32>;\nfn material(at: GroundPoint) -> vec4<f32> { return own_a; }";
    let unbound = Material::new(unbound).map_err(|e| e.to_string())?;
    ensure(rig.scene.set_material(Some(unbound)).is_err(), || "nothing was bound".into())?;
    ensure(rig.draw(&view, &look()) == before, || "the material before is gone".into())
}

/// The land of docs/first-steps.md.
fn first_steps_land(dem: &Path, land: &Path) -> Result<(), String> {
    synth::write(&SynthOptions::default().seed(1), dem, &|_| {}).map_err(|e| e.to_string())?;
    let dem = terrasoar_import::open(&[dem.to_owned()]).map_err(|e| e.to_string())?;
    build(&*dem, land, &BuildOptions::default(), &Silent).map(drop).map_err(|e| e.to_string())
}

/// The programs of examples/steps run, and what they say and draw changes as they mean it to.
fn pictures(_: &Gpu) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let land = folder.path().join("land.iqt");
    first_steps_land(&folder.path().join("land.tif"), &land)?;
    let out = folder.path().join("picture.png");
    let run = |name: &str, more: &[&Path]| {
        let done = Command::new(examples::built("terrasoar-scene", name)?)
            .arg(&land)
            .args(more)
            .output()
            .map_err(|e| e.to_string())?;
        let words = String::from_utf8_lossy(&done.stderr).into_owned();
        ensure(done.status.success(), || format!("{name}: {}: {words}", done.status))?;
        Ok::<_, String>(String::from_utf8_lossy(&done.stdout).into_owned())
    };
    run("step_3_picture", &[&out])?;
    let file = std::fs::File::open(&out).map_err(|e| e.to_string())?;
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(file)).read_info().map_err(|e| e.to_string())?;
    let mut rgb = vec![0; reader.output_buffer_size().ok_or("too large")?];
    let size = reader.next_frame(&mut rgb).map_err(|e| e.to_string())?;
    ensure((size.width, size.height) == (960, 540), || format!("{size:?}"))?;
    // The example's materials by what sets their colours apart: grass is the greenest, sand the reddest, snow bright and bluish, rock grey.
    let mut shares = [0u32; 4];
    for pixel in rgb.as_chunks::<3>().0.iter().skip(960 * 180) {
        let [r, g, b] = pixel.map(f32::from);
        let seen = [
            g > 1.1 * r && g > 1.3 * b,
            r > 1.04 * g && r > 1.2 * b,
            b > 150.0 && b >= r,
            (r - b).abs() < 0.12 * r && r < 150.0,
        ];
        seen.into_iter().zip(&mut shares).for_each(|(seen, share)| *share += u32::from(seen));
    }
    ensure(shares.iter().all(|share| *share > 1000), || {
        format!("grass, sand, snow, rock: {shares:?} pixels")
    })?;
    let said = run("step_7_bindings", &[])?;
    let light: Vec<u32> = said.lines().filter_map(|line| line.rsplit(' ').next()?.parse().ok()).collect();
    ensure(light.len() == 3 && light[0] <= light[1] && light[1] < light[2], || said.clone())
}
