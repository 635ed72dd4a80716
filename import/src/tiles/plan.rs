//! Which zoom and which texels of a pyramid are read, and what is said about that.
//!
//! A person's zoom and bounds come first; then the bounds of the terrain that a picture is for, and those that the pyramid states. Without a zoom it is the deepest complete one: a zoom is complete if it has
//! every tile of its rectangle and that rectangle is as large as the one of the zoom above, or if it covers half of the ground that the zoom above covers. Half, because tiles at a ragged rim are there above and partly not below. Cost: a survey, and a look at
//! each place of a tile.

use super::archive::{Archive, Level, Levels};
use super::decode::{Texels, decode, most_of_all};
use super::grid::{Area, MAX_ZOOM, Span, Tile};
use crate::options::TileOptions;
use std::ops::Range;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::thousands;

/// Places of tiles for each tile that there is; a set that is thinner makes no picture.
const PLACES_A_TILE: u64 = 256;
/// Places up to which missing tiles are looked for one by one before anything is read.
const COUNTED_PLACES: u64 = 1 << 18;
/// Zooms above from which a missing tile is made, at most.
pub(super) const MOST_ABOVE: u8 = 5;
/// Longest side in texels.
const MAX_SIDE: u64 = 1 << 31;

/// What is read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    pub(super) zoom: u8,
    /// Texels on the sides of a tile.
    pub(super) side: u32,
    /// First texel of the world that is read, across and down.
    pub(super) first: [u64; 2],
    /// Texels that are read, across and down.
    pub(super) size: [u32; 2],
    /// The tiles that hold them.
    pub(super) span: Span,
    /// Zooms above that have tiles, from the deepest; missing tiles are made of them.
    pub(super) above: Vec<u8>,
    /// Tiles of the zoom that there are.
    count: u64,
    /// Some tiles, for a first look.
    pub(super) samples: Vec<Tile>,
    /// What was chosen, in words.
    pub(super) words: String,
    /// What is missing, in words.
    pub(super) missing: Option<String>,
}

/// What may be read of a pyramid: a person's bounds, those around what it is for, those that it states.
struct Bounds {
    area: Area,
    typed: bool,
}

impl Plan {
    /// Chooses. `around` is where it is needed: west, south, east and north in degrees.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] where nothing is left, or what is left is too thin or too large.
    pub(super) fn new(
        archive: &dyn Archive,
        options: &TileOptions,
        around: Option<[f64; 4]>,
    ) -> Result<Self, LayoutError> {
        let path = archive.path().display();
        let refused = |problem: String| LayoutError::Usage(format!("{path}: {problem}"));
        let bounds = Self::bounds(archive, options, around)?;
        let within = |zoom: u8| Some(bounds.area.tiles(zoom));
        let levels = archive.survey(&within)?;
        let (Some((coarsest, _)), Some((deepest, _))) = (levels.first_key_value(), levels.last_key_value())
        else {
            let anywhere = archive.survey(&|zoom| Some(Area::WORLD.tiles(zoom)))?;
            if anywhere.is_empty() {
                return Err(LayoutError::not_this_format(
                    archive.path(),
                    "there are no tiles in it; fetch it again",
                ));
            }
            return Err(refused(if bounds.typed {
                "none of its tiles lies in these bounds; check them: west, south, east, north in degrees"
                    .into()
            } else if around.is_some() {
                "none of its tiles lies on the terrain; check that both are of one place".into()
            } else {
                "none of its tiles lies in the bounds that it states; state them yourself".into()
            })
            .mended_by(Remedy::Bounds));
        };
        let (coarsest, deepest) = (*coarsest, *deepest);
        let zoom = match options.zoom {
            Some(zoom) if levels.contains_key(&zoom) => zoom,
            Some(zoom) => {
                let there: Vec<String> = levels.keys().map(u8::to_string).collect();
                return Err(refused(format!(
                    "it has no tiles of zoom {zoom} here; it has {}",
                    there.join(", ")
                ))
                .mended_by(Remedy::Zoom));
            }
            None => chosen(&levels),
        };
        let Some(level) = levels.get(&zoom) else {
            return Err(refused("its tiles changed while it was read; start again".into()));
        };
        let side = first_tile(archive, level)?.side;
        let texels = bounds.area.texels(zoom, side);
        let cut = |[first, end]: [u64; 2], tiles: [u32; 2]| -> Range<u64> {
            let side = u64::from(side);
            first.max(u64::from(tiles[0]) * side)..end.min((u64::from(tiles[1]) + 1) * side)
        };
        let [across, down] = [cut(texels[0], level.span.x), cut(texels[1], level.span.y)];
        let sides = [&across, &down].map(|range| range.end.saturating_sub(range.start));
        if sides.iter().any(|side| *side > MAX_SIDE || *side < 2) {
            return Err(refused(format!(
                "{} x {} texels are no terrain that can be built; state other bounds, or another zoom",
                counted(sides[0]),
                counted(sides[1])
            ))
            .mended_by(Remedy::Bounds));
        }
        let tile = |at: u64| (at / u64::from(side)) as u32;
        let span =
            Span { x: [tile(across.start), tile(across.end - 1)], y: [tile(down.start), tile(down.end - 1)] };
        let above: Vec<u8> = levels
            .keys()
            .rev()
            .copied()
            .filter(|above| *above < zoom && zoom - above <= MOST_ABOVE)
            .collect();
        let mut plan = Self {
            zoom,
            side,
            first: [across.start, down.start],
            size: sides.map(|side| side as u32),
            span,
            above,
            count: level.count,
            samples: level.samples.clone(),
            words: String::new(),
            missing: None,
        };
        plan.words = plan.say(coarsest, deepest, level, options.zoom.is_some());
        plan.missing = plan.count_missing(archive, level)?;
        Ok(plan)
    }

