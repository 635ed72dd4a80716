//! Tiles as files in folders: `zoom/column/row.png`, and what a maker put beside them.
//!
//! Rows are counted from the north (XYZ), or from the south (TMS) where `tilemapresource.xml`, the metadata or a person says so. `row@2x.png` is the same tile with twice the texels.
//! Folders are looked at two deep and by number, so links that lead round in a ring do no harm. Cost: a look at each name to count the tiles; the names of one column in memory.

use super::about::{About, MAX_TEXT_BYTES};
use super::archive::{Archive, Levels, count};
use super::grid::{MAX_ZOOM, Span, Tile, last};
use crate::input;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, DirEntry};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::{OnceLock, PoisonError, RwLock};
use terrasoar_layout::error::LayoutError;

/// Extensions of tiles.
const EXTENSIONS: [&str; 4] = ["png", "webp", "jpg", "jpeg"];
/// What a maker may put beside the zooms, as JSON.
const JSON: [&str; 3] = ["metadata.json", "tiles.json", "tile.json"];
const TILE_MAP: &str = "tilemapresource.xml";
/// Names looked at to tell a folder of tiles from others.
const LOOKED_AT: usize = 4096;

/// A folder of tiles.
pub(super) struct Folder {
    path: PathBuf,
    about: About,
    from_south: bool,
    /// Ends of names that were met: ".png", "@2x.webp". Those of more texels come first.
    endings: RwLock<BTreeSet<(bool, String)>>,
    zooms: OnceLock<BTreeMap<u8, PathBuf>>,
}

/// A number as tiles are numbered: without signs or leading zeros.
fn numbered(text: &str) -> Option<u32> {
    let is_plain = text.bytes().all(|byte| byte.is_ascii_digit()) && (text == "0" || !text.starts_with('0'));
    text.parse().ok().filter(|_| is_plain)
}

/// The row of a tile's name, and what follows it.
fn row_of(name: &str) -> Option<(u32, &str)> {
    let ends = name.find(|c: char| !c.is_ascii_digit())?;
    let (row, ending) = name.split_at(ends);
    let extension = ending.strip_prefix("@2x").unwrap_or(ending).strip_prefix('.')?;
    EXTENSIONS.iter().any(|known| known.eq_ignore_ascii_case(extension)).then_some(())?;
    Some((numbered(row)?, ending))
}

/// Folders in a folder that have a number up to `most` for a name.
fn numbers(folder: &Path, most: u32) -> Result<BTreeMap<u32, PathBuf>, LayoutError> {
    let mut found = BTreeMap::new();
    for entry in entries(folder)? {
        let entry = entry?;
        let number = entry.file_name().to_str().and_then(numbered).filter(|number| *number <= most);
        if let Some(number) = number
            && entry.path().is_dir()
        {
            found.insert(number, entry.path());
        }
    }
    Ok(found)
}

fn entries(folder: &Path) -> Result<impl Iterator<Item = Result<DirEntry, LayoutError>>, LayoutError> {
    let failed = |source| LayoutError::io(folder, "cannot list the folder of tiles", source);
    let listed = fs::read_dir(folder).map_err(failed)?;
    Ok(listed.map(move |entry| {
        entry.map_err(|source| LayoutError::io(folder, "cannot list the folder of tiles", source))
    }))
}

