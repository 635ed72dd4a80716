//! A material of textures: grass below, rock where it is steep, snow above, each in a band of height and slope.
//!
//! Textures are tiled in metres and have all their mip levels, made here by halving in linear light, so ground far away has a texture's mean colour and does not shimmer. It is a [`Material`]
//! like any other, and `shaders/layers.wgsl` is its text.

use super::Material;
use crate::error::{RenderError, Result};
use crate::ramps::linear_of;
use wgpu::util::DeviceExt;

/// Most layers of a material.
const MOST_LAYERS: usize = 16;
/// Largest texture: every device has these.
const MOST_TEXELS: u32 = 4096;
/// Most samples along what a pixel covers, where ground is looked at flatly.
const ANISOTROPY: u16 = 8;
/// Stands for no end of a band, in metres or degrees.
const NO_END: f32 = 1e9;

const TEXT: &str = include_str!("../shaders/layers.wgsl");

/// A texture and the ground that it is on: everywhere, until a band of heights or slopes is said.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    texels: Vec<u8>,
    size_m: f32,
    heights_m: [f32; 2],
    height_soft_m: f32,
    slopes_deg: [f32; 2],
    slope_soft_deg: f32,
    opacity: f32,
}

impl Layer {
    /// A layer of a square texture that is `size_m` metres wide on the ground and repeats. `rgba` has four bytes a texel, sRGB, row by row; the fourth is not looked at. Each layer of a material has as many texels.
    /// The width is rounded so that a whole number of textures lies in 4,096 m, and is 4,096 m at most.
    pub fn new(rgba: impl Into<Vec<u8>>, size_m: f32) -> Self {
        Self {
            texels: rgba.into(),
            size_m,
            heights_m: [-NO_END, NO_END],
            height_soft_m: 0.0,
            slopes_deg: [-NO_END, NO_END],
            slope_soft_deg: 0.0,
            opacity: 1.0,
        }
    }

    /// A layer of one colour, sRGB 0xRRGGBB, with `side_px` texels a side as the others have.
    pub fn plain(side_px: u32, rgb: u32) -> Self {
        let [_, r, g, b] = rgb.to_be_bytes();
        Self::new([r, g, b, 255].repeat((side_px as usize).pow(2)), 1.0)
    }

    /// This layer from one height to another, metres before exaggeration; infinite for no end. Over `soft_m` about each end it fades.
    pub fn heights_m(self, heights_m: [f32; 2], soft_m: f32) -> Self {
        Self { heights_m, height_soft_m: soft_m, ..self }
    }

    /// This layer from one steepness to another, in degrees; infinite for no end. Over `soft_deg` about each end it fades.
    pub fn slopes_deg(self, slopes_deg: [f32; 2], soft_deg: f32) -> Self {
        Self { slopes_deg, slope_soft_deg: soft_deg, ..self }
    }

    /// This layer covering so much of what is below it, 0 to 1.
    pub fn opacity(self, opacity: f32) -> Self {
        Self { opacity, ..self }
    }

    /// What is wrong with it.
    fn fault(&self, side_px: u32) -> Option<String> {
        let expected = 4 * (side_px as usize).pow(2);
        let ends = [self.heights_m, self.slopes_deg];
        if self.texels.len() != expected {
            let got = self.texels.len();
            Some(format!("its texture has {got} bytes, {side_px} x {side_px} texels have {expected}"))
        } else if !(self.size_m.is_finite() && self.size_m > 0.0) {
            Some(format!(
                "a texture of {} m cannot be laid out; give its width in metres, above 0",
                self.size_m
            ))
        } else if ends.iter().any(|[low, high]| low.partial_cmp(high).is_none_or(std::cmp::Ordering::is_gt)) {
            Some("a band begins above its end".into())
        } else if [self.height_soft_m, self.slope_soft_deg]
            .iter()
            .any(|soft| !(soft.is_finite() && *soft >= 0.0))
        {
            Some("a soft edge is 0 or wider, in metres or degrees".into())
        } else if !(0.0..=1.0).contains(&self.opacity) {
            Some(format!("opacity is from 0 to 1, not {}", self.opacity))
        } else {
            None
        }
    }

