//! A file built into a terrain and held against what GDAL reads in it, and against the arithmetic by which it was made.

use super::combination::{Combination, Kind, Unit};
use super::source::{make, run};
use std::path::Path;
use terrasoar_import::places::Frame;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// What GDAL says of a file.
struct Truth {
    samples: [usize; 2],
    map: Option<[f64; 6]>,
    scale: f64,
    offset: f64,
    /// Raw numbers, row by row as stored.
    numbers: Vec<f64>,
    /// Whether a sample is there.
    shown: Vec<bool>,
}

impl Truth {
    fn of(folder: &Path, path: &Path, combination: &Combination) -> Result<Self, String> {
        let name = path.to_str().ok_or("a name that is no text")?;
        let said: serde_json::Value =
            serde_json::from_str(&run(folder, "gdalinfo", &["-json", name])?).map_err(|e| e.to_string())?;
        let number = |value: &serde_json::Value| value.as_f64();
        let size = |at: usize| said["size"][at].as_u64().unwrap_or(0) as usize;
        let band = &said["bands"][0];
        let map: Vec<f64> = said["geoTransform"]
            .as_array()
            .map(|map| map.iter().filter_map(number).collect())
            .unwrap_or_default();
        let samples = [size(0), size(1)];
        let unit = band["unit"].as_str().unwrap_or("");
        if !combination.meaning.unit.is_empty() && unit != combination.meaning.unit {
            return Err(format!("the file does not hold what it is to: GDAL finds the unit \"{unit}\""));
        }
        // Numbers, then the mask, as doubles; and without a place, for ENVI has none for grids that are mirrored.
        let unplaced =
            ["-q", "-of", "ENVI", "-co", "INTERLEAVE=BSQ", "-a_ullr", "0", "1", "1", "0", "-ot", "Float64"];
        run(
            folder,
            "gdal_translate",
            &[&unplaced[..], &["-b", "1", "-b", "mask", name, "read.img"]].concat(),
        )?;
        let read = std::fs::read(folder.join("read.img")).map_err(|error| error.to_string())?;
        let mut numbers: Vec<f64> = read
            .chunks_exact(8)
            .map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight bytes")))
            .collect();
        let shown: Vec<bool> = numbers.split_off(numbers.len() / 2).iter().map(|mask| *mask != 0.0).collect();
        // Releases before 3.7 take signed bytes for unsigned ones.
        if combination.kind == Kind::Int8 {
            numbers.iter_mut().filter(|number| **number > 127.0).for_each(|number| *number -= 256.0);
        }
        if numbers.len() != samples[0] * samples[1] || shown.len() != numbers.len() {
            return Err(format!(
                "GDAL made {} numbers and {} masks of {samples:?}",
                numbers.len(),
                shown.len()
            ));
        }
        Ok(Self {
            samples,
            map: map.try_into().ok(),
            scale: number(&band["scale"]).unwrap_or(1.0),
            offset: number(&band["offset"]).unwrap_or(0.0),
            numbers,
            shown,
        })
    }
}

/// How many samples were compared.
pub(crate) struct Agreed {
    pub(crate) heights: usize,
    pub(crate) voids: usize,
}

/// Makes the file of a combination, builds it, and compares. What is wrong, in words.
pub(crate) fn compare(folder: &Path, combination: &Combination) -> Result<Agreed, String> {
    let path = make(folder, combination)?;
    let truth = Truth::of(folder, &path, combination)?;
    let is_placed = truth.map.is_some();
    let options = OpenOptions { spacing_is_stated: !is_placed, ..OpenOptions::default() };
    let out = folder.join("t.iqt");
    let dem = open_with(&[path], &options).map_err(|error| format!("refused: {error}"))?;
    let spacing_m = (!is_placed).then_some([30.0, 30.0]);
    build(&*dem, &out, &BuildOptions::default().spacing_m(spacing_m), &Silent)
        .map_err(|error| format!("not built: {error}"))?;
    let terrain = Terrain::open(&out).map_err(|error| error.to_string())?;
    if combination.turn.is_resampled() {
        resampled(&terrain, combination)
    } else {
        exact(&terrain, &truth, combination)
    }
}

