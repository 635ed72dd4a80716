//! From what was typed to files: names, folders and patterns.
//!
//! What a folder holds, and what a pattern fits, comes in the order of names. A folder's files count where they are of a format that says where it lies; previews, labels and notes beside the
//! data are passed over. A pattern is one that no shell took apart: `*`, `?` and `[a-z]`, in folders and names. Cost: a look at each file of a folder.

use crate::formats;
use crate::hgt;
use crate::tiles;
use std::path::{Component, Path, PathBuf};
use terrasoar_layout::error::LayoutError;

/// Files that a pattern may fit, or folders on its way.
const MOST_NAMES: usize = 200_000;

/// What was typed.
pub(crate) enum Inputs {
    /// One file; or `.hgt` tiles and folders of them, which are one grid.
    Alone(Vec<PathBuf>),
    /// Several files.
    Several(Vec<PathBuf>),
}

impl Inputs {
    /// The files that `paths` name.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for a pattern that fits nothing; [`LayoutError::Io`] for a folder that cannot be read; as [`crate::open`] for a folder without elevation data.
    pub(crate) fn of(paths: &[PathBuf]) -> Result<Self, LayoutError> {
        let mut files = Vec::new();
        let mut only_tiles = true;
        for path in paths {
            if path.is_dir() && tiles::is_folder(path) {
                // A pyramid of map tiles is one grid, as one file is.
                only_tiles = false;
                files.push(path.clone());
                continue;
            }
            if path.is_dir() {
                let (found, only) = in_folder(path)?;
                if found.is_empty() {
                    // Its reader says what the folder is.
                    return Ok(Self::Alone(vec![path.clone()]));
                }
                only_tiles &= only;
                files.extend(found);
                continue;
            }
            let found = match is_pattern(path) && path.symlink_metadata().is_err() {
                true => fitting(path)?,
                false => vec![path.clone()],
            };
            only_tiles &= found.iter().all(|file| hgt::is_tile(file));
            files.extend(found);
        }
        Ok(match files.len() {
            0 | 1 => Self::Alone(files),
            _ if only_tiles => Self::Alone(files),
            _ => Self::Several(files),
        })
    }
}

/// The elevation data in a folder and the folders in it, by name; and whether it is `.hgt` tiles alone.
fn in_folder(path: &Path) -> Result<(Vec<PathBuf>, bool), LayoutError> {
    let all = hgt::files_in(path)?;
    let (tiles, mut others): (Vec<PathBuf>, Vec<PathBuf>) =
        all.into_iter().partition(|file| hgt::is_tile(file));
    others.retain(|file| formats::is_placed(file));
    let is_tiles = others.is_empty();
    let mut files = hgt::each_once(&tiles);
    files.append(&mut others);
    files.sort();
    Ok((files, is_tiles))
}

/// Whether a name has signs of a pattern.
fn is_pattern(path: &Path) -> bool {
    path.to_str().is_some_and(|text| text.contains(['*', '?', '[']))
}

/// The files that a pattern fits, by name.
fn fitting(pattern: &Path) -> Result<Vec<PathBuf>, LayoutError> {
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        let name = match part {
            Component::Normal(name) if is_pattern(Path::new(name)) => name.to_string_lossy().into_owned(),
            part => {
                found.iter_mut().for_each(|path| path.push(part));
                continue;
            }
        };
        let signs: Vec<char> = name.chars().collect();
        let mut next = Vec::new();
        for folder in found {
            let shown = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
            // What is no folder, or is not there, has nothing that fits.
            let Ok(entries) = std::fs::read_dir(shown) else { continue };
            for entry in entries.flatten() {
                let name = entry.file_name();
                let Some(text) = name.to_str() else { continue };
                let is_hidden = text.starts_with('.') && signs.first() != Some(&'.');
                let text: Vec<char> = text.chars().collect();
                if !is_hidden && fits(&signs, &text) {
                    next.push(folder.join(name));
                }
                if next.len() > MOST_NAMES {
                    return Err(LayoutError::Usage(format!(
                        "{}: this pattern fits more than {MOST_NAMES} names; make it narrower",
                        pattern.display()
                    )));
                }
            }
        }
        found = next;
    }
    found.retain(|path| path.is_file());
    found.sort();
    if found.is_empty() {
        return Err(LayoutError::Usage(format!(
            "{}: no file has a name that fits this pattern; look at the folder's files with ls",
            pattern.display()
        )));
    }
    Ok(found)
}