    /// Its numbers, as `shaders/layers.wgsl` reads them.
    fn numbers(&self) -> [f32; 8] {
        let [[low_m, high_m], [least_deg, most_deg]] =
            [self.heights_m, self.slopes_deg].map(|ends| ends.map(|end| end.clamp(-NO_END, NO_END)));
        [
            low_m,
            high_m,
            self.height_soft_m,
            self.size_m,
            least_deg,
            most_deg,
            self.slope_soft_deg,
            self.opacity,
        ]
    }
}

/// Layers, each over those before it. Where none is, the look's own colour and the picture show.
///
/// ```
/// use terrasoar_render::{Layer, Layers};
///
/// // Four bytes a texel; a game reads them from its own files.
/// let checks = |a: [u8; 4], b: [u8; 4]| [[a, b].concat(), [b, a].concat()].concat();
/// let grass = Layer::new(checks([60, 110, 40, 255], [70, 120, 50, 255]), 8.0);
/// let rock = Layer::new(checks([110, 100, 95, 255], [125, 118, 110, 255]), 16.0);
/// let snow = Layer::plain(2, 0xf4f7fb);
/// let material = Layers::new(2)
///     .over(grass)
///     .over(snow.heights_m([1800.0, f32::INFINITY], 200.0))
///     .over(rock.slopes_deg([35.0, f32::INFINITY], 8.0))
///     .material()?;
/// # Ok::<(), terrasoar_render::RenderError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Layers {
    side_px: u32,
    layers: Vec<Layer>,
}

impl Layers {
    /// No layers yet, of textures with so many texels a side: a power of two, 4,096 at most.
    pub fn new(side_px: u32) -> Self {
        Self { side_px, layers: Vec::new() }
    }

    /// These layers with one over them.
    pub fn over(mut self, layer: Layer) -> Self {
        self.layers.push(layer);
        self
    }

    /// The material of these layers. Halves all textures down to one texel, which takes some 20 ms for a million texels.
    ///
    /// # Errors
    ///
    /// [`RenderError::Layer`] for a layer whose numbers or texels are none; [`RenderError::Usage`] for no layers, more than 16, or a side that is no power of two up to 4,096.
    pub fn material(&self) -> Result<Material> {
        if !self.side_px.is_power_of_two() || self.side_px > MOST_TEXELS {
            return Err(RenderError::Usage(
                "textures of layers have a power of two of texels a side, 4096 at most",
            ));
        }
        if !(1..=MOST_LAYERS).contains(&self.layers.len()) {
            return Err(RenderError::Usage("a material of layers has 1 to 16 of them"));
        }
        for (number, layer) in self.layers.iter().enumerate() {
            if let Some(message) = layer.fault(self.side_px) {
                return Err(RenderError::Layer { layer: number, message });
            }
        }
        let count = self.layers.len() as u32;
        let text = TEXT.replace("OWN_LAYERS", &format!("{count}u"));
        let side_px = self.side_px;
        let texels: Vec<u8> =
            self.layers.iter().flat_map(|layer| mip_levels(side_px, &layer.texels)).collect();
        let numbers: Vec<u8> =
            self.layers.iter().flat_map(Layer::numbers).flat_map(f32::to_le_bytes).collect();
        Ok(Material::new(&text)?.bindings(move |device, queue, layout| {
            bind(device, queue, layout, [side_px, count], &texels, &numbers)
        }))
    }
}

fn bind(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    layout: &wgpu::BindGroupLayout,
    [side_px, count]: [u32; 2],
    texels: &[u8],
    numbers: &[u8],
) -> wgpu::BindGroup {
    let textures = device.create_texture_with_data(
        queue,
        &wgpu::TextureDescriptor {
            label: Some("layers"),
            size: wgpu::Extent3d { width: side_px, height: side_px, depth_or_array_layers: count },
            mip_level_count: side_px.ilog2() + 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        texels,
    );
    let view = textures.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    // A software driver adds up every texel that a pixel covers, be it ten thousand.
    let is_software = device.adapter_info().device_type == wgpu::DeviceType::Cpu;
    let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("layers"),
        address_mode_u: wgpu::AddressMode::Repeat,
        address_mode_v: wgpu::AddressMode::Repeat,
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        anisotropy_clamp: if is_software { 1 } else { ANISOTROPY },
        ..Default::default()
    });
    let numbers = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("layers"),
        contents: numbers,
        usage: wgpu::BufferUsages::UNIFORM,
    });
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("layers"),
        layout,
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
            wgpu::BindGroupEntry { binding: 2, resource: numbers.as_entire_binding() },
        ],
    })
}

