//! What lies over what: files sorted into grids, grids into sheets, sheets from the lowest to the highest.
//!
//! Which grids there are does not depend on the order of names: files are taken by their paths. Unless the highest ground counts, files have an order, and a sheet is a run of files of one grid in that
//! order; a file joins a sheet of its grid below others where it meets none of these. Cost: one comparison a file and grid, and with several grids one of boxes a pair of files at most.

use super::lattice::{Lattice, Tied};
use super::sheet::{Member, Sheet};
use super::source::Source;
use crate::crs::{HorizontalSize, all_over};
use crate::options::Priority;
use std::path::PathBuf;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::MOST_SAMPLES_WORDS;
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
    /// Places all over the files of a system.
    pub(super) fn places_in(&self, system: usize) -> Vec<[f64; 2]> {
        let of = |(lattice, _): &(usize, _)| self.lattices[*lattice].system == system;
        let files = self.sources.iter().zip(&self.at).filter(|(_, at)| of(at));
        files.flat_map(|(source, _)| all_over(&source.map, source.samples)).collect()
    }

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
                "the files span {} x {} samples, of which a terrain has at most {MOST_SAMPLES_WORDS} on a side; name files that lie together, not {} with {}",
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

/// Files on both sides of 180 degrees, or of 0 where longitudes run to 360, are close together if they are counted on past it: so that they span the least of the circle.
fn join_across_antimeridian(sources: &mut [Source], systems: &[Tied], of: &[usize]) {
    for (number, tied) in systems.iter().enumerate() {
        let Some(turn) = tied.turn() else { continue };
        let mine: Vec<usize> = (0..sources.len()).filter(|at| of[*at] == number).collect();
        let ends = |at: &usize| {
            let Source { map, samples, .. } = &sources[*at];
            let last = map[0] + f64::from(samples[0] - 1) * map[1];
            [map[0].min(last), map[0].max(last)]
        };
        let turns = shortest(&mine.iter().map(ends).collect::<Vec<_>>(), turn);
        for (at, turns) in mine.iter().zip(turns.unwrap_or_default()) {
            sources[*at].map[0] += turns * turn;
        }
    }
}

/// By how many turns each of the spans must be moved so that all together are the shortest, from half a turn west of 0 on; nothing where they are short as they lie.
fn shortest(spans: &[[f64; 2]], turn: f64) -> Option<Vec<f64>> {
    let [low, high] = spans
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], span| [low.min(span[0]), high.max(span[1])]);
    // Also where there is none, or one that is no number.
    if !((high - low).is_finite() && high - low > turn / 2.0) {
        return None;
    }
    // Each brought into the first turn, by where it begins.
    let home = |span: &[f64; 2]| -(span[0] / turn).floor();
    let mut order: Vec<usize> = (0..spans.len()).collect();
    let at = |number: usize| spans[number].map(|end| end + turn * home(&spans[number]));
    order.sort_by(|a, b| at(*a)[0].total_cmp(&at(*b)[0]));
    // Where the span begins with one of them, those before it come a turn later.
    let mut after = vec![f64::NEG_INFINITY; order.len() + 1];
    for (place, number) in order.iter().enumerate().rev() {
        after[place] = at(*number)[1].max(after[place + 1]);
    }
    let (mut best, mut before) = ((high - low) - turn * 1e-9, f64::NEG_INFINITY);
    let mut begin = None;
    for (place, number) in order.iter().enumerate() {
        let [west, east] = at(*number);
        let length = after[place].max(before + turn) - west;
        if length < best {
            (best, begin) = (length, Some((place, west)));
        }
        before = before.max(east);
    }
    let (begin, west) = begin?;
    let all = if west >= turn / 2.0 { -1.0 } else { 0.0 };
    let mut turns = vec![0.0; spans.len()];
    for (place, number) in order.iter().enumerate() {
        turns[*number] = home(&spans[*number]) + all + if place < begin { 1.0 } else { 0.0 };
    }
    Some(turns)
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

#[cfg(test)]
mod tests {
    use super::shortest;

    #[test]
    fn files_span_the_least_of_the_circle() {
        let ends = |spans: &[[f64; 2]]| {
            let turns = shortest(spans, 360.0)?;
            let moved = spans.iter().zip(turns).map(|(span, turns)| span.map(|end| end + 360.0 * turns));
            Some(moved.collect::<Vec<_>>())
        };
        assert_eq!(ends(&[[0.0, 1.0], [359.0, 360.0]]).unwrap(), [[0.0, 1.0], [-1.0, 0.0]]);
        assert_eq!(ends(&[[179.0, 180.0], [-180.0, -179.0]]).unwrap(), [[179.0, 180.0], [180.0, 181.0]]);
        assert_eq!(ends(&[[-170.0, -160.0], [100.0, 110.0]]).unwrap(), [[190.0, 200.0], [100.0, 110.0]]);
        assert_eq!(ends(&[[350.0, 355.0], [-9.0, -5.0]]).unwrap(), [[-10.0, -5.0], [-9.0, -5.0]]);
        assert_eq!(ends(&[[-180.0, 180.0], [190.0, 200.0]]).unwrap(), [[-180.0, 180.0], [-170.0, -160.0]]);
        for lie in [&[[0.0, 10.0], [170.0, 175.0]][..], &[[-180.0, 0.0], [0.0, 180.0]], &[], &[[f64::NAN; 2]]]
        {
            assert_eq!(ends(lie), None, "{lie:?}");
        }
    }

    #[test]
    fn no_other_count_of_turns_is_shorter() {
        // All ways of moving up to five files by a turn either way, against the one that is found.
        let mut state = 7u64;
        let mut random = |most: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1u64 << 24) as f64 * most
        };
        for _ in 0..300 {
            let count = 2 + random(4.0) as usize;
            let spans: Vec<[f64; 2]> = (0..count)
                .map(|_| {
                    let west = random(720.0) - 360.0;
                    [west, west + random(40.0)]
                })
                .collect();
            let length = |turns: &[f64]| {
                let moved =
                    || spans.iter().zip(turns).map(|(span, turns)| span.map(|end| end + 360.0 * turns));
                moved().map(|span| span[1]).fold(f64::MIN, f64::max)
                    - moved().map(|span| span[0]).fold(f64::MAX, f64::min)
            };
            let found = length(&shortest(&spans, 360.0).unwrap_or(vec![0.0; count]));
            let ways = (0..5usize.pow(count as u32)).map(|way| {
                let turns: Vec<f64> =
                    (0..count).map(|at| (way / 5usize.pow(at as u32) % 5) as f64 - 2.0).collect();
                length(&turns)
            });
            let least = ways.fold(f64::MAX, f64::min);
            // Where files lie within half the circle nothing is moved.
            assert!(found <= least + 1e-6 || found <= 180.0, "{spans:?}: {found}, not {least}");
        }
    }
}