/// Whether a name fits a pattern. Cost: the product of their lengths at most.
fn fits(pattern: &[char], name: &[char]) -> bool {
    let (mut p, mut n) = (0, 0);
    // Where the last star stood, and what it had taken.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        let step = match pattern.get(p) {
            Some('*') => {
                star = Some((p, n));
                p += 1;
                continue;
            }
            Some('?') => Some(p + 1),
            Some('[') => {
                class(&pattern[p..], name[n]).and_then(|(length, is_in)| is_in.then_some(p + length))
            }
            Some(sign) => (*sign == name[n]).then_some(p + 1),
            None => None,
        };
        match (step, star) {
            (Some(next), _) => (p, n) = (next, n + 1),
            (None, Some((at, taken))) => {
                star = Some((at, taken + 1));
                (p, n) = (at + 1, taken + 1);
            }
            (None, None) => return false,
        }
    }
    pattern[p.min(pattern.len())..].iter().all(|sign| *sign == '*')
}

/// Length of the class of signs that a pattern begins with, and whether a sign is in it; none without its end.
fn class(pattern: &[char], sign: char) -> Option<(usize, bool)> {
    let end = 2 + pattern.get(2..)?.iter().position(|sign| *sign == ']')?;
    let (is_not, signs) = match pattern[1] {
        '!' | '^' => (true, &pattern[2..end]),
        _ => (false, &pattern[1..end]),
    };
    let mut at = 0;
    let mut is_in = false;
    while at < signs.len() {
        if at + 2 < signs.len() && signs[at + 1] == '-' {
            is_in |= (signs[at]..=signs[at + 2]).contains(&sign);
            at += 3;
        } else {
            is_in |= signs[at] == sign;
            at += 1;
        }
    }
    Some((end + 1, is_in != is_not))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_those_of_shells() {
        let fits = |pattern: &str, name: &str| {
            let [pattern, name] = [pattern, name].map(|text| text.chars().collect::<Vec<_>>());
            super::fits(&pattern, &name)
        };
        for (pattern, name) in [
            ("*.tif", "a.tif"),
            ("*", ""),
            ("a*b*c", "a-b-b-c"),
            ("n4[5-7]_?.tif", "n46_x.tif"),
            ("[!a]b", "cb"),
            ("**", "x"),
        ] {
            assert!(fits(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in
            [("*.tif", "a.tiff"), ("n4[5-7]", "n48"), ("?", ""), ("a*b", "acx"), ("[a", "a"), ("[!a]b", "ab")]
        {
            assert!(!fits(pattern, name), "{pattern} {name}");
        }
        // Many stars end soon.
        assert!(
            !fits(&"*a".repeat(30), &"a".repeat(29)) && !fits(&("*a".repeat(12) + "b"), &"a".repeat(5000))
        );
    }

    #[test]
    fn patterns_name_files_in_order() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["x/b.tif", "x/a.tif", "y/c.tif", "y/.d.tif", "z.tif"] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"x").unwrap();
        }
        let names = |pattern: &str| {
            let found = fitting(&folder.path().join(pattern)).map_err(|error| error.to_string());
            found.map(|paths| {
                let inside = |path: &PathBuf| path.strip_prefix(folder.path()).unwrap().display().to_string();
                paths.iter().map(inside).collect::<Vec<_>>().join(" ")
            })
        };
        assert_eq!(names("*/*.tif").unwrap(), "x/a.tif x/b.tif y/c.tif");
        assert_eq!(names("[x]/?.tif").unwrap(), "x/a.tif x/b.tif");
        assert!(names("*.asc").unwrap_err().contains("no file has a name that fits"));
    }
}
