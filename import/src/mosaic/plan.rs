//! What lies over what: files sorted into grids, grids into sheets, sheets from the lowest to the highest.
//!
//! Which grids there are does not depend on the order of names: files are taken by their paths. Unless the highest ground counts, files have an order, and a sheet is a run of files of one grid in that
//! order; a file joins a sheet of its grid below others where it meets none of these. Cost: one comparison a file and grid, and with several grids one of boxes a pair of files at most.

use super::lattice::{Lattice, Tied};
use super::sheet::{Member, Sheet};
use super::source::Source;
use crate::crs::HorizontalSize;
use crate::options::Priority;
use std::path::PathBuf;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::ln;

/// Samples on a side of a sheet, at most: files that lie farther apart are a mistake, or several data sets.
const MOST_SIDE: i64 = 1 << 22;
/// Areas of steps within a fiftieth of each other are alike.
const ALIKE: f64 = 1.02;
/// Steps around a file within which another one may meet it: kernels reach three.
const MARGIN: f64 = 4.0;

/// Files with their systems, and the grids they lie on.
pub(super) struct Placed {
    pub(super) sources: Vec<Source>,
    pub(super) systems: Vec<Tied>,
    pub(super) lattices: Vec<Lattice>,
    /// Of each file: number of its grid, and where it begins there.
    pub(super) at: Vec<(usize, [i64; 2])>,
}

impl Placed {
    /// Finds systems and grids of files, which come in the order of their paths.
    pub(super) fn new(looked: Vec<(Source, crate::crs::System)>) -> Self {
        let (mut sources, mut systems, mut of) = (Vec::new(), Vec::<Tied>::new(), Vec::new());
        for (source, system) in looked {
            let tied = Tied::new(system);
            let known = systems.iter().position(|known| known.is_same(&tied, &source.map, source.samples));
            of.push(known.unwrap_or(systems.len()));
            if known.is_none() {
                systems.push(tied);
            }
            sources.push(source);
        }
        join_across_antimeridian(&mut sources, &systems, &of);
        let (mut lattices, mut at) = (Vec::<Lattice>::new(), Vec::new());
        for (source, system) in sources.iter().zip(of) {
            let place = |(number, lattice): (usize, &Lattice)| {
                let on = (lattice.system == system).then(|| lattice.place(&source.map, source.samples));
                on.flatten().map(|at| (number, at))
            };
            let found = lattices.iter().enumerate().find_map(place);
            at.push(found.unwrap_or((lattices.len(), [0; 2])));
            if found.is_none() {
                lattices.push(Lattice::of(system, &source.map));
            }
        }
        Self { sources, systems, lattices, at }
    }

    /// What `make` says of each file and the number of its system.
    pub(super) fn each<T>(&self, make: impl Fn(&Source, usize) -> T) -> Vec<T> {
        let all = self.sources.iter().zip(&self.at);
        all.map(|(source, at)| make(source, self.lattices[at.0].system)).collect()
    }

    /// Metres between the samples of a file.
    pub(super) fn steps_m(&self, source: usize) -> [f64; 2] {
        let Source { map, samples, .. } = &self.sources[source];
        let tied = &self.systems[self.lattices[self.at[source].0].system];
        let centre = crate::warp::apply(map, samples.map(|count| f64::from(count - 1) / 2.0));
        let steps = [[map[1], map[4]], [map[2], map[5]]];
        let measured = tied.ground.as_ref().and_then(|ground| ground.steps_m(centre, steps));
        let size = match tied.system.unit.as_ref().map(|unit| unit.size) {
            Some(HorizontalSize::Metres(metres)) => metres,
            Some(HorizontalSize::Radians(radians)) => radians * 6_378_137.0,
            None => 1.0,
        };
        let on_map = [map[1].abs() * size, map[5].abs() * size];
        measured.map(|(metres, _)| metres).filter(|metres| metres.iter().all(|m| *m > 0.0)).unwrap_or(on_map)
    }

    /// The sheets, from the lowest to the highest.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for files that lie too far apart.
    pub(super) fn sheets(&self, priority: Priority) -> Result<Vec<Sheet>, LayoutError> {
        let mut order: Vec<usize> = (0..self.sources.len()).collect();
        match priority {
            // From the lowest on.
            Priority::First => order.sort_by_key(|at| std::cmp::Reverse(self.sources[*at].rank)),
            Priority::Last => order.sort_by_key(|at| self.sources[*at].rank),
            Priority::Highest => {}
            Priority::Finest => order = self.coarsest_first(),
        }
        let mut runs: Vec<(usize, Vec<usize>)> = Vec::new();
        let counts_order = priority != Priority::Highest;
        for source in order {
            let lattice = self.at[source].0;
            let below = runs.iter().rposition(|(of, _)| *of == lattice);
            let is_free = |run: &usize| {
                let mut above = runs[run + 1..].iter().flat_map(|(_, members)| members);
                !counts_order || !above.any(|other| self.may_meet(source, *other))
            };
            match below.filter(is_free) {
                Some(run) => runs[run].1.push(source),
                None => runs.push((lattice, vec![source])),
            }
        }
        runs.into_iter().map(|(lattice, members)| self.sheet(lattice, &members)).collect()
    }