/// A texture and its halves down to one texel, one after the other. Means are of linear light.
fn mip_levels(side_px: u32, rgba: &[u8]) -> Vec<u8> {
    let linear: Vec<f32> = (0..256).map(|v| linear_of(v)[2]).collect();
    let mut all = rgba.to_vec();
    let mut side = side_px as usize;
    let mut level: Vec<[f32; 3]> = rgba
        .as_chunks::<4>()
        .0
        .iter()
        .map(|[r, g, b, _]| [r, g, b].map(|value| linear[usize::from(*value)]))
        .collect();
    while side > 1 {
        let half = side / 2;
        level = (0..half * half)
            .map(|i| {
                let first = 2 * (i / half) * side + 2 * (i % half);
                let four = [first, first + 1, first + side, first + side + 1].map(|place| level[place]);
                [0, 1, 2].map(|c| 0.25 * four.iter().map(|texel| texel[c]).sum::<f32>())
            })
            .collect();
        side = half;
        all.extend(level.iter().flat_map(|texel| {
            let [r, g, b] = texel.map(|value| nearest(&linear, value));
            [r, g, b, 255]
        }));
    }
    all
}

/// The byte whose light is nearest.
fn nearest(linear: &[f32], value: f32) -> u8 {
    let above = linear.partition_point(|light| *light < value).clamp(1, 255);
    let is_above = linear[above] - value < value - linear[above - 1];
    (above - usize::from(!is_above)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_means_of_light_down_to_one_texel() {
        let [black, white] = [[0, 0, 0, 255], [255, 255, 255, 255]];
        let checks = [black, white, white, black].concat();
        let levels = mip_levels(2, &checks);
        // Half the light of white is sRGB 188: 1.055 * 0.5^(1/2.4) - 0.055 = 0.7354, times 255 is 187.5.
        assert_eq!(levels.len(), 4 * (4 + 1));
        assert!((187..=188).contains(&levels[16]), "{levels:?}");
        let one = mip_levels(8, &[10, 100, 200, 255].repeat(64));
        assert_eq!(one.len(), 4 * (64 + 16 + 4 + 1));
        assert!(one.as_chunks::<4>().0.iter().all(|texel| *texel == [10, 100, 200, 255]));
    }

    #[test]
    fn wrong_layers_are_errors_in_words() {
        let good = || Layer::plain(4, 0x804020);
        let wrong = [
            (Layer::new(vec![0; 7], 1.0), "its texture has 7 bytes, 4 x 4 texels have 64"),
            (Layer { size_m: 0.0, ..good() }, "above 0"),
            (Layer { size_m: f32::NAN, ..good() }, "above 0"),
            (good().heights_m([5.0, 1.0], 0.0), "begins above its end"),
            (good().slopes_deg([f32::NAN, 1.0], 0.0), "begins above its end"),
            (good().heights_m([0.0, 1.0], -1.0), "0 or wider"),
            (good().opacity(1.5), "from 0 to 1, not 1.5"),
        ];
        for (layer, words) in wrong {
            let said = Layers::new(4).over(good()).over(layer).material().unwrap_err().to_string();
            assert!(said.starts_with("layer 1 of the material: ") && said.contains(words), "{said}");
        }
        assert!(Layers::new(4).material().is_err());
        assert!(Layers::new(3).over(Layer::plain(3, 0)).material().is_err());
        let many = (0..17).fold(Layers::new(1), |layers, _| layers.over(Layer::plain(1, 0)));
        assert!(many.material().is_err());
        let most = (0..16).fold(Layers::new(1), |layers, _| layers.over(Layer::plain(1, 0)));
        assert!(most.material().is_ok());
    }
}
