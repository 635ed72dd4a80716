//! Pictures without a window: a device, a scene and a texture to draw to.
//!
//! **Equal views give equal bytes on one driver**, whatever was drawn before: all tiles are given before a picture is taken. A device that is lost
//! on the way is replaced once; the picture is drawn again on the new one.

use super::scene::{Scene, SceneError, SceneOptions};
use terrasoar::ground::{Ground, PictureEngine, Refined};
use terrasoar::refine::Culling;
use terrasoar::view::{View, Viewport};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{Capabilities, Gpu, Look, Material, Offscreen, RenderError};

/// Takes pictures of one terrain, all of one size.
pub struct Studio<'a> {
    gpu: Gpu,
    ground: Ground<'a>,
    scene: Scene,
    offscreen: Offscreen,
    viewport: Viewport,
}

impl<'a> Studio<'a> {
    /// A studio for a terrain, on the best adapter there is. Pages of one that does not lend its records are read as views need them, into [128 MiB](terrasoar_layout::read::kinds::CACHE_BYTES).
    ///
    /// # Errors
    /// [`SceneError::Render`] with [`RenderError::NoAdapter`] where there is none, which says what to install; a size that the device cannot have;
    /// [`SceneError::Layout`] for damage and I/O.
    pub fn new(
        terrain: &'a Terrain,
        engine: PictureEngine,
        culling: Culling,
        viewport: Viewport,
    ) -> Result<Self, SceneError> {
        Self::reading(terrain, engine, culling, viewport, None)
    }

    /// As [`Studio::new`], with pages that are read into `cache_bytes` of memory as views need them, whatever the terrain; with `None` it is the same.
    ///
    /// # Errors
    /// As [`Studio::new`].
    pub fn reading(
        terrain: &'a Terrain,
        engine: PictureEngine,
        culling: Culling,
        viewport: Viewport,
        cache_bytes: Option<u64>,
    ) -> Result<Self, SceneError> {
        let gpu = Gpu::headless_blocking()?;
        let ground = Ground::reading(terrain, engine, culling, cache_bytes)?;
        let scene = Scene::new(&ground, &gpu, SceneOptions::default())?;
        let offscreen = offscreen(&gpu, viewport)?;
        Ok(Self { gpu, ground, scene, offscreen, viewport })
    }

    /// Brings the mesh to a view, without a picture.
    pub fn fly(&mut self, view: &View) -> Refined {
        self.ground.update(view)
    }

    /// Makes the terrain a block: walls from its border down to `bottom_m`, heights before exaggeration.
    ///
    /// # Errors
    /// As [`Scene::raise_walls`].
    pub fn raise_walls(&mut self, bottom_m: f64) -> Result<(), SceneError> {
        self.scene.raise_walls(&self.ground, bottom_m as f32)
    }

    /// Gives the ground a material of your own, or takes it off.
    ///
    /// # Errors
    /// As [`Scene::set_material`].
    pub fn set_material(&mut self, material: Option<Material>) -> Result<(), SceneError> {
        self.scene.set_material(material)
    }

    /// A picture of the mesh as it is: three bytes a pixel, row by row from the top.
    ///
    /// # Errors
    /// [`SceneError::Render`]; [`SceneError::Layout`] if the ground that was flown over could not be read.
    pub fn picture(&mut self, view: &View, look: &Look) -> Result<Vec<u8>, SceneError> {
        match self.try_picture(view, look) {
            Err(SceneError::Render(RenderError::DeviceLost { .. })) => {
                self.gpu = Gpu::headless_blocking()?;
                self.offscreen = offscreen(&self.gpu, self.viewport)?;
                self.scene.recover(&self.gpu)?;
                self.try_picture(view, look)
            }
            done => done,
        }
    }

    fn try_picture(&mut self, view: &View, look: &Look) -> Result<Vec<u8>, SceneError> {
        let Gpu { device, queue, watch, .. } = &self.gpu;
        let mut encoder = device.create_command_encoder(&Default::default());
        self.scene.sync(&mut self.ground, &mut encoder, view, look)?;
        self.ground.take_error().map_or(Ok(()), Err)?;
        self.scene.draw(&mut encoder, self.offscreen.target(), view, look, None)?;
        queue.submit([encoder.finish()]);
        let rgba = self.offscreen.read_rgba(device, queue);
        // What the watch has seen is the cause, where reading failed too.
        watch.check()?;
        Ok(rgba?.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect())
    }

    /// Whether an image is draped over the terrain.
    pub fn has_image(&self) -> bool {
        self.scene.has_image()
    }

    /// The device, to make buffers and textures for a material on it. After its loss [`Studio::picture`] goes on with another.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The device's adapter.
    pub fn capabilities(&self) -> &Capabilities {
        &self.gpu.capabilities
    }
}

fn offscreen(gpu: &Gpu, viewport: Viewport) -> Result<Offscreen, RenderError> {
    Offscreen::new(&gpu.device, viewport.size_px())
}
