//! How a picture is made: the flags that `snapshot` and `movie` share.

use super::parse;
use anyhow::{Context, Result, bail};
use clap::ArgAction;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::flyover::Quality;
use terrasoar::ground::PictureEngine;
use terrasoar::refine::Culling;
use terrasoar::view::{View, Viewport};
use terrasoar_lab::picture::encode_with;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::ramps::{RAMPS, Ramp};
use terrasoar_render::{LOOKS, Look};
use terrasoar_scene::scene::SceneError;
use terrasoar_scene::studio::Studio;

/// The style of a terrain with an image.
const PHOTO: &str = "photo";

/// Size, precision and looks.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct PictureArgs {
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse::viewport)]
    pub size: Viewport,
    /// How the ground looks; without it photo where the terrain has an image, else relief
    #[arg(long, value_name = "STYLE", value_parser = style())]
    pub style: Option<String>,
    /// How much of the terrain's image shows, from 0 to 1; the style has its own without it
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub image: Option<f32>,
    /// Colours of heights, slopes or errors; the style has its own without it
    #[arg(long, value_name = "RAMP", value_parser = ramp())]
    pub ramp: Option<&'static Ramp>,
    /// Multiply heights by this factor
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse::exaggeration)]
    pub exaggeration: f64,
    /// Largest error on the screen in pixels
    #[arg(long, value_name = "PX", default_value = "1", value_parser = parse::tolerance_px)]
    pub tolerance_px: f64,
    /// Whether vertices move into place as the eye comes nearer, or appear there
    #[arg(long, value_name = "ON|OFF", default_value = "on", action = ArgAction::Set, value_parser = switch())]
    pub morph: bool,
    /// Where the light comes from: degrees clockwise from north, and above the horizon
    #[arg(long, value_name = "AZ,EL", value_parser = sun, allow_hyphen_values = true)]
    pub sun: Option<[f64; 2]>,
    /// Draw contour lines so many metres apart
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    pub contours: Option<f64>,
    /// Engine: kinetic (the mesh changes from frame to frame) or soar (the whole mesh anew); the pictures are the same
    #[arg(long, value_name = "ENGINE", default_value = "kinetic", value_parser = engine())]
    pub engine: PictureEngine,
    /// What is left out of view: vertices (the mesh is coarse there) or clusters (the mesh is refined all around, clusters are not drawn)
    #[arg(long, value_name = "WHAT", default_value = Culling::default().name(), value_parser = parse::culling())]
    pub culling: Culling,
}

impl PictureArgs {
    /// Name of the style of a terrain, with an image or without.
    pub(super) fn style(&self, has_image: bool) -> &str {
        match &self.style {
            Some(style) => style,
            None if has_image => PHOTO,
            None => LOOKS[0].0,
        }
    }

    /// How a terrain looks, with an image or without. Edges are smooth.
    pub(super) fn look(&self, has_image: bool) -> Look {
        let mut look = Look::named(self.style(has_image)).unwrap_or_default();
        look.imagery = self.image.unwrap_or(look.imagery);
        look.ramp = self.ramp.unwrap_or(look.ramp);
        look.morph = self.morph;
        look.multisample = true;
        if let Some([azimuth_deg, elevation_deg]) = self.sun {
            look.sun = look
                .sun
                .azimuth_rad(azimuth_deg.to_radians() as f32)
                .elevation_rad(elevation_deg.to_radians() as f32);
        }
        if let Some(metres) = self.contours {
            let lines = look.contours.unwrap_or_default();
            look.contours = Some(lines.interval_m(metres as f32));
        }
        look
    }

    /// A view at this tolerance and exaggeration.
    pub(super) fn refine(&self, view: View) -> View {
        View { tolerance_px: self.tolerance_px, vertical_exaggeration: self.exaggeration, ..view }
    }

    /// A studio for `terrain`.
    pub(super) fn studio<'t>(&self, terrain: &'t Terrain) -> Result<Studio<'t>, SceneError> {
        Studio::new(terrain, self.engine, self.culling, self.size)
    }

    /// The engine's word.
    pub(super) fn engine_name(&self) -> &'static str {
        match self.engine {
            PictureEngine::Kinetic => "kinetic",
            PictureEngine::Soar => "soar",
        }
    }
}

fn share(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("give a number from 0 to 1".into()),
    }
}

pub(super) fn style() -> impl TypedValueParser<Value = String> {
    PossibleValuesParser::new(LOOKS.iter().map(|(name, about)| PossibleValue::new(*name).help(*about)))
}

pub(super) fn ramp() -> impl TypedValueParser<Value = &'static Ramp> {
    PossibleValuesParser::new(RAMPS.iter().map(|ramp| ramp.name))
        .map(|name| Ramp::named(&name).unwrap_or(&RAMPS[0]))
}

fn engine() -> impl TypedValueParser<Value = PictureEngine> {
    PossibleValuesParser::new(["kinetic", "soar"])
        .map(|name| if name == "soar" { PictureEngine::Soar } else { PictureEngine::Kinetic })
}

fn switch() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|word| word == "on")
}

/// Two angles: an azimuth of any turn and an elevation from -90 to 90 degrees.
fn sun(text: &str) -> Result<[f64; 2], String> {
    let [azimuth, elevation] = angles(text)?;
    if (-90.0..=90.0).contains(&elevation) {
        Ok([azimuth, elevation])
    } else {
        Err("the second number, degrees above the horizon, must be from -90 to 90".into())
    }
}

/// Two numbers of degrees.
pub(super) fn angles(text: &str) -> Result<[f64; 2], String> {
    let (first, second) = text.split_once(',').ok_or("give two numbers of degrees, such as 312,38")?;
    Ok([parse::finite(first)?, parse::finite(second)?])
}

/// Three bytes a pixel as the bytes of a PNG file.
pub(super) fn png(rgb: &[u8], size: Viewport) -> Result<Vec<u8>> {
    png_with(rgb, size, &[])
}

/// As [`png`], with texts in it.
pub(super) fn png_with(rgb: &[u8], size: Viewport, texts: &[(&'static str, String)]) -> Result<Vec<u8>> {
    encode_with(rgb, size.size_px(), texts).context("the picture is incomplete")
}

/// Draws a frame of a flight, flown to it; gives the bytes of a PNG file and the adapter's name.
pub(super) fn draw_frame(
    terrain: &Terrain,
    flight: &Flight,
    frame: usize,
    quality: Quality,
) -> Result<(Vec<u8>, String)> {
    let mut studio = Studio::new(terrain, PictureEngine::default(), quality.culling, quality.viewport)?;
    let view = |frame: &FlightFrame| View {
        vertical_exaggeration: quality.vertical_exaggeration,
        ..frame.view(quality.viewport, quality.tolerance_px)
    };
    let Some(asked) = flight.frames.get(frame) else { bail!("the flight has no frame {frame}") };
    for flown in &flight.frames[..=frame] {
        studio.fly(&view(flown));
    }
    let look = Look::default().multisample(true);
    let rgb = studio.picture(&view(asked), &look)?;
    Ok((png(&rgb, quality.viewport)?, studio.capabilities().adapter.clone()))
}