/// Degrees to metres on the ellipsoid of WGS 84, at a latitude: along it and along the meridian.
fn degree_m(latitude_deg: f64) -> [f64; 2] {
    let (a, f) = (6_378_137.0, 1.0 / 298.257_223_563);
    let e2 = f * (2.0 - f);
    let phi = latitude_deg.to_radians();
    let w = (1.0 - e2 * phi.sin().powi(2)).sqrt();
    [a / w * phi.cos(), a * (1.0 - e2) / w.powi(3)].map(|radius| radius * 1f64.to_radians())
}

/// The distance of samples on the ground, east and north, of a grid of this map.
fn spacing_m(combination: &Combination, map: [f64; 6], samples: [usize; 2]) -> [f64; 2] {
    let centre_y = map[3] + 0.5 * (map[4] * samples[0] as f64 + map[5] * samples[1] as f64);
    let step = [map[1].hypot(map[4]), map[2].hypot(map[5])];
    match combination.system.unit {
        Unit::Metres(metres) => step.map(|units| units * metres),
        Unit::Degrees => {
            let degree = degree_m(centre_y);
            [step[0] * degree[0], step[1] * degree[1]]
        }
        Unit::Mercator => {
            let a = 6_378_137.0;
            let phi = (centre_y / a).sinh().atan();
            let degree = degree_m(phi.to_degrees());
            // A metre of the map is this many degrees of longitude, and so many times the cosine of latitude.
            let degrees = (1.0 / a).to_degrees();
            [step[0] * degrees * degree[0], step[1] * degrees * phi.cos() * degree[1]]
        }
    }
}

fn close(got: f64, wanted: f64, near: f64) -> bool {
    (got - wanted).abs() <= near * (1.0 + wanted.abs())
}

/// The height of a sample counted from the south-west one; `None` for a void.
fn height_m(terrain: &Terrain, at: [u32; 2]) -> Result<Option<f64>, String> {
    let vertex = terrain.checked_vertex(GridPoint::new(at[0], at[1])).map_err(|error| error.to_string())?;
    Ok((!vertex.class.is_void()).then_some(vertex.height_m))
}

/// Grids whose samples stay: every sample at its place, with its height, or void.
fn exact(terrain: &Terrain, truth: &Truth, combination: &Combination) -> Result<Agreed, String> {
    let grid = *terrain.grid();
    let [wide, high] = truth.samples;
    if grid.samples() != [wide as u32, high as u32] || truth.samples != combination.samples {
        return Err(format!("{:?} samples, GDAL says {:?}", grid.samples(), truth.samples));
    }
    let frame = truth.map.map(|_| Frame::own(terrain.header()).ok_or("it has no place")).transpose()?;
    if let Some(map) = truth.map {
        let wanted = spacing_m(combination, map, truth.samples);
        let by_arithmetic = spacing_m(combination, combination.map(), truth.samples);
        let got = grid.spacing_m();
        if (0..2)
            .any(|axis| !close(got[axis], wanted[axis], 1e-6) || !close(got[axis], by_arithmetic[axis], 1e-6))
        {
            return Err(format!("spacing {got:?} m, GDAL says {wanted:?}, arithmetic {by_arithmetic:?}"));
        }
    }
    let unit_m = combination.height_unit_m();
    let mut agreed = Agreed { heights: 0, voids: 0 };
    // All samples of small grids; of large ones some, in all columns.
    let stride = wide * high / 20_000 + 1;
    for (col, row) in (0..wide * high).step_by(stride).map(|at| (at % wide, at / wide)) {
        let place = match (&frame, truth.map) {
            (Some(frame), Some(map)) => {
                let [c, r] = [col as f64 + 0.5, row as f64 + 0.5];
                let point = [map[0] + map[1] * c + map[2] * r, map[3] + map[4] * c + map[5] * r];
                let place_m = frame.place_m(point).ok_or("a sample is nowhere")?;
                [0, 1].map(|axis| place_m[axis] / grid.spacing_m()[axis])
            }
            _ => [col as f64, (high - 1 - row) as f64],
        };
        let at = place.map(f64::round);
        let is_in = (0..2).all(|axis| (place[axis] - at[axis]).abs() < 1e-3 && at[axis] >= 0.0)
            && at[0] < wide as f64
            && at[1] < high as f64;
        if !is_in {
            return Err(format!("sample ({col}, {row}) lies at {place:?} samples from the south-west"));
        }
        let got = height_m(terrain, at.map(|at| at as u32))?;
        let number = truth.numbers[row * wide + col];
        let is_there = truth.shown[row * wide + col] && !number.is_nan();
        let wanted = is_there.then_some((number * truth.scale + truth.offset) * unit_m);
        let by_arithmetic =
            (!combination.is_void(col, row)).then(|| combination.height_m(col as f64, row as f64));
        let agree = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => close(a, b, 1e-6),
            (a, b) => a.is_none() && b.is_none(),
        };
        if !agree(got, wanted) || !agree(got, by_arithmetic) {
            return Err(format!(
                "height of ({col}, {row}) is {got:?}, GDAL says {wanted:?}, arithmetic {by_arithmetic:?}"
            ));
        }
        agreed.heights += usize::from(got.is_some());
        agreed.voids += usize::from(got.is_none());
    }
    Ok(agreed)
}

