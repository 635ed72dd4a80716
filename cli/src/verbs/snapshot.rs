//! `terrasoar snapshot`: one picture.

use super::area::AreaArgs;
use super::output::{complain, decimal, grouped, print, print_json};
use super::outputs::{Force, Kind};
use super::pages::CacheArgs;
use super::picture::{INCH_M, PictureArgs, angles, png_with};
use super::progress::Meter;
use super::siting;
use super::terrain::TerrainArgs;
use super::world_file::{Map, beside};
use super::{WrongUsage, guess, parse, within};
use crate::fit::is_over;
use anyhow::{Context, Result};
use glam::DVec3;
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;
use terrasoar::flight::Flight;
use terrasoar::flyover::ReplayError;
use terrasoar::sink::FileSink;
use terrasoar::view::View;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{Haze, RenderError};
use terrasoar_scene::overview::{FOV_DEG, from_above_part, overview, towards_middle, view_from};
use terrasoar_scene::scene::SceneError;

/// Draw a picture of a terrain as PNG.
///
/// Of a frame of a flight, of a view that is given, or of the whole terrain from obliquely above. With a flight the engine flies all frames before it.
/// --ortho looks straight down from so far above that a pixel is as many metres everywhere, north at the top; the picture then has the terrain's shape and ends where the ground ends.
/// An eye that is below the ground is refused, with a height that does; that of a flight is raised above it, and said. Needs a graphics driver; one in software does. The same input gives the same bytes on the same driver.
/// Texts in the PNG say in which reference system the terrain lies.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar snapshot alps.iqt -o alps.png
  terrasoar snapshot alps.iqt --flight low.flight --frame 99 --style wireframe -o frame.png
  terrasoar snapshot alps.iqt --at 1500,820.5,3000 --look 45,-20 --ramp atlas --contours 100 -o view.png
  terrasoar snapshot alps.iqt --at 395000,5092000,4000 --crs dem -o from-the-east.png
  terrasoar snapshot alps.iqt --ortho --size 4000x4000 --ramp-range 0,4500 --contours 100 --contour-width 2 -o map.png
  terrasoar snapshot alps.iqt --ortho --window 395000,5092000,401000,5097000 --crs dem --dpi 300 --world-file -o village.png

Fields of --json: output, size_px, style, ramp, ramp_range_m (heights of the ramp's ends), frame (null without a flight), eye_m, raised_m (by how much the eye was raised above the ground),
metres_per_px (null without --ortho), scale (n of 1:n; null without --ortho and --dpi), beside (files of --world-file), yaw_deg, pitch_deg, vertical_fov_deg, tolerance_px, metric, exaggeration, engine, triangles, adapter, backend.")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    #[command(flatten)]
    cache: CacheArgs,
    /// Flight file
    #[arg(long, value_name = "F", requires = "frame")]
    flight: Option<PathBuf>,
    /// Frame of the flight, from 0
    #[arg(long, value_name = "N", requires = "flight", conflicts_with_all = ["at", "look", "fov"])]
    frame: Option<usize>,
    /// Where the eye is: metres east and north of the south-west sample, or coordinates of --crs, and metres up
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true, conflicts_with = "flight")]
    at: Option<DVec3>,
    /// Where it looks: degrees clockwise from north, and above the horizon; to the terrain's middle without it
    #[arg(long, value_name = "YAW,PITCH", value_parser = look, allow_hyphen_values = true, requires = "at", conflicts_with = "flight")]
    look: Option<[f64; 2]>,
    /// Show the whole terrain from straight above as a map, north at the top; --size is the most that the picture may have
    #[arg(long, conflicts_with_all = OF_A_VIEW)]
    ortho: bool,
    /// Part that --ortho shows: west, south, east, north in metres from the south-west sample, or in what --crs says; all of it without this
    #[arg(long, value_name = "W,S,E,N", value_parser = parse::extent, allow_hyphen_values = true, requires = "ortho", conflicts_with_all = OF_A_VIEW)]
    window: Option<[f64; 4]>,
    /// System of --at and --window: dem for the elevation model's own coordinates, EPSG:n, WKT or a PROJ string; samples too for --window
    #[arg(long, value_name = "SYSTEM")]
    crs: Option<String>,
    /// Dots an inch on paper: kept in the PNG, and the scale of --ortho is told
    #[arg(long, value_name = "N", value_parser = dots)]
    dpi: Option<f64>,
    /// Write beside the map where it lies, for other programs: a world file (.pgw), and the reference system (.prj, .png.aux.xml)
    #[arg(long, requires = "ortho", conflicts_with_all = OF_A_VIEW)]
    world_file: bool,
    /// Vertical field of view in degrees, 45 without it
    #[arg(long, value_name = "DEG", value_parser = field_of_view, conflicts_with = "flight")]
    fov: Option<f64>,
    #[command(flatten)]
    picture: PictureArgs,
    /// Picture to write
    #[arg(short, long, value_name = "OUT.png", value_parser = parse::with_extension(&["png"]))]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What says where the eye is or how it looks, which a map from straight above has no use for.
