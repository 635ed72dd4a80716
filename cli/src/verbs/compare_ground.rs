//! `terrasoar compare-ground`: by how much one ground lies above another, in numbers, as GeoTIFF and as a picture.

use super::area::AreaArgs;
use super::export;
use super::output::{complain, decimal, grouped, print, print_json, table};
use super::outputs::{Force, Kind};
use super::parse;
use super::progress::Meter;
use super::terrain::TerrainArgs;
use anyhow::{Context, Result, bail};
use serde::Serialize;
use std::path::{Path, PathBuf};
use terrasoar_import::difference::{Difference, Extreme, Reduced, Summary};
use terrasoar_import::places::Frame;
use terrasoar_lab::{diverging, picture};
use terrasoar_layout::file::atomic::AtomicFile;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::words::number;

/// Pixels a side of the picture, at most.
const MOST_PIXELS: u32 = 2048;

/// Pixels a side of an enlarged picture, at most.
const MOST_ENLARGED: u32 = 8192;

/// Compare two terrains: differences of heights, and what was cut and filled.
///
/// Differences are second less first, at the samples of the first. With --overlay the second terrain is seen with those edits; without a second terrain it is the first one with them. A terrain alone is
/// compared with what it was before all edits that it holds. Where the second has other samples than the first its heights are interpolated between them, also from another reference system; where it has none
/// nothing is compared. Heights that single precision does not tell apart are equal.
///
/// Cut is what the second ground lies below the first, fill what it lies above: sums of differences times the area of a sample.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar compare-ground before.iqt after.iqt
  terrasoar compare-ground alps.iqt --overlay dam.iqo -o dam.tif --picture dam.png
  terrasoar compare-ground alps.iqt
  terrasoar compare-ground alps.iqt survey.tif --window 395000,5092000,396000,5093000 --crs dem --json | jq .fill_m3")]
