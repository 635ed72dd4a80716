//! `terrasoar movie`: a flight as moving pictures.

use super::movie_file::{MovieFile, MovieFormat};
use super::output::{grouped, print, print_json};
use super::outputs::{Force, Kind};
use super::picture::PictureArgs;
use super::progress::Meter;
use super::siting;
use super::terrain::TerrainArgs;
use super::{WrongUsage, parse};
use anyhow::Result;
use serde::Serialize;
use std::path::PathBuf;
use terrasoar::flight::Flight;

/// Draw a flight as a folder of PNG files, a GIF or an MP4.
///
/// A name ending in .gif or .mp4 is a file, any other a folder, which must be new or empty; all of it appears when the last picture is drawn. MP4 needs an installed ffmpeg. The engine flies every
/// frame; --every draws some of them. The same input gives the same PNG and GIF on the same driver.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar movie alps.iqt --flight low.flight -o low.mp4
  terrasoar movie alps.iqt --flight low.flight -o low.gif --size 480x270 --every 4 --fps 12
  terrasoar movie alps.iqt --flight low.flight -o frames --style contours")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// Flight file
    #[arg(long, value_name = "F")]
    flight: PathBuf,
    /// Movie to write: a folder, or a file by its extension
    #[arg(short, long, value_name = "DIR|OUT.(gif|mp4)")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Draw every Nth frame
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
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
    frames: u64,
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
    if format != MovieFormat::Folder {
        args.force.file(&args.output, Kind::Film, &args.terrain.inputs(&[&args.flight]))?;
    }
    let terrain = args.terrain.open()?;
    let flight = Flight::read(&args.flight)?;
    let picture = &args.picture;
    let mut studio = picture.studio(&terrain)?;
    let has_image = studio.has_image();
    let look = picture.look(has_image);
    let mut movie = MovieFile::create(&args.output, format, picture.size, args.fps, args.force.is_given())?
        .with_notes(siting::notes(terrain.header()));
    let progress = Meter::new("frames");
    progress.begin("drawing", flight.frames.len() as u64);
    let (mut pictures, mut triangles) = (0_u32, 0_u64);
    for (i, frame) in flight.frames.iter().enumerate() {
        let view = picture.refine(frame.view(picture.size, picture.tolerance_px));
        let refined = studio.fly(&view);
        if i % args.every as usize == 0 {
            movie.add(&studio.picture(&view, &look)?)?;
            pictures += 1;
            triangles += refined.triangles;
        }
        progress.add(1);
    }
    drop(progress);
    movie.finish()?;
    let [width, height] = picture.size.size_px();
    let adapter = studio.capabilities();
    let triangles_mean = triangles as f64 / f64::from(pictures.max(1));
    if args.json {
        return print_json(&Answer {
            output: args.output.display().to_string(),
            size_px: [width, height],
            style: picture.style(has_image).to_owned(),
            ramp: look.ramp.name,
            frames: u64::from(pictures),
            fps: args.fps,
            engine: picture.engine_name(),
            triangles_mean,
            adapter: adapter.adapter.clone(),
            backend: adapter.backend.clone(),
        });
    }
    print(&format!(
        "{}: {} pictures of {width} x {height} pixels, {} triangles on average; drawn by {} ({})",
        args.output.display(),
        grouped(u64::from(pictures)),
        grouped(triangles_mean.round() as u64),
        adapter.adapter,
        adapter.backend
    ))
}
