//! The terrain file as an argument, and words for what its header says.

use anyhow::Result;
use std::path::{Path, PathBuf};
use terrasoar_layout::LayoutError;
use terrasoar_layout::dem::{HorizontalUnit, UnitOf};
use terrasoar_layout::file::header::{Header, SpacingOrigin};
use terrasoar_layout::read::terrain::Terrain;

use super::cache;
use super::output::decimal;
use super::overlays;

/// Which terrain is read: a file, and edits of it in another.
#[derive(Debug, clap::Args)]
pub(super) struct TerrainArgs {
    /// Terrain file (.iqt); elevation data is built first, into the folder for caches, where it is to be looked at only
    pub(super) file: PathBuf,
    /// Edits of it that are kept apart (.iqo), as `terrasoar edit --overlay` makes them
    #[arg(long, value_name = "O.iqo")]
    pub(super) overlay: Option<PathBuf>,
}

impl TerrainArgs {
    /// Opens it: mapped, or, where it is packed, to be unpacked page by page. Elevation data is built first.
    pub(super) fn open(&self) -> Result<Terrain> {
        page_by_page(self.open_mapped()?)
    }

    fn open_mapped(&self) -> Result<Terrain> {
        if let Some(overlay) = &self.overlay {
            let terrain = Terrain::open_with_overlay(&self.file, overlay)?;
            overlays::tell_of_older(&terrain);
            return Ok(terrain);
        }
        match self.kept()? {
            Some(kept) => open(&kept),
            None => open(&self.file),
        }
    }

    /// Where the terrain file is that elevation data is built into; `None` where this is no elevation data.
    pub(super) fn kept(&self) -> Result<Option<PathBuf>> {
        match Terrain::open_unmapped(&self.file) {
            Err(LayoutError::NotThisFormat { .. }) if self.overlay.is_none() => {
                cache::of_elevation_data(&self.file)
            }
            _ => Ok(None),
        }
    }

    /// Opens it without maps: what is cut short while it is read is an error, where a map would be a signal.
    pub(super) fn open_unmapped(&self) -> Result<Terrain> {
        let terrain = self.open_to_verify()?;
        overlays::tell_of_lost(&terrain);
        Ok(terrain)
    }

    /// Opens it without maps, for a verb that tells itself of a damaged newest header.
    pub(super) fn open_to_verify(&self) -> Result<Terrain> {
        let terrain = match &self.overlay {
            Some(overlay) => Terrain::open_with_overlay_unmapped(&self.file, overlay)?,
            None => Terrain::open_unmapped(&self.file)?,
        };
        overlays::tell_of_grown(&terrain);
        Ok(terrain)
    }

    /// Its files and others that are read, none of which an output may replace.
    pub(super) fn inputs<'a>(&'a self, others: &[&'a Path]) -> Vec<&'a Path> {
        let own = std::iter::once(self.file.as_path()).chain(self.overlay.as_deref());
        own.chain(others.iter().copied()).collect()
    }
}

/// A terrain file that is opened: mapped, or, where it is packed, to be unpacked page by page.
pub(super) fn open_for_pages(path: &Path) -> Result<Terrain> {
    page_by_page(open(path)?)
}

/// A terrain that is packed, without a map, so that nothing takes it for one whose records lie in memory.
fn page_by_page(terrain: Terrain) -> Result<Terrain> {
    if terrain.source().unpacking().is_some() {
        return Ok(terrain.open_again_unmapped()?);
    }
    Ok(terrain)
}

/// Opens a terrain file, naming what to do when it is elevation data instead.
pub(super) fn open(path: &Path) -> Result<Terrain> {
    let terrain = Terrain::open(path)?;
    overlays::tell_of_older(&terrain);
    Ok(terrain)
}

/// Where the spacing came from, in words.
pub(super) fn spacing_origin(header: &Header) -> String {
    match header.spacing_origin {
        SpacingOrigin::Dem => "from the elevation model".into(),
        SpacingOrigin::Degrees { centre_latitude_deg } => {
            format!("converted from degrees at the centre latitude {}", decimal(centre_latitude_deg, 4))
        }
        SpacingOrigin::User => "stated with --spacing".into(),
        SpacingOrigin::Assumed => "assumed, the elevation model does not say".into(),
    }
}

/// Spacing in words, such as `10.08 x 13.64 m`.
pub(super) fn spacing(header: &Header) -> String {
    let [east, north] = header.grid.spacing_m().map(|m| decimal(m, 4));
    if east == north { format!("{east} m") } else { format!("{east} x {north} m") }
}

/// A unit with its size: "US survey foot (0.30480061 m)".
pub(super) fn unit(unit: &UnitOf) -> String {
    let name = if unit.name.is_empty() { "unit" } else { unit.name.as_str() };
    let is_plain = if unit.is_angle { unit.size == 1f64.to_radians() } else { unit.size == 1.0 };
    match (is_plain, unit.is_angle) {
        (true, _) => name.to_owned(),
        (false, true) => format!("{name} ({} degrees)", decimal(unit.size.to_degrees(), 8)),
        (false, false) => format!("{name} ({} m)", decimal(unit.size, 8)),
    }
}

/// The unit of coordinates, if known.
pub(super) fn horizontal_unit(header: &Header) -> Option<String> {
    let by_code = match header.crs_unit {
        HorizontalUnit::Unknown => None,
        HorizontalUnit::Metre => Some("metre"),
        HorizontalUnit::Degree => Some("degree"),
        HorizontalUnit::Foot => Some("foot (0.3048 m)"),
        HorizontalUnit::UsSurveyFoot => Some("US survey foot (0.30480061 m)"),
    };
    header.about.horizontal_unit.as_ref().map(unit).or_else(|| by_code.map(str::to_owned))
}

/// Name and code of the reference system, if known.
pub(super) fn crs(header: &Header) -> Option<String> {
    match (header.crs_name.as_str(), header.epsg) {
        ("", None) => None,
        ("", Some(code)) => Some(format!("EPSG:{code}")),
        (name, Some(code)) if !name.contains(&code.to_string()) => Some(format!("{name} (EPSG:{code})")),
        (name, _) => Some(name.to_owned()),
    }
}
