//! Which variable of a netCDF file holds the heights, and which of its layers.
//!
//! What a person asks for comes first: a name, a name and the number of a layer ("z:3"), or a number alone. Otherwise it is the only grid there is, or the only one that
//! is called an elevation. Between several, and between the layers of one, nothing is guessed.

use super::attributes::text;
use netcdf_reader::{NcGroup, NcType, NcVariable};
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// Groups in groups that are looked into.
const DEEPEST: usize = 16;
/// Variables that are listed in a message.
const LISTED: usize = 12;

/// A variable that may hold heights.
#[derive(Debug, Clone)]
pub(super) struct Grid<'f> {
    /// Its place: names of groups, and its own.
    pub(super) place: String,
    pub(super) variable: &'f NcVariable,
    /// The group it is in.
    pub(super) group: &'f NcGroup,
    /// Whether it is a list of samples with its shape elsewhere, as GMT wrote before version 4.
    pub(super) is_flat: bool,
}

/// A grid and the layer of it that was chosen, counted along all leading dimensions.
#[derive(Debug, Clone)]
pub(super) struct Chosen<'f> {
    pub(super) grid: Grid<'f>,
    pub(super) layer: u64,
}

impl Grid<'_> {
    /// Layers: of how many grids it is made.
    fn layers(&self) -> u64 {
        let shape = self.variable.shape();
        let leading = if self.is_flat { &[] } else { &shape[..shape.len().saturating_sub(2)] };
        leading.iter().fold(1, |product: u64, size| product.saturating_mul(*size))
    }

    fn shown(&self) -> String {
        let name = harmless(&self.place, 40);
        match self.layers() {
            1 => name,
            layers => format!("{name}:1 to {name}:{layers}"),
        }
    }
}

/// All grids of a file.
pub(super) fn grids(root: &NcGroup) -> Vec<Grid<'_>> {
    let mut grids = Vec::new();
    collect(root, "", 0, &mut grids);
    grids
}

fn collect<'f>(group: &'f NcGroup, place: &str, depth: usize, grids: &mut Vec<Grid<'f>>) {
    let has_old_shape = group.variables.iter().any(|variable| variable.name() == "dimension");
    for variable in &group.variables {
        let shape = variable.shape();
        let is_number = matches!(
            variable.dtype(),
            NcType::Byte
                | NcType::Short
                | NcType::Int
                | NcType::Float
                | NcType::Double
                | NcType::UByte
                | NcType::UShort
                | NcType::UInt
                | NcType::Int64
                | NcType::UInt64
        );
        let is_flat = has_old_shape && variable.name() == "z" && shape.len() == 1;
        let is_grid = shape.len() >= 2 && shape[shape.len() - 2..].iter().all(|size| *size >= 2);
        if is_number && (is_flat || (is_grid && !is_auxiliary(group, variable))) {
            let place = format!("{place}{}", variable.name());
            grids.push(Grid { place, variable, group, is_flat });
        }
    }
    if depth < DEEPEST {
        for inner in &group.groups {
            collect(
                inner,
                &format!("{place}{}/", inner.name.rsplit('/').next().unwrap_or("")),
                depth + 1,
                grids,
            );
        }
    }
}

/// Whether a variable says something of others only: coordinates of two dimensions, bounds of cells.
fn is_auxiliary(group: &NcGroup, variable: &NcVariable) -> bool {
    let name = variable.name();
    let says = |attribute: &str, other: &NcVariable| {
        text(other.attributes(), attribute)
            .is_some_and(|words| words.split_whitespace().any(|word| word == name))
    };
    let others = || group.variables.iter().filter(|other| other.name() != name);
    others().any(|other| {
        ["bounds", "coordinates", "ancillary_variables", "climatology"]
            .iter()
            .any(|attribute| says(attribute, other))
    })
}