const OF_A_VIEW: [&str; 5] = ["flight", "frame", "at", "look", "fov"];

fn dots(text: &str) -> Result<f64, String> {
    let dots = parse::positive(text)?;
    if (1.0..=10_000.0).contains(&dots) { Ok(dots) } else { Err("it must be from 1 to 10000".into()) }
}

fn place(text: &str) -> Result<DVec3, String> {
    let numbers = text.split(',').map(parse::finite).collect::<Result<Vec<f64>, String>>()?;
    let [east, north, up] = numbers[..] else {
        return Err("give three numbers, metres east, north and up, such as 1500,820.5,3000".into());
    };
    Ok(DVec3::new(east, north, up))
}

fn look(text: &str) -> Result<[f64; 2], String> {
    let [yaw, pitch] = angles(text)?;
    if (-90.0..=90.0).contains(&pitch) {
        Ok([yaw, pitch])
    } else {
        Err("the second number, degrees above the horizon, must be from -90 to 90".into())
    }
}

fn field_of_view(text: &str) -> Result<f64, String> {
    let degrees = parse::positive(text)?;
    if degrees <= 170.0 { Ok(degrees) } else { Err("it must be at most 170 degrees".into()) }
}

#[derive(Debug, Serialize)]
struct Answer {
    output: String,
    size_px: [u32; 2],
    style: String,
    ramp: &'static str,
    ramp_range_m: [f32; 2],
    /// Null without a flight.
    frame: Option<usize>,
    eye_m: [f64; 3],
    /// By how much the eye was raised above the ground.
    raised_m: f64,
    /// Null without --ortho.
    metres_per_px: Option<f64>,
    /// The map's, 1 to so many; null without --ortho and --dpi.
    scale: Option<f64>,
    /// Files that say where it lies.
    beside: Vec<String>,
    yaw_deg: f64,
    pitch_deg: f64,
    vertical_fov_deg: f64,
    tolerance_px: f64,
    metric: &'static str,
    exaggeration: f64,
    engine: &'static str,
    triangles: u64,
    adapter: String,
    backend: String,
}

