//! `terrasoar movie`: a flight as moving pictures.

use super::movie_file::{MovieFile, MovieFormat};
use super::output::{complain, decimal, grouped, print, print_json};
use super::outputs::{Force, Kind};
use super::pages::CacheArgs;
use super::picture::PictureArgs;
use super::progress::Meter;
use super::siting;
use super::terrain::TerrainArgs;
use super::{WrongUsage, parse, within};
use anyhow::{Result, bail};
use serde::Serialize;
use std::path::PathBuf;
use terrasoar::flight::{Flight, FlightFrame, MAX_FRAMES, sample};

/// Draw a flight as a folder of PNG files, a GIF or an MP4.
///
/// A name ending in .gif or .mp4 is a file, any other a folder, which must be new or empty; all of it appears when the last picture is drawn. MP4 needs an installed ffmpeg. Pictures follow the
/// flight's own time (time_s): --fps of them a second, the eye between two frames where a frame is not at that moment, so that a flight of ten seconds is a movie of ten seconds.
/// --every takes the flight's frames as they are instead, whatever their times. An eye that is below the ground is raised above it, and said. The same input gives the same PNG and GIF on the same driver.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar movie alps.iqt --flight low.flight -o low.mp4
  terrasoar movie alps.iqt --flight low.flight -o low.gif --size 480x270 --every 4 --fps 12
  terrasoar movie alps.iqt --flight low.flight -o frames --style contours")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    #[command(flatten)]
    cache: CacheArgs,
    /// Flight file
    #[arg(long, value_name = "F")]
    flight: PathBuf,
    /// Movie to write: a folder, or a file by its extension
    #[arg(short, long, value_name = "DIR|OUT.(gif|mp4)")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Draw every Nth frame of the flight, whatever its time; without it pictures follow the flight's time
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    /// Pictures a second
    #[arg(long, value_name = "N", default_value = "25", value_parser = rate)]
    fps: f64,
    #[command(flatten)]
    picture: PictureArgs,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

fn rate(text: &str) -> Result<f64, String> {
    let fps = parse::positive(text)?;
    if (0.01..=240.0).contains(&fps) { Ok(fps) } else { Err("it must be from 0.01 to 240".into()) }
}

#[derive(Debug, Serialize)]
struct Answer {
    output: String,
    size_px: [u32; 2],
    style: String,
    ramp: &'static str,
    /// Pictures drawn.
    frames: u64,
    /// How long the movie runs.
    seconds: f64,
    /// Pictures whose eye was raised above the ground.
    raised: u64,
    fps: f64,
    engine: &'static str,
    triangles_mean: f64,
    adapter: String,
    backend: String,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let Some(format) = MovieFormat::of(&args.output) else {
        return Err(WrongUsage(format!(
            "{}: a movie's name ends in .gif or .mp4, or has no extension and is a folder of pictures",
            args.output.display()
        ))
        .into());
    };
    args.picture.check()?;
    if format != MovieFormat::Folder {
        args.force.file(&args.output, Kind::Film, &args.terrain.inputs(&[&args.flight]))?;
    }
    let (terrain, cache_bytes) = args.cache.open(&args.terrain)?;
    let flight = Flight::read(&args.flight)?;
    let picture = &args.picture;
    within::flight(&terrain, &flight, &args.flight, picture.size)?;
    let moments = args.moments(&flight)?;
    let mut studio = picture.studio(&terrain, cache_bytes)?;
    let has_image = studio.has_image();
    let look = picture.look(has_image, terrain.header().height_range_m);
    let mut movie = MovieFile::create(&args.output, format, picture.size, args.fps, args.force.is_given())?
        .with_notes(siting::notes(terrain.header()));
    let progress = Meter::new("frames");
    progress.begin("drawing", moments.count);
    let mut ground = within::Ground::new(&terrain);
    let (mut pictures, mut raised, mut triangles) = (0_u64, 0_u64, 0_u64);
    for frame in (0..moments.count).filter_map(|i| moments.frame(&flight, i)) {
        let view = picture.refine(frame.view(picture.size, picture.tolerance_px));
        let (view, by_m) = within::lifted(&mut ground, view);
        triangles += studio.fly(&view).triangles;
        movie.add(&studio.picture(&view, &look)?)?;
        pictures += 1;
        raised += u64::from(by_m.is_some());
        progress.add(1);
    }
    drop(progress);
    movie.finish()?;
    if raised > 0 {
        complain(&format!(
            "note: {}: in {} of {} pictures the eye is below the ground; it was raised above it",
            args.flight.display(),
            grouped(raised),
            grouped(pictures)
        ));
    }
    let [width, height] = picture.size.size_px();
    let adapter = studio.capabilities();
    let triangles_mean = triangles as f64 / pictures.max(1) as f64;
    let seconds = pictures as f64 / args.fps;
    if args.json {
        return print_json(&Answer {
            output: args.output.display().to_string(),
            size_px: [width, height],
            style: picture.style(has_image).to_owned(),
            ramp: look.ramp.name,
            frames: pictures,
            seconds,
            raised,
            fps: args.fps,
            engine: picture.engine_name(),
            triangles_mean,
            adapter: adapter.adapter.clone(),
            backend: adapter.backend.clone(),
        });
    }
    print(&format!(
        "{}: {} pictures of {width} x {height} pixels, {} s, {} triangles on average; drawn by {} ({})",
        args.output.display(),
        grouped(pictures),
        decimal(seconds, 2),
        grouped(triangles_mean.round() as u64),
        adapter.adapter,
        adapter.backend
    ))
}

/// Which pictures there are.
struct Moments {
    count: u64,
    step: Step,
}

/// The way from picture to picture.
enum Step {
    /// So many frames of the flight.
    Frames(u64),
    /// A part of a second of its time.
    Time { per_second: f64 },
}

impl Moments {
    fn frame(&self, flight: &Flight, picture: u64) -> Option<FlightFrame> {
        match self.step {
            Step::Frames(every) => flight.frames.get((picture * every) as usize).copied(),
            Step::Time { per_second } => sample::frame_at(&flight.frames, picture as f64 / per_second),
        }
    }
}

impl Args {
    fn moments(&self, flight: &Flight) -> Result<Moments> {
        let frames = flight.frames.len() as u64;
        let every = |step: u64| Moments { count: frames.div_ceil(step), step: Step::Frames(step) };
        if let Some(step) = self.every {
            return Ok(every(step.into()));
        }
        let path = self.flight.display();
        let seconds = sample::duration_s(&flight.frames);
        if seconds == 0.0 {
            if frames > 1 {
                complain(&format!(
                    "note: {path}: all frames have the same time; each is a picture, as with --every 1"
                ));
            }
            return Ok(every(1));
        }
        let count = sample::moments(&flight.frames, self.fps);
        if count > MAX_FRAMES {
            let seconds = decimal(seconds, 1);
            bail!(
                "{path}: the flight takes {seconds} s, which is {} pictures; a movie has at most {}. Give a smaller --fps, or take its frames as they are with --every 1",
                grouped(count),
                grouped(MAX_FRAMES)
            );
        }
        Ok(Moments { count, step: Step::Time { per_second: self.fps } })
    }
}
