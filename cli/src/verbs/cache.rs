//! Elevation data given where a terrain file is needed. It is built once into the user's folder for caches, and taken from there afterwards.
//!
//! A kept file is identified by what it was made of: name, length and times of the elevation data and of the files beside it, the content (the whole of small files, both ends of large ones), and this
//! program's version. **If any of that changes, it is built anew**, and so is a kept file that does not open. Files that were not used for a month are removed when another is built. Cost of a second call: reading
//! at most 8 MiB.

use super::output::complain;
use super::progress::Meter;
use super::remedy;
use anyhow::{Context, Result};
use etcetera::{BaseStrategy, choose_base_strategy};
use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::DemSource;
use terrasoar_layout::read::terrain::Terrain;

/// Bytes of each end of a file that are looked at; a file of twice as many is looked at whole.
const END_BYTES: u64 = 4 << 20;
/// How long a file is kept after its last use.
const KEPT: Duration = Duration::from_secs(30 * 24 * 3600);
/// Longest part of a name that is kept in the name of the file.
const MAX_NAME_CHARS: usize = 40;

/// The terrain file made of the elevation data at `path`; `None` if that is none that is known.
///
/// # Errors
/// Data that cannot be read or built; a folder that cannot be written to, with what to type instead.
pub(super) fn of_elevation_data(path: &Path) -> Result<Option<PathBuf>> {
    if !fs::metadata(path).is_ok_and(|meta| meta.is_file()) {
        return Ok(None);
    }
    // Before it is opened, so that what replaces it meanwhile is not taken for it.
    let key = key(path).with_context(|| format!("{}: cannot read the elevation data", path.display()));
    let dem = match terrasoar_import::open_file(path) {
        Ok(dem) => dem,
        Err(LayoutError::NotThisFormat { .. }) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let by_hand = format!("terrasoar build {} -o OUT.iqt", path.display());
    let folder = folder().with_context(|| {
        format!("{}: elevation data is built before it is shown, and no folder for that is known; type: {by_hand}", path.display())
    })?;
    let stem: String = path
        .file_stem()
        .unwrap_or(OsStr::new("terrain"))
        .to_string_lossy()
        .chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | '.'))
        .take(MAX_NAME_CHARS)
        .collect();
    let key = key?;
    let kept = folder.join(format!("{stem}-{key:016x}.iqt"));
    if Terrain::open_unmapped(&kept).is_ok() {
        // So that it counts as asked for; where that fails it is built again in a month.
        let _ = File::open(&kept).and_then(|file| file.set_modified(SystemTime::now()));
        complain(&format!(
            "note: {} was built before and is taken from {}; with options of your own: {by_hand}",
            path.display(),
            kept.display()
        ));
        return Ok(Some(kept));
    }
    fs::create_dir_all(&folder).with_context(|| unwritable(path, &folder, &by_hand))?;
    sweep(&folder);
    complain(&format!(
        "note: {} is elevation data; it is built into {}, where later calls find it; with options of your own: {by_hand}",
        path.display(),
        kept.display()
    ));
    make(&*dem, &kept).with_context(|| unwritable(path, &folder, &by_hand))?;
    Ok(Some(kept))
}

fn make(dem: &dyn DemSource, kept: &Path) -> Result<()> {
    build(dem, kept, &BuildOptions::default(), &Meter::new("samples"))?;
    dem.warnings().iter().for_each(|warning| complain(&remedy::warned(warning)));
    Ok(())
}

fn unwritable(path: &Path, folder: &Path, by_hand: &str) -> String {
    format!(
        "{}: no terrain could be built of it in the folder {}; type: {by_hand}",
        path.display(),
        folder.display()
    )
}

/// The folder of the files.
fn folder() -> Result<PathBuf> {
    Ok(choose_base_strategy()?.cache_dir().join("terrasoar").join("terrains"))
}

/// What the elevation data is known by.
fn key(path: &Path) -> std::io::Result<u64> {
    let mut key = DefaultHasher::new();
    env!("CARGO_PKG_VERSION").hash(&mut key);
    // What the build was asked for.
    format!("{:?}", BuildOptions::default()).hash(&mut key);
    let path = fs::canonicalize(path)?;
    describe(&path, &mut key)?;
    let mut file = File::open(&path)?;
    let length = file.metadata()?.len();
    let mut bytes = Vec::new();
    Read::by_ref(&mut file).take(END_BYTES).read_to_end(&mut bytes)?;
    file.seek(SeekFrom::Start(length.saturating_sub(END_BYTES).max(bytes.len() as u64)))?;
    file.take(END_BYTES).read_to_end(&mut bytes)?;
    bytes.hash(&mut key);
    // What a virtual raster is made of.
    let mut files = vec![path];
    files.extend(terrasoar_import::files_of(&files[0]));
    // One that goes away meanwhile is no part, and not beside one.
    for part in &files[1..] {
        let _ = describe(part, &mut key);
    }
    for other in beside(&files)? {
        let _ = describe(&other, &mut key);
    }
    Ok(key.finish())
}