    /// Whether two files may have ground in common, or so close that new samples are made of both.
    fn may_meet(&self, a: usize, b: usize) -> bool {
        let [system, other] = [a, b].map(|source| self.lattices[self.at[source].0].system);
        if system != other {
            return true;
        }
        let turn = self.systems[system].turn().unwrap_or(0.0);
        let ends = |source: usize, i: usize| {
            let Source { map, samples, .. } = &self.sources[source];
            let (first, step) = ([map[0], map[3]][i], [map[1], map[5]][i]);
            let last = first + step * f64::from(samples[i] - 1);
            let margin = MARGIN * step.abs();
            [first.min(last) - margin, first.max(last) + margin]
        };
        let meet = |i: usize, shift: f64| {
            let ([low, high], [from, to]) = (ends(a, i), ends(b, i));
            low + shift <= to && from <= high + shift
        };
        meet(1, 0.0) && [0.0, turn, -turn].iter().any(|shift| meet(0, *shift))
    }

    /// Files by the area of their grid's step on the ground, the largest first; then by path, the last first.
    fn coarsest_first(&self) -> Vec<usize> {
        let mut areas = vec![f64::INFINITY; self.lattices.len()];
        for source in 0..self.sources.len() {
            let [x, y] = self.steps_m(source);
            let area = &mut areas[self.at[source].0];
            *area = area.min(x * y);
        }
        // No more than some hundreds, whatever the steps.
        let rank = |source: usize| (ln(areas[self.at[source].0]) / ln(ALIKE)).round() as i64;
        let mut order: Vec<usize> = (0..self.sources.len()).rev().collect();
        order.sort_by_key(|source| std::cmp::Reverse(rank(*source)));
        order
    }

    fn sheet(&self, lattice: usize, members: &[usize]) -> Result<Sheet, LayoutError> {
        let (mut low, mut high) = ([i64::MAX; 2], [i64::MIN; 2]);
        for source in members {
            for i in 0..2 {
                let at = self.at[*source].1[i];
                low[i] = low[i].min(at);
                high[i] = high[i].max(at + i64::from(self.sources[*source].samples[i]));
            }
        }
        let sides = [0, 1].map(|i| high[i] - low[i]);
        if sides.iter().any(|side| *side > MOST_SIDE) {
            let [first, last] = [members.first(), members.last()]
                .map(|source| source.map(|at| self.sources[*at].path.display().to_string()));
            return Err(LayoutError::Usage(format!(
                "the files span {} x {} samples, of which a terrain has at most 65,537 on a side; name files that lie together, not {} with {}",
                sides[0],
                sides[1],
                first.unwrap_or_default(),
                last.unwrap_or_default()
            )));
        }
        let member = |source: &usize| Member {
            source: *source,
            // Below the side.
            at: [0, 1].map(|i| (self.at[*source].1[i] - low[i]) as u32),
        };
        Ok(Sheet {
            samples: sides.map(|side| side as u32),
            map: self.lattices[lattice].map(low),
            members: members.iter().map(member).collect(),
            system: self.lattices[lattice].system,
        })
    }
}

/// Files on both sides of 180 degrees are close together if the western hemisphere is counted on past 180.
fn join_across_antimeridian(sources: &mut [Source], systems: &[Tied], of: &[usize]) {
    for (number, tied) in systems.iter().enumerate() {
        let Some(turn) = tied.turn() else { continue };
        let ends = |source: &Source, past: bool| {
            let add = if past && source.map[0] < 0.0 { turn } else { 0.0 };
            let [a, b] =
                [0.0, f64::from(source.samples[0] - 1)].map(|col| source.map[0] + col * source.map[1] + add);
            [a.min(b), a.max(b)]
        };
        let span = |past: bool| {
            let mine = sources.iter().zip(of).filter(|(_, system)| **system == number);
            let [low, high] = mine.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (source, _)| {
                let [a, b] = ends(source, past);
                [low.min(a), high.max(b)]
            });
            high - low
        };
        if span(false) > turn / 2.0 && span(true) < span(false) {
            let mine = sources.iter_mut().zip(of).filter(|(_, system)| **system == number);
            mine.filter(|(source, _)| source.map[0] < 0.0).for_each(|(source, _)| source.map[0] += turn);
        }
    }
}

/// So many files, in words.
pub(super) fn counted(files: usize) -> String {
    if files == 1 { "1 file".into() } else { format!("{files} files") }
}

/// The names of files, a few of them, for messages and what is kept.
pub(super) fn names(paths: &[PathBuf]) -> String {
    let name = |path: &PathBuf| {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        terrasoar_layout::words::harmless(&name, 40)
    };
    match paths {
        [] => String::new(),
        [one] => name(one),
        [one, other] => format!("{} and {}", name(one), name(other)),
        [first, .., last] => format!("{} to {}", name(first), name(last)),
    }
}
