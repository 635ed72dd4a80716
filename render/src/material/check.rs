//! Whether a material's text is one, and what it binds, without a device.

use crate::error::{RenderError, Result};
use crate::shaders;
use std::error::Error;
use std::num::NonZeroU32;
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
use wgpu::naga::{
    self, AddressSpace, ImageClass, ImageDimension, Module, ScalarKind, Span, StorageAccess, TypeInner,
};

/// What is said where the text itself is sound and the function is not the one that is called.
const NO_FUNCTION: &str =
    "it needs a function `fn material(at: GroundPoint) -> vec4<f32>`, of just that name, argument and result";

/// A binding that the text declares.
#[derive(Debug)]
pub(super) struct Found {
    /// Line of the text.
    pub line: u32,
    pub entry: wgpu::BindGroupLayoutEntry,
}

/// The bindings of a sound text, in its order.
pub(super) fn bindings(text: &str) -> Result<Vec<Found>> {
    let text = Text { text, whole: format!("{}{text}", shaders::GROUND) };
    let module = naga::front::wgsl::parse_str(&text.whole).map_err(|error| {
        // The first span within the text: a second definition of a name is told with the first one's place too.
        let spans = error.labels().map(|(span, _)| span);
        text.error(spans, error.message())
    })?;
    text.check_declarations(&module)?;
    Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).map_err(|error| {
        let mut cause: &dyn Error = error.as_inner();
        while let Some(deeper) = cause.source() {
            cause = deeper;
        }
        let message = cause.to_string();
        text.error(error.spans().map(|(span, _)| *span), &message)
    })?;
    text.found(&module)
}

/// A material's text, and the program that it is the end of.
struct Text<'t> {
    text: &'t str,
    whole: String,
}

impl Text<'_> {
    /// The line of the text that a place is in, if it is in the text.
    fn line(&self, span: Span) -> Option<u32> {
        let start = span.to_range()?.start.checked_sub(shaders::GROUND.len())?;
        let before = self.text.get(..start).unwrap_or(self.text);
        Some(1 + before.matches('\n').count() as u32)
    }

    fn error(&self, mut spans: impl Iterator<Item = Span>, message: &str) -> RenderError {
        match spans.find_map(|span| self.line(span)) {
            Some(line) => wrong(line, message.lines().map(str::trim).collect::<Vec<_>>().join("; ")),
            None => wrong(1, NO_FUNCTION.into()),
        }
    }

    /// Declarations that a material cannot have.
    fn check_declarations(&self, module: &Module) -> Result<()> {
        for (handle, _) in module.overrides.iter() {
            if let Some(line) = self.line(module.overrides.get_span(handle)) {
                return Err(wrong(
                    line,
                    "`override` is not possible here; use `const`, or a uniform buffer".into(),
                ));
            }
        }
        Ok(())
    }

    fn found(&self, module: &Module) -> Result<Vec<Found>> {
        let mut found: Vec<Found> = Vec::new();
        for (handle, variable) in module.global_variables.iter() {
            let Some(line) = self.line(module.global_variables.get_span(handle)) else { continue };
            let Some(place) = &variable.binding else {
                if variable.space == AddressSpace::Private {
                    continue;
                }
                return Err(wrong(line, "a variable of this kind is not possible here".into()));
            };
            if place.group != 1 {
                let said =
                    format!("bindings of a material are of group 1, this one is of group {}", place.group);
                return Err(wrong(line, said));
            }
            if found.iter().any(|other| other.entry.binding == place.binding) {
                return Err(wrong(line, format!("binding {} is declared twice", place.binding)));
            }
            let inner = &module.types[variable.ty].inner;
            let (ty, count) = binding_type(variable.space, inner).ok_or_else(|| {
                wrong(
                    line,
                    "a material binds uniform buffers, read-only storage, textures and samplers alone".into(),
                )
            })?;
            let visibility = wgpu::ShaderStages::FRAGMENT;
            found.push(Found {
                line,
                entry: wgpu::BindGroupLayoutEntry { binding: place.binding, visibility, ty, count },
            });
        }
        Ok(found)
    }
}

fn wrong(line: u32, message: String) -> RenderError {
    RenderError::Material { line, message }
}

fn binding_type(space: AddressSpace, inner: &TypeInner) -> Option<(wgpu::BindingType, Option<NonZeroU32>)> {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let ty = match (space, inner) {
        (AddressSpace::Uniform, _) => buffer(wgpu::BufferBindingType::Uniform),
        (AddressSpace::Storage { access: StorageAccess::LOAD }, _) => {
            buffer(wgpu::BufferBindingType::Storage { read_only: true })
        }
        (AddressSpace::Handle, TypeInner::Sampler { comparison: false }) => {
            wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)
        }
        (AddressSpace::Handle, TypeInner::Sampler { comparison: true }) => {
            wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison)
        }
        (AddressSpace::Handle, TypeInner::Image { dim, arrayed, class }) => {
            let view_dimension = match (dim, arrayed) {
                (ImageDimension::D1, _) => wgpu::TextureViewDimension::D1,
                (ImageDimension::D2, false) => wgpu::TextureViewDimension::D2,
                (ImageDimension::D2, true) => wgpu::TextureViewDimension::D2Array,
                (ImageDimension::D3, _) => wgpu::TextureViewDimension::D3,
                (ImageDimension::Cube, false) => wgpu::TextureViewDimension::Cube,
                (ImageDimension::Cube, true) => wgpu::TextureViewDimension::CubeArray,
            };
            let sample_type = match class {
                ImageClass::Sampled { kind: ScalarKind::Float, multi: false } => {
                    wgpu::TextureSampleType::Float { filterable: true }
                }
                ImageClass::Sampled { kind: ScalarKind::Sint, multi: false } => wgpu::TextureSampleType::Sint,
                ImageClass::Sampled { kind: ScalarKind::Uint, multi: false } => wgpu::TextureSampleType::Uint,
                ImageClass::Depth { multi: false } => wgpu::TextureSampleType::Depth,
                _ => return None,
            };
            wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false }
        }
        _ => return None,
    };
    Some((ty, None))
}
