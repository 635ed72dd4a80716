//! A picture and what stands beside it: world file, `.prj`, `.aux.xml`, `.msk`; and its own mask.
//!
//! The place is the file's own, else that of the files beside it, as of elevation data ([`crate::beside`]). What a mask or a "no data" value hides becomes transparent. Cost: a mask is
//! read before the first row, into a bit a texel.

use crate::OpenOptions;
use crate::beside::Beside;
use crate::crs::{self, System};
use crate::mask::{Bits, Masking};
use crate::reader::{Declared, Picture, Said};
use std::path::Path;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};

/// A picture with what is said beside it.
pub(super) struct Completed {
    picture: Box<dyn Picture>,
    info: ImageInfo,
    system: System,
    masking: Option<Masking>,
    /// Value of all colours where there is no picture, as a file beside it says.
    void: Option<u8>,
}

impl Completed {
    /// Looks beside the picture.
    pub(super) fn new(picture: Box<dyn Picture>) -> Result<Self, LayoutError> {
        let path = picture.path().to_owned();
        let mut info = picture.info().clone();
        let mut declared = Declared::new(info.texels, SampleType::U8, info.format.clone());
        let (map, crs) = picture.said();
        declared.place = map.map(|map| Said::new(map, "the picture"));
        declared.crs = crs;
        let beside = Beside::of_picture(&path, picture.mask().is_some());
        let masking = beside.complete(&mut declared, &OpenOptions::default())?;
        let system =
            crs::resolve(&declared.crs, None, &mut declared.warnings).unwrap_or_else(|_| System::unknown());
        info.georeference = crs::georeference(&system, declared.place.map(|place| place.value));
        info.notes.extend(declared.warnings.into_iter().map(|warning| warning.words));
        info.notes.extend(declared.notes);
        let mut void = None;
        for said in &declared.value.nodata {
            let value = said.value.trim().parse::<f64>().ok();
            match value.filter(|value| value.fract() == 0.0 && (0.0..=255.0).contains(value)) {
                Some(value) if picture.has_bytes() => void = Some(value as u8),
                _ => info.notes.push(format!(
                    "\"no data\" {} from {} is no value of this picture and was passed over",
                    terrasoar_layout::words::harmless(said.value.trim(), 40),
                    said.by
                )),
            }
        }
        let masks = masking.as_ref().map_or(0, Masking::memory_bytes);
        info.memory_bytes = info.memory_bytes.saturating_add(masks);
        Ok(Self { picture, info, system, masking, void })
    }

    /// Bits in use of its channels, as [`Picture::bits`].
    pub(super) fn bits(&self) -> Result<u32, LayoutError> {
        self.picture.bits()
    }

    /// As [`Picture::use_bits`].
    pub(super) fn use_bits(&mut self, bits: u32) {
        self.picture.use_bits(bits);
    }

    /// The reference system that it lies in.
    pub(super) fn system(&self) -> &System {
        &self.system
    }
}

impl ImageSource for Completed {
    fn path(&self) -> &Path {
        self.picture.path()
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        let mut mask = None;
        if let Some(masking) = &self.masking {
            mask = masking.keep(self.picture.mask())?.map(|bits| (masking, bits));
        }
        let rows = self.picture.rows()?;
        if mask.is_none() && self.void.is_none() {
            return Ok(rows);
        }
        Ok(Box::new(Rows { rows, mask, void: self.void, wide: self.info.texels[0] as usize, y: 0 }))
    }
}

struct Rows<'p> {
    rows: Box<dyn RowReader + 'p>,
    mask: Option<(&'p Masking, Bits)>,
    void: Option<u8>,
    wide: usize,
    y: u32,
}

impl RowReader for Rows<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        self.rows.read(rgba)?;
        for row in rgba.chunks_exact_mut(4 * self.wide) {
            let (texels, _) = row.as_chunks_mut::<4>();
            if let Some(void) = self.void {
                texels.iter_mut().filter(|texel| texel[..3] == [void; 3]).for_each(|texel| texel[3] = 0);
            }
            if let Some((masking, bits)) = &self.mask {
                masking.hide_row(bits, self.y, |at| texels[at][3] = 0)?;
            }
            self.y += 1;
        }
        Ok(())
    }
}
