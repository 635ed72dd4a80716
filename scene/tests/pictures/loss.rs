//! A device is lost, and the one that takes over can do less, or more: what the image is sent as follows the device, and what is seen stays.

use super::paint::{Window, burn, from_above, land};
use super::{Outcome, Test, ensure};
use terrasoar_layout::edit::EditSession;
use terrasoar_layout::imagery::TileFormat;
use terrasoar_render::{Capabilities, DeviceWatch, Gpu, wgpu};

pub const TESTS: &[Test] = &[
    ("loss::a_device_without_compressed_textures_takes_over_and_gives_back", less_and_more),
    ("loss::tiles_that_were_read_for_the_lost_device_are_not_given_to_the_next", tiles_under_way),
    ("loss::paint_stays", paint_stays),
];

/// How far a channel may be off where blocks are decoded by another: rounding of two thirds of a colour, through light and back.
const DECODERS_DIFFER_BY: u8 = 6;

/// Another device of the adapter, with compressed textures or without.
fn device(gpu: &Gpu, compressed: bool) -> Result<Gpu, String> {
    let adapter = gpu.adapter.clone();
    let features = wgpu::Features::TEXTURE_COMPRESSION_BC;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: if compressed { features } else { wgpu::Features::empty() },
        required_limits: adapter.limits(),
        ..Default::default()
    }))
    .map_err(|e| e.to_string())?;
    let capabilities = Capabilities {
        texture_compression_bc: compressed,
        timestamps: false,
        multi_draw: compressed && gpu.capabilities.multi_draw,
        ..gpu.capabilities.clone()
    };
    let watch = DeviceWatch::install(&device);
    Ok(Gpu { adapter, device, queue, capabilities, watch })
}

/// One with compressed textures and one without; none where the adapter has none to lose.
fn devices(gpu: &Gpu) -> Result<Option<[Gpu; 2]>, String> {
    if !gpu.capabilities.texture_compression_bc {
        println!("not tried: the adapter has no compressed textures");
        return Ok(None);
    }
    Ok(Some([device(gpu, true)?, device(gpu, false)?]))
}

fn lose(gpu: &Gpu) {
    gpu.device.destroy();
    let _ = gpu.device.poll(wgpu::PollType::Poll);
}

/// Largest difference of a channel.
fn most(a: &[u8], b: &[u8]) -> u8 {
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

fn format(window: &Window<'_>) -> Option<TileFormat> {
    window.scene.renderer().imagery_format()
}

fn less_and_more(gpu: &Gpu) -> Outcome {
    let Some([rich, poor]) = devices(gpu)? else { return Ok(()) };
    let again = device(gpu, true)?;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = land(&folder, Some(TileFormat::Bc1))?;
    let view = from_above();
    let mut window = Window::open(&rich, &path)?;
    let before = window.settled(&view)?;
    ensure(format(&window) == Some(TileFormat::Bc1), || "blocks are sent as they are".into())?;
    lose(&rich);
    window.move_to(&poor)?;
    let decoded = window.settled(&view)?;
    ensure(format(&window) == Some(TileFormat::Rgba8), || "texels are sent".into())?;
    let off = most(&before, &decoded);
    ensure(off <= DECODERS_DIFFER_BY, || format!("the picture is off by {off}"))?;
    let fresh = Window::open(&poor, &path)?.settled(&view)?;
    ensure(decoded == fresh, || "a scene made on that device shows another picture".into())?;
    window.move_to(&again)?;
    ensure(window.settled(&view)? == before, || "the first picture does not come back".into())?;
    ensure(format(&window) == Some(TileFormat::Bc1), || "blocks are sent again".into())
}

/// Frames before the loss have left lists to be read, and some of that has come.
fn tiles_under_way(gpu: &Gpu) -> Outcome {
    let Some([rich, poor]) = devices(gpu)? else { return Ok(()) };
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = land(&folder, Some(TileFormat::Bc1))?;
    let view = from_above();
    let expected = [Window::open(&rich, &path)?.settled(&view)?, Window::open(&poor, &path)?.settled(&view)?];
    for frames in 0..8 {
        for (from, to, expected) in [(&rich, &poor, &expected[1]), (&poor, &rich, &expected[0])] {
            let mut window = Window::open(from, &path)?;
            for _ in 0..frames {
                window.frame(&view);
            }
            window.move_to(to)?;
            let seen = window.settled(&view)?;
            ensure(seen == *expected, || format!("after {frames} frames: off by {}", most(&seen, expected)))?;
        }
    }
    Ok(())
}

fn paint_stays(gpu: &Gpu) -> Outcome {
    let Some([rich, poor]) = devices(gpu)? else { return Ok(()) };
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = land(&folder, Some(TileFormat::Bc1))?;
    let view = from_above();
    let mut session = EditSession::open(&path).map_err(|e| e.to_string())?;
    let mut window = Window::open(&rich, &path)?;
    let bare = window.settled(&view)?;
    session.paint(&[burn([2016.0, 2080.0], 150.0)]).map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    let burnt = window.settled(&view)?;
    window.move_to(&poor)?;
    let off = most(&burnt, &window.settled(&view)?);
    ensure(off <= DECODERS_DIFFER_BY, || format!("the paint is off by {off}"))?;
    session.commit("burnt").map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    session.undo().map_err(|e| e.to_string())?;
    window.repainted(&mut session)?;
    let off = most(&bare, &window.settled(&view)?);
    ensure(off <= DECODERS_DIFFER_BY, || format!("an undo on the other device is off by {off}"))?;
    window.move_to(&rich)?;
    ensure(window.settled(&view)? == bare, || "the ground is not bare again".into())
}
