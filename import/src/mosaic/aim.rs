//! The system that a mosaic is made in, and which files have a place in it.
//!
//! It is the one that most samples are in, or the one that is asked for. A file that has no place there (another body, no tie to the ground, the other side of the globe) is named and left out; the others go on
//! without it. Cost: a projected point a file, a thousand for one that has no place.

use super::across::{Over, outside};
use super::lattice::Tied;
use super::plan::{Placed, counted};
use super::sheet::Sheet;
use super::source::Source;
use super::told::Told;
use crate::crs::is_earth;
use crate::options::OpenOptions;
use crate::warp::{mesh, target_system};
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Where files are brought.
pub(super) struct Aim {
    /// The system of the mosaic's grid.
    pub(super) tied: Tied,
    /// Its number if it is one of the files'.
    pub(super) own: Option<usize>,
    /// Whether the whole is brought into another system afterwards, as one file is.
    pub(super) is_later: bool,
    /// The system in which files must have a place in the end.
    wanted: Tied,
}

impl Aim {
    /// Of files and what is asked for.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for a system that is not known or does not go with the files.
    pub(super) fn of(
        name: &Path,
        placed: &Placed,
        sheets: &[Sheet],
        options: &OpenOptions,
    ) -> Result<Self, LayoutError> {
        let main = main_system(placed);
        let tied = &placed.systems[main];
        let here =
            |is_later: bool, wanted: Tied| Self { tied: tied.clone(), own: Some(main), is_later, wanted };
        let Some(text) = &options.reproject else { return Ok(here(false, tied.clone())) };
        // One grid is brought elsewhere as one file is; unlike ones each at once.
        let is_one = placed.lattices.len() == 1;
        let ground = match &tied.ground {
            Some(ground) => ground,
            None if is_one => return Ok(here(true, tied.clone())),
            None => return Err(untied(name, tied, tied)),
        };
        let (map, samples) = extent(name, placed, sheets, main)?;
        let system = target_system(name, text, &tied.system, ground, &map, samples)?;
        let wanted = Tied::new(system);
        if is_one {
            return Ok(here(true, if wanted.ground.is_some() { wanted } else { tied.clone() }));
        }
        check_way(name, tied, &wanted)?;
        let own = placed.systems.iter().position(|known| known.is_same(&wanted, &map, samples));
        Ok(Self { tied: wanted.clone(), own, is_later: false, wanted })
    }

    /// Whether some of a file's ground has a place.
    fn holds(&self, source: &Source, from: &Tied) -> bool {
        let is_same = from.is_same(&self.wanted, &source.map, source.samples);
        let over = Over::new(&source.map, from, &self.wanted, is_same);
        let middle = source.samples.map(|count| f64::from(count - 1) / 2.0);
        std::iter::once(middle).chain(mesh(source.samples)).any(|at| over.at(at, None).is_some())
    }
}

/// The files that have a place, in sheets, and where they are brought; `told` hears of the others.
///
/// # Errors
/// [`LayoutError::Usage`] where no file is left, or for the first without a place where `strict` is asked for; as [`Aim::of`].
pub(super) fn aimed(
    mut placed: Placed,
    options: &OpenOptions,
    told: &mut Told,
) -> Result<(Placed, Vec<Sheet>, Aim), LayoutError> {
    let main = main_system(&placed);
    let no_way = placed.each(|source, system| match system == main {
        true => None,
        false => check_way(&source.path, &placed.systems[system], &placed.systems[main]).err(),
    });
    placed = without(placed, no_way, options, told)?;
    loop {
        let sheets = placed.sheets(options.priority)?;
        let aim = Aim::of(&name(&placed), &placed, &sheets, options)?;
        let no_place = placed.each(|source, system| {
            (!aim.holds(source, &placed.systems[system])).then(|| {
                LayoutError::Usage(format!(
                    "{}: {} does not cover the place where it lies; bring the files into another system, or build it alone",
                    source.path.display(),
                    name_of(&aim.wanted)
                ))
                .mended_by(Remedy::Reproject)
            })
        });
        if no_place.iter().all(Option::is_none) {
            return Ok((placed, sheets, aim));
        }
        placed = without(placed, no_place, options, told)?;
    }
}

