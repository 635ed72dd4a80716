//! Files beside a DEM that say more about it: GDAL's `.aux.xml` and `.msk`, world files, `.prj`.
//!
//! What GDAL keeps beside a file counts where the file says nothing, and before the file itself where GDAL has it so ([`Corrects`](crate::reader::Corrects)). A world file or a `.prj` counts where the file says nothing. Each is looked for by its
//! name in small and in capital letters. Cost: a look at some names.

mod aux_xml;
mod prj;
mod world;

use crate::geotiff::TiffMask;
use crate::mask::{self, Masking};
use crate::options::OpenOptions;
use crate::reader::{Declared, Reader, Said};
use aux_xml::Aux;
use std::io::Read;
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;

/// What stands beside one file.
pub(crate) struct Beside {
    path: PathBuf,
    /// Nothing is looked for beside several files, or files that are read from elsewhere.
    looks: bool,
    has_mask: bool,
}

impl Beside {
    /// Beside the files `paths`, of which `reader` reads.
    pub(crate) fn of(paths: &[PathBuf], reader: &dyn Reader) -> Self {
        let path = paths.first().cloned().unwrap_or_default();
        Self { looks: paths.len() == 1 && path.is_file(), path, has_mask: reader.mask().is_some() }
    }

    /// Beside a picture, which may have a mask of its own.
    pub(crate) fn of_picture(path: &Path, has_mask: bool) -> Self {
        Self { looks: path.is_file(), path: path.to_owned(), has_mask }
    }

    /// Adds what is said beside the file to `declared`, and finds the mask.
    ///
    /// # Errors
    /// [`LayoutError::Io`] for a file that is there and cannot be read; [`LayoutError::Unsupported`] for one that says something else.
    pub(crate) fn complete(
        &self,
        declared: &mut Declared,
        options: &OpenOptions,
    ) -> Result<Option<Masking>, LayoutError> {
        let own = self.has_mask.then(|| Masking::new(&self.path, declared.samples, None, options));
        if !self.looks {
            return Ok(own);
        }
        let kept = match declared.corrects.nothing {
            true => None,
            false => text(&appended(&self.path, ".aux.xml"), aux_xml::MAX_BYTES)?,
        };
        let mut kept = kept.map(|(name, text)| (name, Aux::parse(&text)));
        if let Some((name, aux)) = &mut kept {
            aux.apply(name, declared);
        }
        let kept_place = |declared: &mut Declared| {
            if let Some((name, aux)) = &kept {
                aux.place(name, declared);
            }
        };
        if declared.corrects.place {
            kept_place(declared);
        }
        if declared.place.is_none() {
            declared.place = world::place(&self.path)?;
        }
        if declared.place.is_none() {
            kept_place(declared);
        }
        if declared.crs.text.is_none()
            && declared.crs.code.is_none()
            && let Some((name, found)) = with_extension(&self.path, &["prj"], crate::crs::MAX_TEXT_BYTES)?
        {
            declared.crs.text = Some(Said::new(prj::plain(&found), name));
        }
        let mask = mask::beside(&self.path);
        if own.is_some() || !mask.is_file() {
            return Ok(own);
        }
        let reader = TiffMask::open(&mask)?;
        if reader.declared().samples != declared.samples {
            let [columns, rows] = reader.declared().samples;
            declared.warnings.push(Warning::new(format!(
                "the mask {} is of {columns} x {rows} samples, unlike what it masks, and was passed over",
                name_of(&mask)
            )));
            return Ok(None);
        }
        declared.notes.push(format!("masked by {}", name_of(&mask)));
        Ok(Some(Masking::new(&mask, declared.samples, Some(Box::new(reader)), options)))
    }
}

/// The path with more at its end, extension and all.
fn appended(path: &Path, more: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(more);
    PathBuf::from(name)
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    terrasoar_layout::words::harmless(&name, 80)
}

/// Name and text of the first file with one of these extensions, given in small letters.
fn with_extension(
    path: &Path,
    extensions: &[&str],
    most: u64,
) -> Result<Option<(String, String)>, LayoutError> {
    for extension in extensions {
        for extension in [(*extension).to_owned(), extension.to_ascii_uppercase()] {
            let beside = path.with_extension(extension);
            if beside != path
                && let Some(found) = text(&beside, most)?
            {
                return Ok(Some(found));
            }
        }
    }
    Ok(None)
}

/// Name and text of a file, if it is there and no longer than `most` bytes.
fn text(path: &Path, most: u64) -> Result<Option<(String, String)>, LayoutError> {
    // A name that leads nowhere is none; one that leads to something else than a file is refused, for who put it there counts on it.
    let is_there = path.try_exists();
    if !is_there
        .map_err(|source| LayoutError::io(path, "cannot look for the file beside the data", source))?
    {
        return Ok(None);
    }
    let mut bytes = Vec::new();
    crate::input::open(path, "cannot open the file beside the data")?
        .take(most + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| LayoutError::io(path, "cannot read the file beside the data", source))?;
    if bytes.len() as u64 > most {
        return Err(LayoutError::unsupported(
            path,
            format!("it is longer than the {most} bytes that such a file takes; put it elsewhere"),
        ));
    }
    Ok(Some((name_of(path), String::from_utf8_lossy(&bytes).into_owned())))
}