pub(super) fn run(args: &Args) -> Result<()> {
    args.picture.check()?;
    if args.crs.is_some() && args.at.is_none() && args.window.is_none() {
        return Err(WrongUsage(
            "--crs says what the numbers of --at or of --window are; give one of them".into(),
        )
        .into());
    }
    let flight: Vec<_> = args.flight.as_deref().into_iter().collect();
    args.force.file(&args.output, Kind::Picture, &args.terrain.inputs(&flight))?;
    let (terrain, cache_bytes) = args.cache.open(&args.terrain)?;
    let (views, picture, raised_m, map) = args.views(&terrain)?;
    let others =
        if args.world_file { Some(beside(terrain.header(), &args.output, args.force)?) } else { None };
    let mut studio = picture.studio(&terrain, cache_bytes)?;
    let progress = Meter::new("frames");
    progress.begin("flying", views.len() as u64);
    let mut triangles = 0;
    for view in &views {
        triangles = studio.fly(view).triangles;
        progress.add(1);
    }
    drop(progress);
    let Some(view) = views.last() else { return Err(WrongUsage("a flight without frames".into()).into()) };
    let has_image = studio.has_image();
    let mut look = picture.look(has_image, terrain.header().height_range_m);
    if args.ortho {
        look.haze = picture.haze.unwrap_or(Haze::Off);
    } else if args.is_overview() {
        // A block on a table: no air between it and the eye.
        look.haze = picture.haze.unwrap_or(Haze::Off);
        studio.raise_walls(block_bottom_m(&terrain, picture.exaggeration))?;
    }
    if args.flight.is_some() || args.at.is_some() {
        within::air(&terrain, view, look.haze, &args.hint(&terrain, view.eye_m)?)?;
    }
    let rgb = studio.picture(view, &look).map_err(|error| smaller(error, picture.size.size_px()))?;
    let mut file = FileSink::create(&args.output)?;
    file.write_all(&png_with(&rgb, picture.size, &siting::notes(terrain.header()), args.dpi)?).with_context(
        || format!("{}: cannot write the picture; check the free space", args.output.display()),
    )?;
    file.publish()?;
    let beside = match (others, map) {
        (Some(others), Some(map)) => others.write(terrain.header(), map)?,
        _ => Vec::new(),
    };
    let metres_per_px = map.map(|map| map.pixel_m);
    let scale = metres_per_px.zip(args.dpi).map(|(metres, dpi)| metres * dpi / INCH_M);
    let [width, height] = picture.size.size_px();
    let adapter = studio.capabilities();
    if args.json {
        return print_json(&Answer {
            output: args.output.display().to_string(),
            size_px: [width, height],
            style: picture.style(has_image).to_owned(),
            ramp: look.ramp.name,
            ramp_range_m: look.tint_range_m.unwrap_or_default(),
            frame: args.frame,
            eye_m: view.eye_m.to_array(),
            raised_m,
            metres_per_px,
            scale,
            beside,
            yaw_deg: view.yaw_rad.to_degrees(),
            pitch_deg: view.pitch_rad.to_degrees(),
            vertical_fov_deg: view.vertical_fov_rad.to_degrees(),
            tolerance_px: view.tolerance_px,
            metric: view.metric.name(),
            exaggeration: view.vertical_exaggeration,
            engine: picture.engine_name(),
            triangles,
            adapter: adapter.adapter.clone(),
            backend: adapter.backend.clone(),
        });
    }
    let from = match metres_per_px {
        Some(metres) => {
            let scale = scale.map(|scale| format!(", 1:{} in print", grouped(scale.round() as u64)));
            format!("straight above, {} m a pixel{}", decimal(metres, 4), scale.unwrap_or_default())
        }
        None => view.eye_m.to_array().map(|m| decimal(m, 1)).join(","),
    };
    print(&format!(
        "{}: {width} x {height} pixels, {} triangles, seen from {from}; drawn by {} ({})",
        args.output.display(),
        grouped(triangles),
        adapter.adapter,
        adapter.backend
    ))
}

/// Why there is no picture; where it was too large for the memory, with a size to try.
fn smaller(error: SceneError, [wide, high]: [u32; 2]) -> anyhow::Error {
    let is_memory =
        matches!(&error, SceneError::Render(RenderError::Device { message }) if message.contains("memory"));
    let error = anyhow::Error::from(error);
    if !is_memory {
        return error;
    }
    error.context(format!(
        "no picture of {wide} x {high} pixels was drawn; half of them each way take a quarter of the memory (--size {}x{}), and --window draws a part",
        wide.div_ceil(2),
        high.div_ceil(2)
    ))
}

/// Where the block that the terrain is shown as ends: a fortieth of its width below the lowest ground, as drawn.
fn block_bottom_m(terrain: &Terrain, exaggeration: f64) -> f64 {
    let [east_m, north_m] = terrain.grid().extent_m();
    terrain.header().height_range_m[0] - 0.025 * east_m.min(north_m) / exaggeration
}

impl Args {
    /// Whether nothing says where the eye is.
    fn is_overview(&self) -> bool {
        self.flight.is_none() && self.at.is_none()
    }