/// World files, masks, projections: whatever shares the name of one of the files, the first of which has a folder that can be listed.
fn beside(files: &[PathBuf]) -> std::io::Result<Vec<PathBuf>> {
    let mut stems: BTreeMap<&Path, HashSet<String>> = BTreeMap::new();
    for file in files {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        stems.entry(file.parent().unwrap_or(Path::new("."))).or_default().insert(stem);
    }
    let mut found = Vec::new();
    for (folder, stems) in stems {
        let entries = match fs::read_dir(folder) {
            Err(error) if files[0].parent() == Some(folder) => return Err(error),
            Err(_) => continue,
            Ok(entries) => entries,
        };
        found.extend(entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|other| {
            let name = other.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
            let is_beside = name.match_indices('.').any(|(at, _)| stems.contains(&name[..at]));
            is_beside && other.extension().is_none_or(|end| end != "iqt")
        }));
    }
    found.sort();
    Ok(found)
}

/// Name, length and times of a file. That of its last change cannot be set back, as copies and archives do with the other.
fn describe(path: &Path, key: &mut DefaultHasher) -> std::io::Result<()> {
    let meta = fs::metadata(path)?;
    path.file_name().hash(key);
    meta.len().hash(key);
    meta.modified()?.hash(key);
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        (meta.ino(), meta.ctime(), meta.ctime_nsec()).hash(key);
    }
    Ok(())
}

/// Removes files that were not used for a month. A file that cannot be removed stays.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        let age = fs::metadata(&path).and_then(|meta| meta.modified()).map(|time| time.elapsed());
        let is_old = matches!(age, Ok(Ok(age)) if age > KEPT);
        if is_old && path.extension().is_some_and(|end| end == "iqt") {
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_key_changes_with_whatever_the_terrain_depends_on() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let write = |name: &str, bytes: &[u8]| {
            fs::write(at(name), bytes).unwrap();
            File::options()
                .write(true)
                .open(at(name))
                .and_then(|file| file.set_modified(SystemTime::UNIX_EPOCH))
                .unwrap();
            key(&at("a.tif")).unwrap()
        };
        let first = write("a.tif", b"heights");
        assert_eq!(write("b.tif", b"others"), first);
        assert_eq!(write("a.iqt", b"a terrain"), first);
        assert_eq!(write("ab.tfw", b"1"), first);
        let mut seen = vec![first, write("a.tif", b"heighty")];
        seen.push(write("a.tfw", b"1"));
        seen.push(write("A.TIF.AUX.xml", b"1"));
        seen.push(write("a.tif", &[7; 100]));
        // Both ends of a large file count.
        let mut large = vec![0; 3 * END_BYTES as usize];
        seen.push(write("a.tif", &large));
        large[5] = 1;
        seen.push(write("a.tif", &large));
        *large.last_mut().unwrap() = 1;
        seen.push(write("a.tif", &large));
        File::options()
            .write(true)
            .open(at("a.tif"))
            .and_then(|file| file.set_modified(SystemTime::now()))
            .unwrap();
        seen.push(key(&at("a.tif")).unwrap());
        // A file that is written over and keeps its time, as copies do; of a part of a virtual raster, and of what stands beside that, too.
        if cfg!(unix) {
            large[END_BYTES as usize + 9] = 1;
            seen.push(write("a.tif", &large));
            seen.push(write("a.tfw", b"2"));
            let vrt = concat!(
                r#"<VRTDataset rasterXSize="2" rasterYSize="2"><VRTRasterBand dataType="Int16" band="1"><SimpleSource>"#,
                r#"<SourceFilename relativeToVRT="1">p/part.tif</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"#
            );
            fs::create_dir(at("p")).unwrap();
            write("p/part.tif", b"1");
            seen.push(write("a.tif", vrt.as_bytes()));
            for name in ["p/part.tif", "p/part.tif.msk", "p/part.tif.msk", "p/part.tif.aux.xml"] {
                seen.push(write(name, b"2"));
            }
        }
        let count = seen.len();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), count);
    }

    #[test]
    fn what_is_old_goes_and_what_is_not_ours_stays() {
        let folder = tempfile::tempdir().unwrap();
        for (name, age_days) in [("old.iqt", 31), ("new.iqt", 29), ("old.txt", 99)] {
            let file = File::create(folder.path().join(name)).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(age_days * 24 * 3600)).unwrap();
        }
        sweep(folder.path());
        let mut left: Vec<_> =
            fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["new.iqt", "old.txt"]);
    }
}