/// What the mosaic is called in messages.
pub(super) fn name(placed: &Placed) -> PathBuf {
    format!("the mosaic of {}", counted(placed.sources.len())).into()
}

/// The files of which nothing is `wrong`.
fn without(
    placed: Placed,
    wrong: Vec<Option<LayoutError>>,
    options: &OpenOptions,
    told: &mut Told,
) -> Result<Placed, LayoutError> {
    let is_any_left = wrong.iter().any(Option::is_none);
    let mut kept = Vec::new();
    for ((source, at), wrong) in placed.sources.into_iter().zip(&placed.at).zip(wrong) {
        match wrong {
            Some(error) if options.strict || !is_any_left => return Err(error),
            Some(error) => told.lose(&source.path, &error),
            None => kept.push((source, placed.systems[placed.lattices[at.0].system].system.clone())),
        }
    }
    Ok(Placed::new(kept))
}

/// The number of the system that most samples are in; of systems with as many the one of the first path.
fn main_system(placed: &Placed) -> usize {
    let mut samples = vec![0u64; placed.systems.len()];
    for (source, at) in placed.sources.iter().zip(&placed.at) {
        samples[placed.lattices[at.0].system] +=
            source.samples.iter().map(|n| u64::from(*n)).product::<u64>();
    }
    let most = samples.iter().max().copied().unwrap_or(0);
    samples.iter().position(|count| *count == most).unwrap_or(0)
}

/// Why data of one system cannot be brought into another.
///
/// # Errors
/// [`LayoutError::Usage`], naming the file.
fn check_way(path: &Path, from: &Tied, to: &Tied) -> Result<(), LayoutError> {
    let bodies = [from, to].map(|tied| tied.system.radius_m.is_none_or(is_earth));
    if bodies[0] != bodies[1] {
        return Err(LayoutError::Usage(format!(
            "{}: it lies on another body than most of the files: {} and {}; build it alone",
            path.display(),
            name_of(from),
            name_of(to)
        )));
    }
    if from.ground.is_none() || to.ground.is_none() {
        return Err(untied(path, from, to));
    }
    Ok(())
}

fn untied(path: &Path, from: &Tied, to: &Tied) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: it is in {} and most of the files are in {}, and one of these is not tied to the ground in a way that is known here; say which system all are in",
        path.display(),
        name_of(from),
        name_of(to)
    ))
    .mended_by(Remedy::ReferenceSystem)
}

fn name_of(tied: &Tied) -> String {
    match tied.system.name.as_str() {
        "" => "an unknown system".to_owned(),
        name => terrasoar_layout::words::harmless(name, 80),
    }
}

/// A coarse grid over all sheets in a system of the files, for finding a system to bring them into.
fn extent(
    name: &Path,
    placed: &Placed,
    sheets: &[Sheet],
    system: usize,
) -> Result<([f64; 6], [u32; 2]), LayoutError> {
    const CELLS: u32 = 1000;
    let tied = &placed.systems[system];
    let (mut low, mut high, mut near) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], None);
    for sheet in sheets {
        let way = Over::new(&sheet.map, &placed.systems[sheet.system], tied, sheet.system == system);
        for point in way.mesh(sheet, placed, &mut near) {
            low = [0, 1].map(|i| low[i].min(point[i]));
            high = [0, 1].map(|i| high[i].max(point[i]));
        }
    }
    if low[0] > high[0] {
        return Err(outside(name));
    }
    let step = [0, 1].map(|i| (high[i] - low[i]) / f64::from(CELLS));
    Ok(([low[0], step[0], 0.0, low[1], 0.0, step[1]], [CELLS + 1; 2]))
}