/// Standard names of heights and depths (CF).
const STANDARD_NAMES: [&str; 13] = [
    "surface_altitude",
    "altitude",
    "height",
    "height_above_reference_ellipsoid",
    "height_above_geopotential_datum",
    "height_above_mean_sea_level",
    "geopotential_height",
    "surface_geopotential",
    "geopotential",
    "bedrock_altitude",
    "ground_level_altitude",
    "sea_floor_depth_below_geoid",
    "sea_floor_depth_below_sea_surface",
];
/// Names of variables of heights.
const NAMES: [&str; 20] = [
    "elevation",
    "elev",
    "z",
    "band1",
    "topo",
    "topography",
    "dem",
    "height",
    "heights",
    "altitude",
    "bathymetry",
    "bathy",
    "depth",
    "hgt",
    "orog",
    "orography",
    "surface",
    "bedrock",
    "bed",
    "rose",
];

/// Whether it calls itself an elevation.
fn is_named(grid: &Grid<'_>) -> bool {
    let standard = text(grid.variable.attributes(), "standard_name");
    standard.is_some_and(|name| STANDARD_NAMES.contains(&name.as_str()))
        || NAMES.contains(&grid.variable.name().to_ascii_lowercase().as_str())
}

/// The grid and layer that `asked` means, or the only ones there can be.
pub(super) fn choose<'f>(
    path: &Path,
    grids: &[Grid<'f>],
    asked: Option<&str>,
) -> Result<Chosen<'f>, LayoutError> {
    if grids.is_empty() {
        return Err(LayoutError::unsupported(
            path,
            "it holds no grid of numbers of at least 2 x 2; name the file that does",
        ));
    }
    if let Some(word) = asked {
        return find(grids, word.trim()).ok_or_else(|| {
            let problem = format!(
                "{}: there is no grid \"{}\" in it; there {} {}",
                path.display(),
                harmless(word, 40),
                if grids.len() == 1 { "is" } else { "are" },
                listed(grids)
            );
            LayoutError::Usage(problem).mended_by(Remedy::Band)
        });
    }
    let named: Vec<&Grid<'_>> = grids.iter().filter(|grid| is_named(grid)).collect();
    let [grid] = (if grids.len() == 1 { grids.iter().collect() } else { named })[..] else {
        let problem = format!("it holds several grids, {}; say which one holds the heights", listed(grids));
        return Err(LayoutError::unsupported(path, problem).mended_by(Remedy::Band));
    };
    match grid.layers() {
        1 => Ok(Chosen { grid: grid.clone(), layer: 0 }),
        0 => Err(LayoutError::damaged(
            path,
            format!("variable \"{}\"", harmless(&grid.place, 40)),
            "it holds nothing yet; fetch the file again",
        )),
        layers => {
            let problem = format!("its heights are in {layers} layers, {}; say which one", grid.shown());
            Err(LayoutError::unsupported(path, problem).mended_by(Remedy::Band))
        }
    }
}

/// What a word means.
fn find<'f>(grids: &[Grid<'f>], word: &str) -> Option<Chosen<'f>> {
    let named = |name: &str| {
        let exact = grids.iter().find(|grid| grid.place == name);
        exact.or_else(|| grids.iter().find(|grid| grid.place.eq_ignore_ascii_case(name)))
    };
    let layer = |grid: &Grid<'f>, number: &str| {
        let number = number.parse::<u64>().ok().filter(|number| (1..=grid.layers()).contains(number))?;
        Some(Chosen { grid: grid.clone(), layer: number - 1 })
    };
    if let Some(grid) = named(word) {
        return (grid.layers() == 1).then(|| Chosen { grid: grid.clone(), layer: 0 });
    }
    if let Some((name, number)) = word.rsplit_once(':') {
        return layer(named(name)?, number);
    }
    let number = word.parse::<usize>().ok()?;
    match grids {
        [grid] if grid.layers() > 1 => layer(grid, word),
        _ => {
            let grid = grids.get(number.checked_sub(1)?)?;
            (grid.layers() == 1).then(|| Chosen { grid: grid.clone(), layer: 0 })
        }
    }
}

fn listed(grids: &[Grid<'_>]) -> String {
    let names: Vec<String> = grids.iter().take(LISTED).map(Grid::shown).collect();
    let more = if grids.len() > LISTED { " and more" } else { "" };
    format!("{}{more}", names.join(", "))
}
