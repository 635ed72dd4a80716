//! Files that the window writes: named by terrain and time, in the folder it was started in.
//!
//! **Nothing is replaced**: where a name is taken a number follows.

use anyhow::{Context, Result};
use std::io::Write;
use std::path::{Path, PathBuf};
use terrasoar::sink::FileSink;
use terrasoar_lab::picture::encode;
use terrasoar_render::{Offscreen, wgpu};

/// A free name such as `alps-2026-03-01-142233.png` for what belongs to a terrain.
pub(crate) fn free_name(folder: &Path, terrain: &Path, extension: &str) -> PathBuf {
    let stem = terrain.file_stem().map_or_else(|| "terrain".into(), |stem| stem.to_string_lossy());
    let time = jiff::ZonedDateTime::now().strftime("%Y-%m-%d-%H%M%S").to_string();
    let first = folder.join(format!("{stem}-{time}.{extension}"));
    if !first.exists() {
        return first;
    }
    (2..)
        .map(|n| folder.join(format!("{stem}-{time}-{n}.{extension}")))
        .find(|path| !path.exists())
        .unwrap_or(first)
}

/// Writes a picture that has been drawn, as PNG.
pub(crate) fn picture(
    picture: &Offscreen,
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    path: &Path,
) -> Result<()> {
    let [width, height] = picture.target().size_px;
    let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
    for pixel in picture.read_rgba(device, queue)?.chunks_exact(4) {
        rgb.extend_from_slice(&pixel[..3]);
    }
    let file = encode(&rgb, [width, height]).context("the picture is incomplete")?;
    let mut sink = FileSink::create(path)?;
    sink.write_all(&file).with_context(|| format!("{}: the picture cannot be written", path.display()))?;
    Ok(sink.publish()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_terrain_and_time_and_replace_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut names = Vec::new();
        for _ in 0..3 {
            let path = free_name(folder.path(), Path::new("/a/high alps.iqt"), "png");
            std::fs::write(&path, "").unwrap();
            names.push(path.file_name().unwrap().to_str().unwrap().to_owned());
        }
        names.sort();
        names.dedup();
        assert_eq!(names.len(), 3);
        assert!(names.iter().all(|n| n.starts_with("high alps-20") && n.ends_with(".png")), "{names:?}");
    }
}