pub(super) struct Args {
    /// First terrain file (.iqt); elevation data is built first, into the folder for caches
    first: PathBuf,
    /// Second terrain file; without it the first one, with its edits
    second: Option<PathBuf>,
    /// Edits of the second terrain that are kept apart (.iqo), as `terrasoar edit --overlay` makes them
    #[arg(long, value_name = "O.iqo")]
    overlay: Option<PathBuf>,
    /// Write the differences in metres as a cloud-optimised GeoTIFF
    #[arg(short, long, value_name = "OUT.tif", value_parser = parse::with_extension(&["tif", "tiff"]))]
    output: Option<PathBuf>,
    /// Write a picture of them: red where the second ground lies below the first, blue where it lies above
    #[arg(long, value_name = "OUT.png", value_parser = parse::with_extension(&["png"]))]
    picture: Option<PathBuf>,
    /// Difference in metres with the picture's deepest colours, instead of the largest there is
    #[arg(long, value_name = "M", value_parser = parse::positive, requires = "picture")]
    range: Option<f64>,
    /// Enlarge the picture so many times each way, from 1 to 64: with 1 a sample is a pixel
    #[arg(long, value_name = "N", default_value_t = 1, requires = "picture", value_parser = clap::value_parser!(u32).range(1..=64))]
    pixels: u32,
    #[command(flatten)]
    area: AreaArgs,
    #[command(flatten)]
    force: Force,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Place {
    difference_m: f64,
    /// Column and row from the first terrain's south-west sample.
    sample: [u32; 2],
    /// Metres east and north of it.
    at_m: [f64; 2],
    /// In the elevation model's coordinates; null where they are not known.
    at: Option<[f64; 2]>,
}

#[derive(Debug, Serialize)]
struct Answer {
    first: String,
    second: String,
    /// Whether the second terrain's heights were interpolated.
    interpolated: bool,
    compared_samples: u64,
    changed_samples: u64,
    /// Samples where one of the two has no height.
    only_first_samples: u64,
    only_second_samples: u64,
    mean_m: f64,
    rms_m: f64,
    lowest: Option<Place>,
    highest: Option<Place>,
    cut_m3: f64,
    fill_m3: f64,
    /// Fill less cut.
    net_m3: f64,
    changed_m2: f64,
    /// Samples a pixel of the picture, each way; null without one.
    picture_samples: Option<u32>,
    /// Difference in metres with the deepest colours.
    picture_range_m: Option<f64>,
}

impl Args {
    /// Both terrains, read page by page, and what the second one is called.
    fn open(&self) -> Result<(Terrain, Terrain, String)> {
        let plain = |file: &PathBuf| TerrainArgs { file: file.clone(), overlay: None };
        let with = |file: &PathBuf| TerrainArgs { file: file.clone(), overlay: self.overlay.clone() };
        let overlaid = |file: &Path| match &self.overlay {
            Some(overlay) => format!("{} with {}", file.display(), overlay.display()),
            None => file.display().to_string(),
        };
        if self.second.is_some() || self.overlay.is_some() {
            let second = self.second.as_ref().unwrap_or(&self.first);
            let (first, other) = (plain(&self.first).open()?, with(second).open()?);
            return Ok((first.open_again_unmapped()?, other.open_again_unmapped()?, overlaid(second)));
        }
        let second = plain(&self.first).open()?.open_again_unmapped()?;
        if second.header().history.is_none() {
            bail!(
                "{}: the terrain holds no edits, so there is nothing to compare; name a second terrain, or edits with --overlay",
                self.first.display()
            );
        }
        let first = second.open_again_unmapped()?.into_original()?;
        Ok((first, second, format!("{} with its edits", self.first.display())))
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    let inputs: Vec<&Path> = [Some(&args.first), args.second.as_ref(), args.overlay.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    if let Some(out) = &args.output {
        args.force.file(out, Kind::Elevation, &inputs)?;
    }
    if let Some(out) = &args.picture {
        args.force.file(out, Kind::Picture, &inputs)?;
    }
    let (first, second, name) = args.open()?;
    let window = args.area.window(&first, &args.first, 1)?;
    let difference = Difference::new(&first, &second, &window)?;
    warn(&first, &second, &difference);
    let progress = Meter::new("samples");
    let (summary, reduced) = difference.survey(MOST_PIXELS, &progress)?;
    if summary.compared == 0 {
        drop(progress);
        bail!(
            "{}: the two terrains share no sample at which both have a height; see where they lie with `terrasoar info`",
            args.first.display()
        );
    }
    let written = args.output.as_ref().map(|out| difference.export(out, &progress)).transpose()?;
    drop(progress);
    let range_m = args.range.unwrap_or_else(|| largest(&summary));
    if let Some(out) = &args.picture {
        draw(args, out, &reduced, range_m, &name)?;
    }
    let answer = Answer::of(args, &first, name, &difference, &summary, &reduced, range_m);
    if args.json {
        return print_json(&answer);
    }
    let mut text = answer.text();
    if let (Some(out), Some(written)) = (&args.output, &written) {
        text.push_str(&export::summary(out, first.header(), &window, written));
        text.push('\n');
    }
    if let Some(out) = &args.picture {
        text.push_str(&format!(
            "{}: {} x {} pixels of {} x {} samples{}, colours to {} m\n",
            out.display(),
            reduced.size[0] * args.pixels,
            reduced.size[1] * args.pixels,
            reduced.samples,
            reduced.samples,
            if args.pixels == 1 { String::new() } else { format!(", {0} x {0} times enlarged", args.pixels) },
            decimal(range_m, 4)
        ));
    }
    print(&text)
}

/// What may make differences that are none of the ground.
fn warn(first: &Terrain, second: &Terrain, difference: &Difference<'_>) {
    if let Some(doubt) = difference.doubt() {
        complain(&format!("note: the shift between the two datums {doubt}"));
    }
    let [a, b] = [first, second].map(|terrain| terrain.header().about.vertical_name.as_str());
    if a != b && !a.is_empty() && !b.is_empty() {
        complain(&format!(
            "note: the heights are above different surfaces, {a} and {b}, which are not brought together"
        ));
    }
}

/// The largest difference, whichever way; 1 where there is none.
fn largest(summary: &Summary) -> f64 {
    let ends = [summary.lowest, summary.highest].into_iter().flatten().map(|end| end.difference_m.abs());
    let largest = ends.fold(0.0, f64::max);
    if largest > 0.0 { largest } else { 1.0 }
}

fn draw(args: &Args, out: &Path, reduced: &Reduced, range_m: f64, name: &str) -> Result<()> {
    let (times, size) = (args.pixels, reduced.size);
    if size.iter().any(|side| side * times > MOST_ENLARGED) {
        bail!(
            "{}: the picture would have {} x {} pixels, and {MOST_ENLARGED} a side are the most; give fewer --pixels, or a smaller --window",
            out.display(),
            size[0] * times,
            size[1] * times
        );
    }
    let small = diverging::pixels(&reduced.differences_m, range_m as f32);
    let mut rgb = Vec::with_capacity(small.len() * (times * times) as usize);
    for row in small.chunks(3 * size[0] as usize) {
        let wide: Vec<u8> = row.chunks(3).flat_map(|pixel| pixel.repeat(times as usize)).collect();
        rgb.extend(wide.repeat(times as usize));
    }
    let texts = [("Differences", format!("{name}: red {} m, blue {} m", number(-range_m), number(range_m)))];
    let failed = || format!("{}: cannot write the picture; check the free space", out.display());
    let png = picture::encode_with(&rgb, size.map(|side| side * times), &texts).with_context(failed)?;
    let file = AtomicFile::create(out)?;
    std::io::Write::write_all(&mut file.file(), &png).with_context(failed)?;
    Ok(file.publish()?)
}

impl Place {
    fn of(header: &Header, extreme: Extreme) -> Self {
        let spacing_m = header.grid.spacing_m();
        let at_m = [0, 1].map(|axis| f64::from(extreme.sample[axis]) * spacing_m[axis]);
        let at = Frame::own(header).and_then(|frame| frame.coordinates(at_m));
        Self { difference_m: extreme.difference_m, sample: extreme.sample, at_m, at }
    }

    fn text(&self) -> String {
        let pair = |[x, y]: [f64; 2], digits| format!("{},{}", decimal(x, digits), decimal(y, digits));
        let at = self.at.map(|at| format!(" ({} in the elevation model's coordinates)", pair(at, 7)));
        format!(
            "{} m at {} m, sample {},{}{}",
            decimal(self.difference_m, 4),
            pair(self.at_m, 3),
            self.sample[0],
            self.sample[1],
            at.unwrap_or_default()
        )
    }
}

impl Answer {
    fn of(
        args: &Args,
        first: &Terrain,
        second: String,
        difference: &Difference<'_>,
        summary: &Summary,
        reduced: &Reduced,
        range_m: f64,
    ) -> Self {
        let place = |extreme: Option<Extreme>| extreme.map(|extreme| Place::of(first.header(), extreme));
        Self {
            first: args.first.display().to_string(),
            second,
            interpolated: difference.is_interpolated(),
            compared_samples: summary.compared,
            changed_samples: summary.changed,
            only_first_samples: summary.alone[0],
            only_second_samples: summary.alone[1],
            mean_m: summary.mean_m,
            rms_m: summary.rms_m,
            lowest: place(summary.lowest),
            highest: place(summary.highest),
            cut_m3: summary.cut_m3,
            fill_m3: summary.fill_m3,
            net_m3: summary.fill_m3 - summary.cut_m3,
            changed_m2: summary.changed_m2,
            picture_samples: args.picture.as_ref().map(|_| reduced.samples),
            picture_range_m: args.picture.as_ref().map(|_| range_m),
        }
    }

    fn text(&self) -> String {
        let volume = |m3: f64| format!("{} m3", decimal(m3, 1));
        let mut rows = vec![
            ("first", self.first.clone()),
            ("second", format!("{}{}", self.second, if self.interpolated { ", interpolated" } else { "" })),
            ("compared", format!("{} samples", grouped(self.compared_samples))),
            (
                "changed",
                format!("{} samples, {} m2", grouped(self.changed_samples), decimal(self.changed_m2, 1)),
            ),
            ("mean", format!("{} m", decimal(self.mean_m, 6))),
            ("RMS", format!("{} m", decimal(self.rms_m, 6))),
            ("cut", volume(self.cut_m3)),
            ("fill", volume(self.fill_m3)),
            ("fill less cut", volume(self.net_m3)),
        ];
        if self.changed_samples == 0 {
            rows.insert(3, ("difference", "none".into()));
        } else {
            // Where nothing was cut, or nothing filled, there is no such place.
            let cut = self.lowest.as_ref().filter(|place| place.difference_m < 0.0);
            let filled = self.highest.as_ref().filter(|place| place.difference_m > 0.0);
            rows.extend(cut.map(|place| ("lowest", place.text())));
            rows.extend(filled.map(|place| ("highest", place.text())));
        }
        for (name, count) in
            [("only in first", self.only_first_samples), ("only in second", self.only_second_samples)]
        {
            if count > 0 {
                rows.push((name, format!("{} samples", grouped(count))));
            }
        }
        table(&rows)
    }
}