/// Grids that are turned: every sample of the terrain has the height of the plane at its place, and only what is outside or beside a void is void.
fn resampled(terrain: &Terrain, combination: &Combination) -> Result<Agreed, String> {
    let grid = *terrain.grid();
    let frame = Frame::own(terrain.header()).ok_or("it has no place")?;
    let map = combination.map();
    let area = map[1] * map[5] - map[2] * map[4];
    let [wide, high] = combination.samples;
    let mut agreed = Agreed { heights: 0, voids: 0 };
    for y in 0..grid.samples()[1] {
        for x in 0..grid.samples()[0] {
            let place_m = [f64::from(x) * grid.spacing_m()[0], f64::from(y) * grid.spacing_m()[1]];
            let point = frame.coordinates(place_m).ok_or("a sample is nowhere")?;
            let [dx, dy] = [point[0] - map[0], point[1] - map[3]];
            let at = [(dx * map[5] - dy * map[2]) / area - 0.5, (dy * map[1] - dx * map[4]) / area - 0.5];
            let last = [(wide - 1) as f64, (high - 1) as f64];
            let is_inside = (0..2).all(|axis| (1e-6..last[axis] - 1e-6).contains(&at[axis]));
            // A sample stands for the area around it.
            let is_outside = (0..2).any(|axis| at[axis] < -0.5 - 1e-6 || at[axis] > last[axis] + 0.5 + 1e-6);
            let beside = |dx: usize, dy: usize| {
                combination.is_void(
                    (at[0].max(0.0) as usize + dx).min(wide - 1),
                    (at[1].max(0.0) as usize + dy).min(high - 1),
                )
            };
            let is_beside_void = (0..4).any(|corner| beside(corner % 2, corner / 2));
            match height_m(terrain, [x, y])? {
                Some(height) if is_outside => return Err(format!("{height} m at {at:?}, outside")),
                Some(height) => {
                    let wanted = combination.height_m(at[0], at[1]);
                    // Weights beside voids are shared among the rest.
                    if is_inside && !is_beside_void && !close(height, wanted, 1e-5) {
                        return Err(format!("height at {at:?} is {height}, arithmetic says {wanted}"));
                    }
                    agreed.heights += 1;
                }
                None if is_inside && !is_beside_void => return Err(format!("void at {at:?}")),
                None => agreed.voids += 1,
            }
        }
    }
    let least = wide * high / 2;
    if agreed.heights < least {
        return Err(format!("{} samples of at least {least} were made", agreed.heights));
    }
    let wanted = spacing_m(combination, map, combination.samples);
    let (got, finest) = (grid.spacing_m(), wanted[0].min(wanted[1]));
    if got.iter().any(|got| *got > 1.01 * wanted[0].max(wanted[1]) || *got < 0.5 * finest) {
        return Err(format!("spacing {got:?} m of samples {wanted:?} m apart"));
    }
    Ok(agreed)
}
