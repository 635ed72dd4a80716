//! Files beside a map that tell other programs where it lies: a world file, and the reference system as `.prj` and `.aux.xml`.
//!
//! They stand under the picture's name, so that GIS programs find them. Cost: some hundred bytes.

use super::outputs::Force;
use super::siting::crs_text;
use anyhow::{Context, Result, bail};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use terrasoar::sink::FileSink;
use terrasoar_layout::file::header::Header;

/// A map of squares, north at the top.
#[derive(Debug, Clone, Copy)]
pub(super) struct Map {
    /// Metres east and north of the terrain's south-west sample, of the picture's north-west corner.
    pub(super) north_west_m: [f64; 2],
    /// Metres a pixel.
    pub(super) pixel_m: f64,
}

/// What is written beside a picture, and with what in it.
pub(super) struct Beside(Vec<(PathBuf, String)>);

/// The files beside `picture` over this terrain. None is replaced that says something else, but for the world file of a picture that is there already.
pub(super) fn beside(header: &Header, picture: &Path, force: Force) -> Result<Beside> {
    if header.sample_to_crs.is_none() {
        bail!(
            "the terrain does not know where on the ground it lies, so there is nothing to say in a world file; leave --world-file away"
        );
    }
    let mut files = vec![(picture.with_extension("pgw"), String::new())];
    if let Some(text) = crs_text(header).filter(|text| text.contains('[')) {
        files.push((picture.with_extension("prj"), format!("{text}\n")));
        let mut name = OsString::from(picture);
        name.push(".aux.xml");
        let text =
            text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
        files.push((name.into(), format!("<PAMDataset>\n  <SRS>{text}</SRS>\n</PAMDataset>\n")));
    }
    if !force.is_given() {
        for (i, (file, text)) in files.iter().enumerate() {
            // A world file beside a picture is that picture's. The others may be of something else with the same name.
            let is_ours = if i == 0 {
                picture.exists()
            } else {
                std::fs::read_to_string(file).is_ok_and(|there| there == *text)
            };
            if file.exists() && !is_ours {
                bail!(
                    "{}: this would replace a file that this verb did not make; name another output, or replace it with --force",
                    file.display()
                );
            }
        }
    }
    Ok(Beside(files))
}

impl Beside {
    /// Writes them.
    pub(super) fn write(self, header: &Header, map: Map) -> Result<Vec<String>> {
        let mut names = Vec::new();
        for (i, (path, text)) in self.0.into_iter().enumerate() {
            let text = if i == 0 { world(header, map).context("no world file")? } else { text };
            let mut file = FileSink::create(&path)?;
            std::io::Write::write_all(&mut file, text.as_bytes())
                .with_context(|| format!("{}: cannot write it; check the free space", path.display()))?;
            file.publish()?;
            names.push(path.display().to_string());
        }
        Ok(names)
    }
}

/// The six lines of a world file: how x and y change from pixel to pixel and from row to row, and those of the middle of the first pixel.
fn world(header: &Header, map: Map) -> Option<String> {
    let [x, a, b, y, d, e] = header.sample_to_crs?;
    let [east_m, north_m] = header.grid.spacing_m();
    let [columns, rows] = [map.pixel_m / east_m, map.pixel_m / north_m];
    let first = [map.north_west_m[0] / east_m + 0.5 * columns, map.north_west_m[1] / north_m - 0.5 * rows];
    let lines = [
        a * columns,
        d * columns,
        -b * rows,
        -e * rows,
        x + a * first[0] + b * first[1],
        y + d * first[0] + e * first[1],
    ];
    // No minus before a zero.
    Some(lines.map(|line| format!("{}\n", line + 0.0)).concat())
}