    /// Where the eye is, in metres.
    fn eye(&self, terrain: &Terrain) -> Result<Option<DVec3>> {
        let Some(at) = self.at else { return Ok(None) };
        let header = terrain.header();
        let Some(frame) = siting::frame(header, self.crs.as_deref())? else {
            if is_over(terrain.grid(), at)
                && let Some((note, _)) = guess::note_of_local(header, &[[at.x, at.y]])
            {
                complain(&note);
            }
            return Ok(Some(at));
        };
        let place = frame.place_m([at.x, at.y]).with_context(|| {
            let reach = siting::reach(header, Some(&frame)).unwrap_or_default();
            format!("{},{} is no place in that system; the terrain extends {reach}", at.x, at.y)
        })?;
        Ok(Some(DVec3::new(place[0], place[1], at.z)))
    }

    /// What an eye outside may be meant as, a clause; empty inside, and of a flight.
    fn hint(&self, terrain: &Terrain, eye_m: DVec3) -> Result<String> {
        let Some(at) = self.at.filter(|_| !is_over(terrain.grid(), eye_m)) else { return Ok(String::new()) };
        let frame = siting::frame(terrain.header(), self.crs.as_deref())?;
        Ok(guess::clause_of_outside(terrain.header(), frame.as_ref(), &[[at.x, at.y]]))
    }

    /// The views to fly through; the last is the picture's. How it is made; by how much its eye was raised; where the map lies, where it is one.
    fn views(&self, terrain: &Terrain) -> Result<(Vec<View>, PictureArgs, f64, Option<Map>)> {
        let mut picture = self.picture.clone();
        let (size, exaggeration) = (self.picture.size, self.picture.exaggeration);
        let fov_deg = self.fov.unwrap_or(FOV_DEG);
        if let Some(path) = &self.flight {
            let flight = Flight::read(path)?;
            within::flight(terrain, &flight, path, size)?;
            let mut frames = flight.frames;
            let asked = self.frame.unwrap_or_default();
            if asked >= frames.len() {
                return Err(ReplayError::NoSuchFrame { asked, last: frames.len() - 1 }.into());
            }
            frames.truncate(asked + 1);
            let view = |frame: &terrasoar::flight::FlightFrame| frame.view(size, self.picture.tolerance_px);
            let mut views: Vec<View> = frames.iter().map(|frame| self.picture.refine(view(frame))).collect();
            let mut raised_m = 0.0;
            if let Some(last) = views.last_mut() {
                let (lifted, by_m) = within::lifted(&mut within::Ground::new(terrain), *last);
                if let Some(by_m) = by_m {
                    let words = decimal(by_m, 1);
                    complain(&format!(
                        "note: {}: in frame {asked} the eye is below the ground; it was raised by {words} m",
                        path.display()
                    ));
                    raised_m = by_m;
                }
                *last = lifted;
            }
            return Ok((views, picture, raised_m, None));
        }
        if self.ortho {
            let sides_m =
                AreaArgs::new(self.window, self.crs.clone()).sides_m(terrain, &self.terrain.file)?;
            let (view, pixel_m) = from_above_part(terrain, sides_m, exaggeration, size);
            picture.size = view.viewport;
            let half = view.viewport.size_px().map(|side| 0.5 * f64::from(side) * pixel_m);
            let north_west_m = [view.eye_m.x - half[0], view.eye_m.y + half[1]];
            return Ok((vec![self.picture.refine(view)], picture, 0.0, Some(Map { north_west_m, pixel_m })));
        }
        let at = self.eye(terrain)?;
        let view = match at {
            None => overview(terrain, exaggeration, fov_deg, size),
            Some(eye_m) => {
                let angles = self.look.map_or_else(
                    || towards_middle(terrain, exaggeration, eye_m),
                    |degrees| degrees.map(f64::to_radians),
                );
                view_from(eye_m, angles, fov_deg, size)
            }
        };
        let view = self.picture.refine(view);
        if self.at.is_some() {
            within::eye(terrain, &view, &self.hint(terrain, view.eye_m)?)?;
        }
        Ok((vec![view], picture, 0.0, None))
    }
}
