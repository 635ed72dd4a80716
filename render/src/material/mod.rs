//! The ground's colour by a function of the embedder's own.
//!
//! A material is a WGSL text with `fn material(at: GroundPoint) -> vec4<f32>`, and whatever else that function needs. The text is checked when the material is made, with the same compiler that
//! the device uses, so a mistake is an error with its line and no lost frame. What the function gets follows distance and place alone, not triangles: height as it is drawn, which
//! moves continuously, and slope from the tiles that light comes from.
//!
//! The text may declare uniform buffers, read-only storage, textures and samplers of group 1. Their layout is read off the text, and a function of the embedder's binds them, on each device anew.

mod check;
mod layers;

pub use layers::{Layer, Layers};

use crate::error::{RenderError, Result};
use crate::shaders;
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// Metres after which tiled textures are where they were: `shaders/frame.wgsl` has the same.
pub(crate) const TILED_M: f64 = 4096.0;

type Bind = dyn Fn(&wgpu::Device, &wgpu::Queue, &wgpu::BindGroupLayout) -> wgpu::BindGroup + Send + Sync;

/// What the ground is made of, as a function from place, height and slope to a colour.
///
/// ```
/// use terrasoar_render::Material;
///
/// let material = Material::new(
///     "fn material(at: GroundPoint) -> vec4<f32> {
///          let grass = vec3(0.10, 0.22, 0.05);
///          let rock = vec3(0.20, 0.18, 0.16);
///          return vec4(mix(grass, rock, smoothstep(30.0, 40.0, at.slope_deg)), 1.0);
///      }",
/// )?;
/// let wrong = Material::new("fn material(at: GroundPoint) -> vec4<f32> {\n    return vec4(at.hight_m);\n}");
/// assert!(wrong.unwrap_err().to_string().starts_with("line 2 of the material: "));
/// # Ok::<(), terrasoar_render::RenderError>(())
/// ```
///
/// # What the function is given
///
/// | field of `GroundPoint` | what |
/// |---|---|
/// | `place_m: vec2<f32>` | metres east and north of the terrain's south-west sample. Single precision: a hundred kilometres away it steps by 8 mm |
/// | `tiled_m: vec2<f32>` | the same without whole stretches of 4,096 m that lie below the eye. Precise everywhere. What is made of it must repeat every 4,096 m; `tiled` does so |
/// | `height_m: f32` | metres, before exaggeration |
/// | `slope_deg: f32` | steepness in degrees, 0 for level ground, before exaggeration |
/// | `normal: vec3<f32>` | upward unit normal, before exaggeration |
/// | `distance_m: f32` | metres from the eye |
/// | `colour: vec3<f32>` | colour that the look gives the place, linear light |
/// | `picture: vec4<f32>` | colour of the draped picture, linear light, and how much of it shows; 0 where there is none |
///
/// It gives a colour in linear light, before sun, contour lines and haze, and how much of it covers the look's own colour and the picture: 1 hides them, 0 leaves them.
///
/// Two functions are there to be called: `tiled(at, size_m)` gives coordinates for a repeating texture of so many metres, and `band(value, low, high, soft)` is 1 within a band and goes softly to 0
/// at both ends.
///
/// # Rules
///
/// * Names of your own begin with `own_` or `Own`, but for `material`. Other names may be the renderer's, now or in a later version.
/// * Bindings are of group 1. Textures of floats must be filterable, storage is read only.
/// * `textureSample` stands where all pixels come by, not in an `if` that depends on the place. `textureSampleGrad` and `textureSampleLevel` may stand anywhere.
#[derive(Clone)]
pub struct Material {
    text: Arc<str>,
    bindings: Arc<[wgpu::BindGroupLayoutEntry]>,
    first_binding_line: u32,
    bind: Option<Arc<Bind>>,
}

impl fmt::Debug for Material {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Material").field("text", &self.text).finish_non_exhaustive()
    }
}

impl Material {
    /// A material by its text. Takes a few milliseconds.
    ///
    /// # Errors
    ///
    /// [`RenderError::Material`] with the line for a text that is no WGSL, has no such function, or binds what a material cannot.
    pub fn new(wgsl: &str) -> Result<Self> {
        let found = check::bindings(wgsl)?;
        let first_binding_line = found.first().map_or(1, |found| found.line);
        let bindings = found.into_iter().map(|found| found.entry).collect();
        Ok(Self { text: wgsl.into(), bindings, first_binding_line, bind: None })
    }

    /// This material with what fills the bindings that its text declares. `bind` is called when the material is set, and on each further device: it makes buffers and textures there and a bind group of the layout
    /// that it is given. Keep the handle of the buffer that was made last (`wgpu::Buffer` is one) to write to it from frame to frame.
    ///
    /// ```no_run
    /// use terrasoar_render::{Material, wgpu};
    /// use wgpu::util::DeviceExt;
    ///
    /// let material = Material::new(
    ///     "@group(1) @binding(0) var<uniform> own_snow_line: vec4<f32>;
    ///      fn material(at: GroundPoint) -> vec4<f32> {
    ///          return vec4(vec3(0.8), smoothstep(-20.0, 20.0, at.height_m - own_snow_line.x));
    ///      }",
    /// )?
    /// .bindings(|device, _, layout| {
    ///     let snow_line_m = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
    ///         label: Some("snow line"),
    ///         contents: &[1800.0_f32, 0.0, 0.0, 0.0].map(f32::to_le_bytes).concat(),
    ///         usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
    ///     });
    ///     device.create_bind_group(&wgpu::BindGroupDescriptor {
    ///         label: Some("snow line"),
    ///         layout,
    ///         entries: &[wgpu::BindGroupEntry { binding: 0, resource: snow_line_m.as_entire_binding() }],
    ///     })
    /// });
    /// # Ok::<(), terrasoar_render::RenderError>(())
    /// ```
    pub fn bindings(
        self,
        bind: impl Fn(&wgpu::Device, &wgpu::Queue, &wgpu::BindGroupLayout) -> wgpu::BindGroup
        + Send
        + Sync
        + 'static,
    ) -> Self {
        Self { bind: Some(Arc::new(bind)), ..self }
    }

    /// What the material binds on a device; none where its text declares nothing.
    pub(crate) fn bind(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
    ) -> Result<Option<(wgpu::BindGroupLayout, wgpu::BindGroup)>> {
        if self.bindings.is_empty() {
            return Ok(None);
        }
        let Some(bind) = &self.bind else {
            return Err(RenderError::Material {
                line: self.first_binding_line,
                message: "it declares a binding and was given nothing to bind; Material::bindings takes the function that does".into(),
            });
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("material"),
            entries: &self.bindings,
        });
        let group = bind(device, queue, &layout);
        Ok(Some((layout, group)))
    }

    /// The ground's program with this material in it.
    pub(crate) fn module(&self, device: &wgpu::Device) -> wgpu::ShaderModule {
        device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("terrain with a material"),
            source: wgpu::ShaderSource::Wgsl(Cow::Owned(format!("{}{}", shaders::GROUND, self.text))),
        })
    }
}
