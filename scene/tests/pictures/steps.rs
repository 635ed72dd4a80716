//! Materials over real ground, through a loss of the device; and the steps for embedders that take pictures.

use super::rig::{Rig, puget_sound, view};
use super::{Outcome, Test, ensure, examples};
use std::process::Command;
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

/// The programs of examples/steps run, and what they say and draw changes as they mean it to.
fn pictures(_: &Gpu) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let land = puget_sound().path();
    let out = folder.path().join("picture.png");
    let run = |name: &str, more: &[&std::path::Path]| {
        let done = Command::new(examples::built("terrasoar-scene", name)?)
            .arg(land)
            .args(more)
            .output()
            .map_err(|e| e.to_string())?;
        let words = String::from_utf8_lossy(&done.stderr).into_owned();
        ensure(done.status.success(), || format!("{name}: {}: {words}", done.status))?;
        Ok::<_, String>(String::from_utf8_lossy(&done.stdout).into_owned())
    };
    run("step_3_picture", &[&out])?;
    let bytes = std::fs::read(&out).map_err(|e| e.to_string())?;
    ensure(bytes.starts_with(b"\x89PNG") && bytes.len() > 10_000, || format!("{} bytes", bytes.len()))?;
    let said = run("step_7_bindings", &[])?;
    let light: Vec<u32> = said.lines().filter_map(|line| line.rsplit(' ').next()?.parse().ok()).collect();
    ensure(light.len() == 3 && light[0] <= light[1] && light[1] < light[2], || said.clone())
}
