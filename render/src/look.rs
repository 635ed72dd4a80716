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
#[non_exhaustive]
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

impl Sun {
    /// This sun with its light from another direction in radians, clockwise from north.
    pub fn azimuth_rad(self, azimuth_rad: f32) -> Self {
        Self { azimuth_rad, ..self }
    }

    /// This sun with another height above the horizon in radians.
    pub fn elevation_rad(self, elevation_rad: f32) -> Self {
        Self { elevation_rad, ..self }
    }

    /// This sun with light of another strength.
    pub fn strength(self, strength: f32) -> Self {
        Self { strength, ..self }
    }

    /// This sun with light of the sky of another strength.
    pub fn ambient(self, ambient: f32) -> Self {
        Self { ambient, ..self }
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

impl Haze {
    /// Metres after which about a third of a thing's own light is left, over a terrain of some diagonal in metres; `None` where there is no haze.
    pub fn distance_m(self, diagonal_m: f64) -> Option<f64> {
        match self {
            Self::Off => None,
            // A small terrain keeps its far side; a large one ends in the air of a clear day.
            Self::Auto => Some((3.0 * diagonal_m).min(110_000.0)),
            Self::Distance(metres) => Some(f64::from(metres)),
        }
    }

    /// Metres of height after which air with such a distance of sight has a third of its density: thin enough that a map seen from above is clear, thick enough that valleys are hazier than summits, and
    /// never thicker than the Earth's.
    pub fn scale_height_m(distance_m: f64) -> f64 {
        (0.12 * distance_m).min(8000.0)
    }
}

/// Contour lines.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Contours {
    /// Metres of height from line to line, above 0.
    pub interval_m: f32,
    /// Each line whose number is a multiple of this is an index line, twice as wide and darker.
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

impl Contours {
    /// These contours with so many metres of height from line to line.
    pub fn interval_m(self, interval_m: f32) -> Self {
        Self { interval_m, ..self }
    }

    /// These contours with another distance of index lines, counted in lines.
    pub fn index_every(self, index_every: u32) -> Self {
        Self { index_every, ..self }
    }

    /// These contours with lines of so many pixels.
    pub fn width_px(self, width_px: f32) -> Self {
        Self { width_px, ..self }
    }

    /// These contours with lines of another colour, in linear light.
    pub fn colour(self, colour: [f32; 3]) -> Self {
        Self { colour, ..self }
    }

    /// These contours with lines that cover another share of the ground.
    pub fn opacity(self, opacity: f32) -> Self {
        Self { opacity, ..self }
    }
}

/// Edges of the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
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

impl Wireframe {
    /// These edges with lines of so many pixels.
    pub fn width_px(self, width_px: f32) -> Self {
        Self { width_px, ..self }
    }

    /// These edges with lines of another colour, in linear light.
    pub fn colour(self, colour: [f32; 3]) -> Self {
        Self { colour, ..self }
    }

    /// These edges with lines that cover another share of the ground.
    pub fn opacity(self, opacity: f32) -> Self {
        Self { opacity, ..self }
    }
}

/// Everything about how a frame looks.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
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
    /// Share of the material, where one is set ([`crate::Renderer::set_material`]), in the ground's colour: 0 (off) to 1, the default.
    pub material: f32,
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
            material: 1.0,
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

impl Look {
    /// This look with colours that say something else.
    pub fn surface(self, surface: Surface) -> Self {
        Self { surface, ..self }
    }

    /// This look with other colours of heights, slopes or errors.
    pub fn ramp(self, ramp: &'static Ramp) -> Self {
        Self { ramp, ..self }
    }

    /// This look with heights in metres for the ramp's two ends.
    pub fn tint_range_m(self, tint_range_m: [f32; 2]) -> Self {
        Self { tint_range_m: Some(tint_range_m), ..self }
    }

    /// This look with another share of rock on steep ground, 0 to 1.
    pub fn rock(self, rock: f32) -> Self {
        Self { rock, ..self }
    }

    /// This look with another share of the image in the ground's colour, 0 to 1.
    pub fn imagery(self, imagery: f32) -> Self {
        Self { imagery, ..self }
    }

    /// This look with another share of the material in the ground's colour, 0 to 1.
    pub fn material(self, material: f32) -> Self {
        Self { material, ..self }
    }

    /// This look with another share of light and shade, 0 to 1.
    pub fn shading(self, shading: f32) -> Self {
        Self { shading, ..self }
    }

    /// This look with another sun.
    pub fn sun(self, sun: Sun) -> Self {
        Self { sun, ..self }
    }

    /// This look with other colours of the sky at the zenith and at the horizon, in linear light.
    pub fn sky(self, sky: [[f32; 3]; 2]) -> Self {
        Self { sky, ..self }
    }

    /// This look with another sight.
    pub fn haze(self, haze: Haze) -> Self {
        Self { haze, ..self }
    }

    /// This look with contour lines.
    pub fn contours(self, contours: impl Into<Option<Contours>>) -> Self {
        Self { contours: contours.into(), ..self }
    }

    /// This look with edges of the triangles.
    pub fn wireframe(self, wireframe: impl Into<Option<Wireframe>>) -> Self {
        Self { wireframe: wireframe.into(), ..self }
    }

    /// This look with vertices that move into place, or pop up.
    pub fn morph(self, morph: bool) -> Self {
        Self { morph, ..self }
    }

    /// This look with normals from tiles where there are any, or from triangles alone.
    pub fn tile_normals(self, tile_normals: bool) -> Self {
        Self { tile_normals, ..self }
    }

    /// This look with four samples a pixel at edges, or one.
    pub fn multisample(self, multisample: bool) -> Self {
        Self { multisample, ..self }
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
