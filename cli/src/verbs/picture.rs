//! How a picture is made: the flags that `snapshot` and `movie` share.

use super::{WrongUsage, parse, within};
use anyhow::{Context, Result, bail};
use clap::ArgAction;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::flyover::Quality;
use terrasoar::ground::PictureEngine;
use terrasoar::refine::Culling;
use terrasoar::view::{ErrorMetric, View, Viewport};
use terrasoar_lab::picture::encode_for_print;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::ramps::{RAMPS, Ramp};
use terrasoar_render::{Haze, LOOKS, Look};
use terrasoar_scene::scene::SceneError;
use terrasoar_scene::studio::Studio;

/// Metres of an inch.
pub(super) const INCH_M: f64 = 0.0254;
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
    /// How errors are measured on the screen: ball (as if all were seen from the side) or sight (along the line of sight, where heights show the less the steeper one looks down)
    #[arg(long, value_name = "METRIC", default_value = ErrorMetric::default().name(), value_parser = parse::metric())]
    pub metric: ErrorMetric,
    /// Whether vertices move into place as the eye comes nearer, or appear there
    #[arg(long, value_name = "ON|OFF", default_value = "on", action = ArgAction::Set, value_parser = switch())]
    pub morph: bool,
    /// Where the light comes from: degrees clockwise from north, and above the horizon
    #[arg(long, value_name = "AZ,EL", value_parser = sun, allow_hyphen_values = true)]
    pub sun: Option<[f64; 2]>,
    /// Draw contour lines so many metres apart
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    pub contours: Option<f64>,
    /// Width of contour lines in pixels, 1 without it; needs --contours or the style contours
    #[arg(long, value_name = "PX", value_parser = line_width)]
    pub contour_width: Option<f64>,
    /// How far one sees: auto (the far side is still seen), off (for ever), or metres after which a third of a thing's own light is left; the style has its own without it
    #[arg(long, value_name = "auto|off|METRES", value_parser = haze)]
    pub haze: Option<Haze>,
    /// Heights in metres of the ramp's two ends, or stretch for the terrain's lowest and highest. Without it that too, but alpine, atlas and arctic span 1000 m at least, for
    /// what they say of meadows and snow
    #[arg(long, value_name = "LOW,HIGH|stretch", value_parser = ramp_range, allow_hyphen_values = true)]
    pub ramp_range: Option<RampRange>,
    /// Engine: kinetic (the mesh changes from frame to frame) or soar (the whole mesh anew); they draw the same triangles
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

    /// Refuses flags that mean nothing together.
    pub(super) fn check(&self) -> Result<(), WrongUsage> {
        let has_lines = self.contours.is_some()
            || self.style.as_deref().and_then(Look::named).is_some_and(|look| look.contours.is_some());
        if self.contour_width.is_some() && !has_lines {
            return Err(WrongUsage("--contour-width needs --contours METRES, or --style contours".into()));
        }
        Ok(())
    }

    /// How a terrain with heights from the lowest to the highest looks, with an image or without. Edges are smooth.
    pub(super) fn look(&self, has_image: bool, height_range_m: [f64; 2]) -> Look {
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
        if let Some(width) = self.contour_width {
            look.contours = look.contours.map(|lines| lines.width_px(width as f32));
        }
        look.haze = self.haze.unwrap_or(look.haze);
        let height_range_m = height_range_m.map(|metres| metres as f32);
        look.tint_range_m = Some(match self.ramp_range {
            None => look.ramp.range_m(height_range_m),
            Some(RampRange::Stretch) => height_range_m,
            Some(RampRange::Metres(range_m)) => range_m,
        });
        look
    }

    /// A view at this tolerance and exaggeration, with errors measured in this way.
    pub(super) fn refine(&self, view: View) -> View {
        let view = view.tolerance_px(self.tolerance_px).metric(self.metric);
        view.exaggeration(self.exaggeration)
    }

    /// A studio for `terrain`, whose pages are read into so much memory where it is given.
    pub(super) fn studio<'t>(
        &self,
        terrain: &'t Terrain,
        cache_bytes: Option<u64>,
    ) -> Result<Studio<'t>, SceneError> {
        Studio::reading(terrain, self.engine, self.culling, self.size, cache_bytes)
    }

    /// The engine's word.
    pub(super) fn engine_name(&self) -> &'static str {
        match self.engine {
            PictureEngine::Kinetic => "kinetic",
            PictureEngine::Soar => "soar",
        }
    }
}

/// Which heights the ends of a ramp are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RampRange {
    /// The terrain's lowest and highest.
    Stretch,
    /// These.
    Metres([f32; 2]),
}

fn ramp_range(text: &str) -> Result<RampRange, String> {
    if text == "stretch" {
        return Ok(RampRange::Stretch);
    }
    let (low, high) = text.split_once(',').ok_or("give two heights in metres, such as 0,4000, or stretch")?;
    match [parse::finite(low)?, parse::finite(high)?].map(|metres| metres as f32) {
        [low, high] if low < high && low.is_finite() && high.is_finite() => {
            Ok(RampRange::Metres([low, high]))
        }
        _ => Err("the first height must be lower than the second".into()),
    }
}

fn haze(text: &str) -> Result<Haze, String> {
    match text {
        "auto" => Ok(Haze::Auto),
        "off" => Ok(Haze::Off),
        metres => match parse::positive(metres) {
            Ok(metres) if metres <= 1e9 => Ok(Haze::Distance(metres as f32)),
            _ => Err("give auto, off, or metres above 0 and at most 1e9".into()),
        },
    }
}

fn line_width(text: &str) -> Result<f64, String> {
    let width = parse::positive(text)?;
    if (0.1..=50.0).contains(&width) { Ok(width) } else { Err("it must be from 0.1 to 50 pixels".into()) }
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
    png_with(rgb, size, &[], None)
}

/// As [`png`], with texts in it, and how many pixels an inch has when it is printed.
pub(super) fn png_with(
    rgb: &[u8],
    size: Viewport,
    texts: &[(&'static str, String)],
    dpi: Option<f64>,
) -> Result<Vec<u8>> {
    let pixels_per_m = dpi.map(|dpi| (dpi / INCH_M).round() as u32);
    encode_for_print(rgb, size.size_px(), texts, pixels_per_m).context("the picture is incomplete")
}

/// Draws a frame of a flight, flown to it; gives the bytes of a PNG file and the adapter's name.
pub(super) fn draw_frame(
    terrain: &Terrain,
    flight: &Flight,
    frame: usize,
    quality: Quality,
) -> Result<(Vec<u8>, String)> {
    let mut studio = Studio::reading(
        terrain,
        PictureEngine::default(),
        quality.culling,
        quality.viewport,
        quality.cache_bytes,
    )?;
    let view = |frame: &FlightFrame| quality.view(frame);
    let Some(asked) = flight.frames.get(frame) else { bail!("the flight has no frame {frame}") };
    for flown in &flight.frames[..=frame] {
        studio.fly(&view(flown));
    }
    let (asked, _) = within::lifted(&mut within::Ground::new(terrain), view(asked));
    studio.fly(&asked);
    let mut look = Look::default().multisample(true);
    let heights_m = terrain.header().height_range_m.map(|metres| metres as f32);
    look.tint_range_m = Some(look.ramp.range_m(heights_m));
    let rgb = studio.picture(&asked, &look)?;
    Ok((png(&rgb, quality.viewport)?, studio.capabilities().adapter.clone()))
}