    /// Refuses tiles that lie scattered, of which a picture would be nearly all holes, every texel of them made and kept.
    ///
    /// # Errors
    /// [`LayoutError::Usage`], with what would help.
    pub(super) fn check_scattered(&self, path: &Path) -> Result<(), LayoutError> {
        if self.span.count() <= PLACES_A_TILE.saturating_mul(self.count) {
            return Ok(());
        }
        let [wide, high] = self.span.sides();
        Err(LayoutError::Usage(format!(
            "{}: the {} tiles of zoom {} lie scattered over {wide} x {high} places, nearly all of it void; state bounds around those that you need, or a lower zoom",
            path.display(),
            counted(self.count),
            self.zoom
        ))
        .mended_by(Remedy::Bounds))
    }

    fn bounds(
        archive: &dyn Archive,
        options: &TileOptions,
        around: Option<[f64; 4]>,
    ) -> Result<Bounds, LayoutError> {
        if let Some(typed) = options.bounds_deg {
            let area = Area::of_degrees(typed).ok_or_else(|| {
                LayoutError::Usage(
                    "bounds are west, south, east, north in degrees, none of them beyond a pole: the first less than the third, or greater where elevation data are read across 180 degrees, and the second less than the fourth"
                        .into(),
                )
                .mended_by(Remedy::Bounds)
            })?;
            return Ok(Bounds { area, typed: true });
        }
        let stated = archive.about().bounds.and_then(Area::of_degrees).unwrap_or(Area::WORLD);
        let needed = around.and_then(Area::of_degrees).unwrap_or(Area::WORLD);
        // Where both have nothing in common the pyramid's own bounds may be wrong.
        Ok(Bounds { area: stated.shared(needed).unwrap_or(needed), typed: false })
    }

    fn say(&self, coarsest: u8, deepest: u8, level: &Level, is_typed: bool) -> String {
        let zooms = if coarsest == deepest { String::new() } else { format!(" of {coarsest} to {deepest}") };
        let why = if is_typed {
            ", as typed"
        } else if self.zoom == deepest {
            ""
        } else {
            ", the deepest that covers the ground; deeper ones cover less than half of it"
        };
        let tiles = if level.count == 1 { "tile" } else { "tiles" };
        format!(
            "zoom {}{zooms}{why}: {} {tiles} of {side} x {side} texels, {} x {} of which are read",
            self.zoom,
            counted(level.count),
            counted(self.size[0].into()),
            counted(self.size[1].into()),
            side = self.side
        )
    }

