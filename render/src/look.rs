//! How a frame looks, as plain values: every field may change from frame to frame, and none changes the mesh.

use crate::ramps::{RAMPS, Ramp, linear_of};

/// What the ground's colour says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Surface {
    /// Height, by the ramp, with bare rock on steep ground.
    #[default]
    Tint,
    /// Nothing: one grey, so that light alone shows the form.
    Plain,
    /// Slope, by the ramp from level to 60 degrees.
    Slope,
    /// Level of detail: the level of each triangle's finest corner.
    Level,
    /// Screen error: by how much each triangle's finest corner is above the tolerance it had to exceed to be in the mesh, by the ramp from none to four octaves.
    ScreenError,
}

/// The sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Direction in radians, clockwise from north.
    pub azimuth_rad: f32,
    /// Height above the horizon in radians; night below 0.
    pub elevation_rad: f32,
    /// Strength of its light; 0 for none. About 1 is natural.
    pub strength: f32,
    /// Strength of the sky's light, which reaches shadows too.
    pub ambient: f32,
}

impl Default for Sun {
    /// From the north-west, where cartographers put it, at 38 degrees.
    fn default() -> Self {
        Self {
            azimuth_rad: 312f32.to_radians(),
            elevation_rad: 38f32.to_radians(),
            strength: 1.3,
            ambient: 0.42,
        }
    }
}

/// How far one sees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Haze {
    /// For ever.
    Off,
    /// So that the far side of the terrain is still seen.
    #[default]
    Auto,
    /// Metres after which about a third of a thing's own light is left; above 0.
    Distance(f32),
}

/// Contour lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contours {
    /// Metres of height from line to line, above 0.
    pub interval_m: f32,
    /// Every so manieth line is an index line, twice as wide and darker.
    pub index_every: u32,
    /// Width of a line in pixels.
    pub width_px: f32,
    /// Colour, linear light.
    pub colour: [f32; 3],
    /// Share of the ground that a line covers, 0 to 1.
    pub opacity: f32,
}

impl Default for Contours {
    fn default() -> Self {
        Self { interval_m: 100.0, index_every: 5, width_px: 1.0, colour: linear_of(0x4a3423), opacity: 0.75 }
    }
}

/// Edges of the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wireframe {
    /// Width in pixels.
    pub width_px: f32,
    /// Colour, linear light.
    pub colour: [f32; 3],
    /// Share of the ground that a line covers, 0 to 1.
    pub opacity: f32,
}

impl Default for Wireframe {
    fn default() -> Self {
        Self { width_px: 1.0, colour: linear_of(0x16202b), opacity: 0.65 }
    }
}

/// Everything about how a frame looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// What the ground's colour says.
    pub surface: Surface,
    /// Colours of heights, slopes or errors.
    pub ramp: &'static Ramp,
    /// Heights in metres of the ramp's two ends; by default the terrain's lowest and highest.
    pub tint_range_m: Option<[f32; 2]>,
    /// How much rock shows on steep ground, 0 to 1.
    pub rock: f32,
    /// Share of the image, where one is set ([`crate::Renderer::set_imagery`]), in the ground's colour: 0 (off) to 1.
    pub imagery: f32,
    /// Share of light and shade, 0 (bare colours) to 1.
    pub shading: f32,
    /// The sun.
    pub sun: Sun,
    /// Sky colours at the zenith and at the horizon, linear light. The horizon's is the haze's too.
    pub sky: [[f32; 3]; 2],
    /// How far one sees.
    pub haze: Haze,
    /// Contour lines, if any.
    pub contours: Option<Contours>,
    /// Edges of the triangles, if any.
    pub wireframe: Option<Wireframe>,
    /// Vertices move into place as the eye comes nearer, instead of popping up.
    pub morph: bool,
    /// Normals come from tiles where there are any, else from triangles.
    pub tile_normals: bool,
    /// Four samples a pixel at edges. Costs fill rate; slow on software drivers.
    pub multisample: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            surface: Surface::Tint,
            ramp: &RAMPS[0],
            tint_range_m: None,
            rock: 0.7,
            imagery: 0.0,
            shading: 1.0,
            sun: Sun::default(),
            sky: [linear_of(0x2f68b0), linear_of(0xcfdce8)],
            haze: Haze::Auto,
            contours: None,
            wireframe: None,
            morph: true,
            tile_normals: true,
            multisample: false,
        }
    }
}

/// Names of the prepared looks and a line about each; the first is the default.
pub const LOOKS: &[(&str, &str)] = &[
    ("relief", "tint by height, sun, haze"),
    ("hillshade", "light and shade alone"),
    ("photo", "the image where there is one, else a plainer relief"),
    ("contours", "tint by height with contour lines"),
    ("slope", "steepness from level to 60 degrees"),
    ("wireframe", "the relief with the edges of its triangles"),
    ("levels", "level of detail of each triangle, with edges"),
    ("error", "by how much each triangle was needed"),
];

impl Look {
    /// A prepared look by its name in [`LOOKS`].
    pub fn named(name: &str) -> Option<Self> {
        let relief = Self::default();
        let survey = Self { haze: Haze::Off, rock: 0.0, ..relief };
        let thin = Wireframe { opacity: 0.4, ..Wireframe::default() };
        Some(match name {
            "relief" => relief,
            "photo" => Self { imagery: 1.0, rock: 0.35, ..relief },
            "hillshade" => Self { surface: Surface::Plain, ..relief },
            "contours" => Self { contours: Some(Contours::default()), rock: 0.3, ..relief },
            "slope" => Self {
                surface: Surface::Slope,
                ramp: Ramp::named("heat").unwrap_or(relief.ramp),
                shading: 0.5,
                ..survey
            },
            "wireframe" => Self { wireframe: Some(Wireframe::default()), ..relief },
            "levels" => Self { surface: Surface::Level, wireframe: Some(thin), shading: 0.6, ..survey },
            "error" => Self {
                surface: Surface::ScreenError,
                ramp: Ramp::named("viridis").unwrap_or(relief.ramp),
                wireframe: Some(thin),
                shading: 0.5,
                ..survey
            },
            _ => return None,
        })
    }

    /// Whether triangles need vertices of their own.
    pub(crate) fn needs_own_vertices(&self) -> bool {
        self.wireframe.is_some() || matches!(self.surface, Surface::Level | Surface::ScreenError)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_listed_look_exists() {
        for (name, _) in LOOKS {
            assert!(Look::named(name).is_some(), "{name}");
        }
        assert_eq!(Look::named(LOOKS[0].0), Some(Look::default()));
        assert_eq!(Look::named("none such"), None);
    }
}