/// Whether there are tiles in the folder at `path`: some file `number/number/number.png`.
pub(super) fn is_folder(path: &Path) -> bool {
    let some = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().take(LOOKED_AT);
    let in_numbers = |folder: &Path| {
        let is_number = |entry: &DirEntry| entry.file_name().to_str().and_then(numbered).is_some();
        some(folder).filter(is_number).map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let is_tile = |entry: DirEntry| entry.file_name().to_str().and_then(row_of).is_some();
    let zooms = in_numbers(path);
    zooms
        .iter()
        .flat_map(|zoom| in_numbers(zoom).into_iter().take(16))
        .any(|column| some(&column).any(is_tile))
}

impl Folder {
    /// Reads what stands beside the tiles.
    pub(super) fn open(path: &Path, from_south: bool) -> Result<Self, LayoutError> {
        let mut about = About::default();
        for name in JSON {
            if let Some(text) = text(&path.join(name))? {
                about.take_json(&serde_json::from_str(&text).unwrap_or_default(), name);
            }
        }
        if let Some(text) = text(&path.join(TILE_MAP))? {
            about.take_tile_map(&text);
        }
        let from_south = from_south || about.from_south == Some(true);
        let (endings, zooms) = (RwLock::default(), OnceLock::new());
        Ok(Self { path: path.to_owned(), about, from_south, endings, zooms })
    }

    fn zooms(&self) -> Result<&BTreeMap<u8, PathBuf>, LayoutError> {
        if self.zooms.get().is_none() {
            let found = numbers(&self.path, MAX_ZOOM.into())?;
            let _ = self.zooms.set(found.into_iter().map(|(zoom, path)| (zoom as u8, path)).collect());
        }
        Ok(self.zooms.get_or_init(BTreeMap::new))
    }

    fn row(&self, tile: Tile) -> u32 {
        if self.from_south { tile.row_from_south() } else { tile.y }
    }

    /// Calls `each` with the tiles of a zoom in a span, and `ended` with the end of each name.
    fn each_tile(
        &self,
        zoom: u8,
        span: Span,
        mut ended: impl FnMut(&str),
        mut each: impl FnMut(Tile),
    ) -> Result<(), LayoutError> {
        let Some(folder) = self.zooms()?.get(&zoom) else { return Ok(()) };
        for (x, column) in numbers(folder, last(zoom))? {
            if !(span.x[0]..=span.x[1]).contains(&x) {
                continue;
            }
            let mut rows = BTreeSet::new();
            for entry in entries(&column)? {
                let name = entry?.file_name();
                let Some((row, ending)) = name.to_str().and_then(row_of) else { continue };
                if row <= last(zoom) {
                    ended(ending);
                    rows.insert(row);
                }
            }
            for row in rows {
                let tile = Tile { zoom, x, y: row };
                let tile = Tile { y: self.row(tile), ..tile };
                if span.holds(tile) {
                    each(tile);
                }
            }
        }
        Ok(())
    }

    /// The file of a tile, if there is one.
    fn file(&self, tile: Tile) -> Result<Option<PathBuf>, LayoutError> {
        let folder = self.path.join(tile.zoom.to_string()).join(tile.x.to_string());
        let row = self.row(tile);
        for (_, ending) in self.endings.read().unwrap_or_else(PoisonError::into_inner).iter() {
            let file = folder.join(format!("{row}{ending}"));
            match fs::metadata(&file) {
                Ok(_) => return Ok(Some(file)),
                Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {}
                Err(source) => return Err(LayoutError::io(&file, "cannot look for the tile", source)),
            }
        }
        Ok(None)
    }
}

/// The text of a file beside the tiles, if it is there and not too long.
fn text(path: &Path) -> Result<Option<String>, LayoutError> {
    if !path.is_file() {
        return Ok(None);
    }
    let action = "cannot read what stands beside the tiles";
    let mut bytes = Vec::new();
    let read = input::open(path, action)?.take(MAX_TEXT_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(|source| LayoutError::io(path, action, source))?;
    if bytes.len() as u64 > MAX_TEXT_BYTES {
        return Err(LayoutError::unsupported(
            path,
            format!("it is longer than the {MAX_TEXT_BYTES} bytes that such a file takes; put it elsewhere"),
        ));
    }
    Ok(Some(String::from_utf8_lossy(&bytes).into_owned()))
}

impl Archive for Folder {
    fn path(&self) -> &Path {
        &self.path
    }

    fn kind(&self) -> &'static str {
        if self.from_south { "folder of tiles (TMS)" } else { "folder of tiles" }
    }

    fn about(&self) -> &About {
        &self.about
    }

    fn rows_in_doubt(&self) -> Option<&'static str> {
        let is_said = self.from_south || self.about.from_south.is_some() || self.about.bounds.is_some();
        (!is_said).then_some(
            "nothing says from where rows of tiles are counted; from the north was taken (XYZ); if the ground lies on the other side of the equator, they are counted from the south (TMS)",
        )
    }

    fn memory_bytes(&self) -> u64 {
        1 << 20
    }

    fn survey(&self, within: &dyn Fn(u8) -> Option<Span>) -> Result<Levels, LayoutError> {
        let mut levels = Levels::new();
        let mut endings = BTreeSet::new();
        for zoom in self.zooms()?.keys() {
            let Some(span) = within(*zoom) else { continue };
            let ended = |ending: &str| _ = endings.insert((!ending.starts_with("@2x"), ending.to_owned()));
            self.each_tile(*zoom, span, ended, |tile| count(&mut levels, tile))?;
        }
        *self.endings.write().unwrap_or_else(PoisonError::into_inner) = endings;
        Ok(levels)
    }

    fn each_span(&self, zoom: u8, within: Span, each: &mut dyn FnMut(Span)) -> Result<(), LayoutError> {
        self.each_tile(zoom, within, |_| {}, |tile| each(Span::of(tile)))
    }

    fn has(&self, tile: Tile) -> Result<bool, LayoutError> {
        self.file(tile).map(|file| file.is_some())
    }

    fn fetch(&self, tile: Tile, most: u64, into: &mut Vec<u8>) -> Result<bool, LayoutError> {
        let Some(path) = self.file(tile)? else { return Ok(false) };
        into.clear();
        let read = input::open(&path, "cannot open the tile")?.take(most + 1).read_to_end(into);
        read.map_err(|source| LayoutError::io(&path, "cannot read the tile", source))?;
        if into.len() as u64 > most {
            return Err(self.too_long(tile, into.len() as u64, most));
        }
        Ok(true)
    }

    fn label(&self, tile: Tile) -> String {
        let Ok(Some(file)) = self.file(tile) else { return format!("tile {tile}") };
        let shown = file.strip_prefix(&self.path).unwrap_or(&file).display().to_string();
        format!("tile {}", terrasoar_layout::words::harmless(&shown, 80))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_tiles_are_numbers() {
        assert_eq!(row_of("17.png"), Some((17, ".png")));
        assert_eq!(row_of("0@2x.WebP"), Some((0, "@2x.WebP")));
        for other in ["17", "17.png.aux.xml", "017.png", "-1.png", "a.png", ".png", "4294967296.png", "1.tif"]
        {
            assert_eq!(row_of(other), None, "{other}");
        }
        assert_eq!(numbered("00"), None);
    }
}
