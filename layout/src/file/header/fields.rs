//! A header slot's fields, read and checked one after the other (FORMAT.md, section 4).
//!
//! Invariant: no field is used before the checksum was found right, and a field that contradicts another is an error.

use super::about;
use super::{ErrorKind, Header, History, INERT_PAGE, ImageryPlace, SpacingOrigin};
use crate::dem::HorizontalUnit;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, checksum, get_f64, get_text, get_u16, get_u32, get_u64};
use crate::file::version::{PACKED_VERSION, is_another};
use crate::grid::Grid;
use crate::grid::record::{RadiusCodes, RecordKind, RecordScale};
use std::path::Path;

/// A header slot of a file.
#[derive(Clone, Copy)]
pub(super) struct Fields<'p> {
    pub(super) path: &'p Path,
    pub(super) page: &'p Page,
}

impl Fields<'_> {
    fn damaged(&self, problem: &str) -> LayoutError {
        LayoutError::damaged(
            self.path,
            "header",
            format!("{problem}; build the file again or restore a copy"),
        )
    }

    fn check(&self, holds: bool, field: &str) -> Result<(), LayoutError> {
        if holds {
            return Ok(());
        }
        Err(self.damaged(&format!("the field {field} is out of range or contradicts another")))
    }

    fn out_of_range(&self, field: &str) -> LayoutError {
        self.damaged(&format!("the field {field} is out of range"))
    }

    fn text(&self, offset: usize, field: &str) -> Result<String, LayoutError> {
        get_text(&self.page[..], offset)
            .ok_or_else(|| self.damaged(&format!("the field {field} is not text")))
    }

    /// Magic bytes, version, checksum: whether the rest is worth a look.
    pub(super) fn check_seal(&self, magic: [u8; 8]) -> Result<(), LayoutError> {
        let p = &self.page[..];
        if p[..8] != magic {
            return Err(self.damaged("the magic bytes are missing"));
        }
        let major = get_u16(p, 0x008);
        if major == PACKED_VERSION {
            return Err(is_another(self.path));
        }
        if major != 1 {
            return Err(LayoutError::unsupported(
                self.path,
                format!(
                    "the file has format version {major}, this program reads versions 1 and 2; use a newer terrasoar"
                ),
            ));
        }
        if get_u32(p, 0xffc) != checksum(&p[..0xffc]) {
            return Err(self.damaged("the checksum does not match"));
        }
        self.check(get_u32(p, 0x00c) == PAGE_BYTES as u32, "page_bytes")
    }

    fn kinds(&self) -> Result<(RecordKind, ErrorKind), LayoutError> {
        let p = &self.page[..];
        let record_kind = match p[0x011] {
            1 => RecordKind::Compact,
            4 => RecordKind::Fine,
            2 => RecordKind::Exact8,
            3 => RecordKind::Exact16,
            _ => return Err(self.out_of_range("record_kind")),
        };
        let error_kind = match p[0x012] {
            1 => ErrorKind::Bounded,
            2 => ErrorKind::Step,
            _ => return Err(self.out_of_range("error_kind")),
        };
        self.check(p[0x013] <= 3, "flags")?;
        Ok((record_kind, error_kind))
    }

    fn grid(&self) -> Result<Grid, LayoutError> {
        let p = &self.page[..];
        let (samples, spacing_m) =
            ([get_u32(p, 0x014), get_u32(p, 0x018)], [get_f64(p, 0x020), get_f64(p, 0x028)]);
        let grid = Grid::new(samples, spacing_m)
            .map_err(|_| self.damaged("the size or spacing of the grid is out of range"))?;
        self.check(u32::from(p[0x010]) == grid.k(), "k")?;
        Ok(grid)
    }

    fn scale(&self, record_kind: RecordKind) -> Result<RecordScale, LayoutError> {
        let p = &self.page[..];
        Ok(RecordScale {
            height_base_m: get_f64(p, 0x030),
            height_step_m: get_f64(p, 0x038),
            error_top_m: get_f64(p, 0x050),
            radius_codes: match (record_kind, get_u32(p, 0x058)) {
                (RecordKind::Compact, steps @ (8 | 16 | 32 | 64)) => RadiusCodes::Octaves(steps),
                (RecordKind::Fine, octave) if RadiusCodes::FIRST_OCTAVES.contains(&(octave as i32)) => {
                    RadiusCodes::Excess { first_octave: octave as i32 }
                }
                (RecordKind::Exact8 | RecordKind::Exact16, 0) => RadiusCodes::Octaves(64),
                _ => return Err(self.out_of_range("radius_codes")),
            },
        })
    }

    fn spacing_origin(&self) -> Result<SpacingOrigin, LayoutError> {
        Ok(match self.page[0x0d5] {
            1 => SpacingOrigin::Dem,
            2 => SpacingOrigin::Degrees { centre_latitude_deg: get_f64(&self.page[..], 0x0d8) },
            3 => SpacingOrigin::User,
            4 => SpacingOrigin::Assumed,
            _ => return Err(self.out_of_range("spacing_origin")),
        })
    }

    fn crs_unit(&self) -> Result<HorizontalUnit, LayoutError> {
        Ok(match self.page[0x0d4] {
            0 => HorizontalUnit::Unknown,
            1 => HorizontalUnit::Metre,
            2 => HorizontalUnit::Degree,
            3 => HorizontalUnit::Foot,
            4 => HorizontalUnit::UsSurveyFoot,
            _ => return Err(self.out_of_range("crs_unit")),
        })
    }

    /// What the fields say, each for itself.
    pub(super) fn header(&self) -> Result<Header, LayoutError> {
        let p = &self.page[..];
        let (record_kind, error_kind) = self.kinds()?;
        let grid = self.grid()?;
        let scale = self.scale(record_kind)?;
        let spacing_origin = self.spacing_origin()?;
        let crs_unit = self.crs_unit()?;
        let map: [f64; 6] = std::array::from_fn(|i| get_f64(p, 0x0a0 + 8 * i));
        let imagery = match [get_u64(p, 0x090), get_u64(p, 0x098)] {
            [0, 0] => None,
            [offset, bytes] => Some(ImageryPlace { offset, bytes }),
        };
        let history = match [get_u32(p, 0x0e8), get_u32(p, 0x0ec)] {
            [0, 0] => None,
            [commit_page, tip_page] => Some(History { commit_page, tip_page }),
        };
        Ok(Header {
            grid,
            record_kind,
            scale,
            error_kind,
            has_voids: p[0x013] & 1 != 0,
            heights_rounded: p[0x013] & 2 != 0,
            generation: get_u32(p, super::GENERATION),
            height_range_m: [get_f64(p, 0x040), get_f64(p, 0x048)],
            nodata_samples: get_u64(p, 0x060),
            stored_pages: get_u64(p, 0x070),
            root_page: get_u32(p, 0x078),
            root_checksum: get_u32(p, 0x080),
            file_bytes: get_u64(p, 0x088),
            imagery,
            history,
            sample_to_crs: (map != [0.0; 6]).then_some(map),
            epsg: Some(get_u32(p, 0x0d0)).filter(|code| *code != 0),
            crs_unit,
            spacing_origin,
            body_radius_m: Some(get_f64(p, 0x0e0)).filter(|r| *r != 0.0),
            crs_name: self.text(0x200, "crs_name")?,
            source: self.text(0x300, "source")?,
            about: about::get(p).ok_or_else(|| self.damaged("the field about is not what it should be"))?,
        })
    }

    /// Whether numbers are such as a header may hold, and counts and places agree with each
    /// other and with the length of the file.
    pub(super) fn check_places(&self, header: &Header) -> Result<(), LayoutError> {
        let p = &self.page[..];
        let page_bytes = PAGE_BYTES as u64;
        if let Some(field) = header.first_wrong_number() {
            self.check(false, field.name())?;
        }
        let samples = u64::from(header.grid.samples()[0]) * u64::from(header.grid.samples()[1]);
        self.check(header.nodata_samples <= samples, "nodata_samples")?;
        self.check(get_u64(p, 0x068) == header.record_pages(), "record_pages")?;
        self.check(header.stored_pages <= header.record_pages(), "stored_pages")?;
        self.check(u64::from(get_u32(p, 0x07c)) == header.directory().root_entries(), "root_entries")?;
        let root_end = u64::from(header.root_page) * page_bytes + 16 * header.directory().root_entries();
        self.check(header.root_page > INERT_PAGE && root_end <= header.file_bytes, "root_page")?;
        self.check(header.file_bytes <= u64::from(u32::MAX) * page_bytes, "file_bytes")?;
        let fits = |place: ImageryPlace| {
            place.offset > u64::from(INERT_PAGE) * page_bytes
                && [place.offset, place.bytes].iter().all(|v| v.is_multiple_of(page_bytes))
                && (2 * page_bytes..=header.file_bytes).contains(&place.bytes)
                && place.end() <= header.file_bytes
        };
        self.check(header.imagery.is_none_or(fits), "imagery")?;
        let is_page =
            |page: u32| page > INERT_PAGE && (u64::from(page) + 1) * page_bytes <= header.file_bytes;
        let has_pages = |history: History| {
            is_page(history.tip_page) && (history.commit_page == 0 || is_page(history.commit_page))
        };
        self.check(header.history.is_none_or(has_pages), "commit_page or tip_page")
    }
}