    /// How many tiles are missing, and what becomes of them.
    fn count_missing(&self, archive: &dyn Archive, level: &Level) -> Result<Option<String>, LayoutError> {
        let places = self.span.count();
        if level.span == self.span && level.count >= places {
            return Ok(None);
        }
        if places > COUNTED_PLACES {
            let missing = places.saturating_sub(level.count);
            return Ok((missing > 0).then(|| {
                format!(
                    "some {} of {} tiles are missing: they are made of coarser tiles where there are any up to {MOST_ABOVE} zooms above, and are void elsewhere",
                    counted(missing),
                    counted(places)
                )
            }));
        }
        let (mut missing, mut made, mut coarsest) = (0, 0, self.zoom);
        for i in 0..places {
            let tile = self.span.tile(self.zoom, i);
            if archive.has(tile)? {
                continue;
            }
            missing += 1;
            if let Some(above) = self.above(archive, tile)? {
                made += 1;
                coarsest = coarsest.min(above.zoom);
            }
        }
        if missing == 0 {
            return Ok(None);
        }
        let of = format!("{} of {} tiles are missing: ", counted(missing), counted(places));
        let made_of = format!("made of coarser tiles, of zoom {coarsest} at least");
        Ok(Some(match made {
            0 => format!("{of}they are void"),
            _ if made == missing => format!("{of}they are {made_of}"),
            _ => {
                format!("{of}{} are {made_of}, the other {} are void", counted(made), counted(missing - made))
            }
        }))
    }

    /// The nearest tile above a missing one that there is.
    pub(super) fn above(&self, archive: &dyn Archive, tile: Tile) -> Result<Option<Tile>, LayoutError> {
        for zoom in &self.above {
            let above = tile.above(tile.zoom - zoom);
            if let Some(above) = above
                && archive.has(above)?
            {
                return Ok(Some(above));
            }
        }
        Ok(None)
    }
}

/// Digits with their thousands apart.
fn counted(number: u64) -> String {
    thousands(&number.to_string())
}

/// Decodes the first of a zoom's samples.
fn first_tile(archive: &dyn Archive, level: &Level) -> Result<Texels, LayoutError> {
    let mut bytes = Vec::new();
    for tile in &level.samples {
        if archive.fetch(*tile, most_of_all(), &mut bytes)? {
            return decode(archive.path(), || archive.label(*tile), &bytes);
        }
    }
    Err(LayoutError::damaged(archive.path(), "tiles", "they changed while they were read; start again"))
}

/// The deepest complete zoom; the coarsest, where none is.
fn chosen(levels: &Levels) -> u8 {
    let is_complete = |zoom: u8, level: &Level| {
        let Some(above) = zoom.checked_sub(1).and_then(|zoom| levels.get(&zoom)) else {
            // Nothing to compare with: all that there is of a zoom by itself.
            return !levels.keys().any(|other| *other < zoom) || level.count >= level.span.count();
        };
        (level.count >= level.span.count() && level.span.above() == above.span)
            || level.count >= above.count.saturating_mul(2)
    };
    let found = levels.iter().rev().find(|(zoom, level)| is_complete(**zoom, level));
    found.or(levels.first_key_value()).map_or(MAX_ZOOM, |(zoom, _)| *zoom)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiles::archive::count;

    fn levels(tiles: impl IntoIterator<Item = (u8, u32, u32)>) -> Levels {
        let mut levels = Levels::new();
        tiles.into_iter().for_each(|(zoom, x, y)| count(&mut levels, Tile { zoom, x, y }));
        levels
    }

    fn square(zoom: u8, x: Range<u32>, y: Range<u32>) -> impl Iterator<Item = (u8, u32, u32)> {
        x.flat_map(move |x| y.clone().map(move |y| (zoom, x, y)))
    }

    #[test]
    fn the_deepest_complete_zoom_is_chosen() {
        assert_eq!(chosen(&levels([(5, 17, 3)])), 5, "one tile");
        assert_eq!(chosen(&levels([(5, 17, 3), (6, 35, 7), (7, 70, 14)])), 7, "one tile a zoom");
        let all = square(4, 3..6, 5..9).chain(square(5, 6..12, 10..18));
        assert_eq!(chosen(&levels(all)), 5, "all of it");
        let rim = square(4, 3..6, 5..9).chain(square(5, 6..12, 10..18).filter(|(_, x, y)| (x + y) % 2 == 0));
        assert_eq!(chosen(&levels(rim)), 5, "half of it");
        let town = square(4, 0..8, 0..8).chain(square(5, 4..6, 4..6));
        assert_eq!(chosen(&levels(town)), 4, "a town in a country");
        let gap = square(4, 0..8, 0..8).chain(square(6, 8..9, 8..9).chain(square(6, 20..21, 8..9)));
        assert_eq!(chosen(&levels(gap)), 4, "scattered, and nothing between");
    }
}
