//! The header: FORMAT.md, section 4, field by field, and the checks of section 6 that need nothing else.
//!
//! Invariant: a [`Header`] that [`Header::parse`] returned has every field in range and consistent with the others.

mod about;
mod fields;
mod numbers;

use super::bytes::{PAGE_BYTES, Page, checksum, get_u16, put_f64, put_text, put_u16, put_u32, put_u64};
use super::directory_shape::DirectoryShape;
use crate::dem::{About, HorizontalUnit};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::grid::order::slot_count;
use crate::grid::record::{RadiusCodes, RecordKind, RecordScale};
use fields::Fields;
use std::path::Path;

pub use super::version::MAGIC;
/// Where a header page has its generation, 4 bytes.
pub(crate) const GENERATION: usize = 0x01c;
/// The page that absent record pages read as.
pub const INERT_PAGE: u32 = 2;

/// Which error bound the records hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// Distance to the surface over all samples: what is drawn keeps its promise.
    Bounded,
    /// The papers' distance of the vertex from the edge it splits.
    Step,
}

impl ErrorKind {
    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bounded => "bounded",
            Self::Step => "step",
        }
    }
}

/// Where the sample spacing in metres came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpacingOrigin {
    /// The DEM gives it in a unit of length.
    Dem,
    /// Converted from degrees at the latitude of the DEM's centre, in degrees.
    Degrees {
        /// Latitude in degrees at which the conversion was made.
        centre_latitude_deg: f64,
    },
    /// The user stated it.
    User,
    /// Nothing was known.
    Assumed,
}

/// Where the imagery section lies (FORMAT.md, section 8).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageryPlace {
    /// First byte, of a page.
    pub offset: u64,
    /// Length in bytes, of whole pages.
    pub bytes: u64,
}

impl ImageryPlace {
    /// First byte after it.
    pub fn end(self) -> u64 {
        self.offset.saturating_add(self.bytes)
    }
}

/// Where the journal of a file that was edited begins (FORMAT.md, section 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct History {
    /// Journal page of the commit that led to the state the file is in; 0 for the state in which it was built.
    pub commit_page: u32,
    /// Journal page of the newest commit that redoing leads to.
    pub tip_page: u32,
}

/// What a terrain file says about itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Grid shape and spacing.
    pub grid: Grid,
    /// Kind of its records.
    pub record_kind: RecordKind,
    /// Scale of its records.
    pub scale: RecordScale,
    /// Kind of its errors.
    pub error_kind: ErrorKind,
    /// Whether any sample is void.
    pub has_voids: bool,
    /// Whether heights were rounded to the height step.
    pub heights_rounded: bool,
    /// Generation: 1 for a new file.
    pub generation: u32,
    /// Lowest and highest height in metres.
    pub height_range_m: [f64; 2],
    /// Samples without a height.
    pub nodata_samples: u64,
    /// Record pages present.
    pub stored_pages: u64,
    /// First page of the directory root.
    pub root_page: u32,
    /// CRC-32 of the directory root.
    pub root_checksum: u32,
    /// Length of the file.
    pub file_bytes: u64,
    /// Where its imagery lies, if it has any.
    pub imagery: Option<ImageryPlace>,
    /// Where its journal begins, if it was edited.
    pub history: Option<History>,
    /// Samples (east, north of the south-west sample) to reference-system coordinates, if known.
    pub sample_to_crs: Option<[f64; 6]>,
    /// EPSG code, if known.
    pub epsg: Option<u32>,
    /// Unit of the reference system.
    pub crs_unit: HorizontalUnit,
    /// Where the spacing came from.
    pub spacing_origin: SpacingOrigin,
    /// Radius of the body's equator in metres, if the DEM names one.
    pub body_radius_m: Option<f64>,
    /// Name of the reference system.
    pub crs_name: String,
    /// Format of the DEM.
    pub source: String,
    /// What else is kept of it in words.
    pub about: About,
}

/// The state that a file is in. A file that is written anew begins its generations anew, so a generation alone does not tell one state from another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FileState {
    generation: u32,
    root: [u32; 2],
    record_kind: RecordKind,
    scale: RecordScale,
}

impl FileState {
    /// Its generation.
    pub fn generation(&self) -> u32 {
        self.generation
    }
}

impl Header {
    /// The state of the file, which says which records it has and what they mean.
    pub fn state(&self) -> FileState {
        let root = [self.root_page, self.root_checksum];
        FileState { generation: self.generation, root, record_kind: self.record_kind, scale: self.scale }
    }

    /// Records a page.
    pub fn records_per_page(&self) -> u64 {
        (PAGE_BYTES / self.record_kind.bytes()) as u64
    }

    /// Logical record pages, absent ones included.
    pub fn record_pages(&self) -> u64 {
        slot_count(self.grid.k()).div_ceil(self.records_per_page())
    }

    /// How the directory is made up.
    pub(crate) fn directory(&self) -> DirectoryShape {
        DirectoryShape::new(self.grid.k(), self.record_pages())
    }

    /// The header as a page.
    pub fn to_page(&self) -> Box<Page> {
        let mut page = Box::new([0; PAGE_BYTES]);
        let p = &mut page[..];
        p[..8].copy_from_slice(&MAGIC);
        put_u16(p, 0x008, 1);
        let minor = match (self.about.is_empty(), &self.history, self.imagery) {
            _ if self.record_kind == RecordKind::Fine => 4,
            (false, ..) => 3,
            (true, Some(_), _) => 2,
            (true, None, imagery) => u16::from(imagery.is_some()),
        };
        put_u16(p, 0x00a, minor);
        put_u32(p, 0x00c, PAGE_BYTES as u32);
        p[0x010] = self.grid.k() as u8;
        p[0x011] = match self.record_kind {
            RecordKind::Compact => 1,
            RecordKind::Fine => 4,
            RecordKind::Exact8 => 2,
            RecordKind::Exact16 => 3,
        };
        p[0x012] = match self.error_kind {
            ErrorKind::Bounded => 1,
            ErrorKind::Step => 2,
        };
        p[0x013] = u8::from(self.has_voids) | u8::from(self.heights_rounded) << 1;
        put_u32(p, 0x014, self.grid.samples()[0]);
        put_u32(p, 0x018, self.grid.samples()[1]);
        put_u32(p, GENERATION, self.generation);
        put_f64(p, 0x020, self.grid.spacing_m()[0]);
        put_f64(p, 0x028, self.grid.spacing_m()[1]);
        put_f64(p, 0x030, self.scale.height_base_m);
        put_f64(p, 0x038, self.scale.height_step_m);
        put_f64(p, 0x040, self.height_range_m[0]);
        put_f64(p, 0x048, self.height_range_m[1]);
        put_f64(p, 0x050, self.scale.error_top_m);
        put_u32(
            p,
            0x058,
            match self.scale.radius_codes {
                RadiusCodes::Octaves(steps) if self.record_kind == RecordKind::Compact => steps,
                RadiusCodes::Excess { first_octave } if self.record_kind == RecordKind::Fine => {
                    first_octave as u32
                }
                _ => 0,
            },
        );
        put_u64(p, 0x060, self.nodata_samples);
        put_u64(p, 0x068, self.record_pages());
        put_u64(p, 0x070, self.stored_pages);
        put_u32(p, 0x078, self.root_page);
        put_u32(p, 0x07c, self.directory().root_entries() as u32);
        put_u32(p, 0x080, self.root_checksum);
        put_u64(p, 0x088, self.file_bytes);
        put_u64(p, 0x090, self.imagery.map_or(0, |place| place.offset));
        put_u64(p, 0x098, self.imagery.map_or(0, |place| place.bytes));
        for (i, m) in self.sample_to_crs.unwrap_or_default().iter().enumerate() {
            put_f64(p, 0x0a0 + 8 * i, *m);
        }
        put_u32(p, 0x0d0, self.epsg.unwrap_or(0));
        p[0x0d4] = match self.crs_unit {
            HorizontalUnit::Unknown => 0,
            HorizontalUnit::Metre => 1,
            HorizontalUnit::Degree => 2,
            HorizontalUnit::Foot => 3,
            HorizontalUnit::UsSurveyFoot => 4,
        };
        let (origin, latitude) = match self.spacing_origin {
            SpacingOrigin::Dem => (1, f64::NAN),
            SpacingOrigin::Degrees { centre_latitude_deg } => (2, centre_latitude_deg),
            SpacingOrigin::User => (3, f64::NAN),
            SpacingOrigin::Assumed => (4, f64::NAN),
        };
        p[0x0d5] = origin;
        put_f64(p, 0x0d8, latitude);
        put_f64(p, 0x0e0, self.body_radius_m.unwrap_or(0.0));
        put_u32(p, 0x0e8, self.history.map_or(0, |history| history.commit_page));
        put_u32(p, 0x0ec, self.history.map_or(0, |history| history.tip_page));
        put_text(p, 0x200, &self.crs_name);
        put_text(p, 0x300, &self.source);
        about::put(p, &self.about);
        seal(&mut page);
        page
    }

    /// The page of an older header with what appends change: version, generation, range of heights, directory, length, imagery, journal. Fields that this version does
    /// not know stay as they are.
    pub(crate) fn amended(&self, older: &Page) -> Box<Page> {
        let mut page = Box::new(*older);
        let ours = self.to_page();
        if get_u16(&page[..], 0x00a) < get_u16(&ours[..], 0x00a) {
            page[0x00a..0x00c].copy_from_slice(&ours[0x00a..0x00c]);
        }
        for range in [GENERATION..0x020, 0x040..0x058, 0x070..0x07c, 0x080..0x084, 0x088..0x0a0, 0x0e8..0x0f0]
        {
            page[range.clone()].copy_from_slice(&ours[range]);
        }
        seal(&mut page);
        page
    }

    /// The current header of the two slots.
    ///
    /// # Errors
    /// [`LayoutError::NotThisFormat`] without the magic, [`LayoutError::Unsupported`] for another version,
    /// [`LayoutError::Damaged`] for anything out of place.
    pub fn current(path: &Path, slot_a: &Page, slot_b: &Page) -> Result<Self, LayoutError> {
        Self::current_as(path, slot_a, slot_b, MAGIC)
    }

    /// As [`Header::current`], of a file that begins with `magic`.
    pub(crate) fn current_as(
        path: &Path,
        slot_a: &Page,
        slot_b: &Page,
        magic: [u8; 8],
    ) -> Result<Self, LayoutError> {
        if slot_a[..8] != magic && slot_b[..8] != magic {
            return Err(LayoutError::not_this_format(
                path,
                "this is not a terrain file (.iqt); make one from elevation data with `terrasoar build`",
            ));
        }
        match (Self::parse_as(path, slot_a, magic), Self::parse_as(path, slot_b, magic)) {
            (Ok(a), Ok(b)) => Ok(if b.generation > a.generation { b } else { a }),
            (Ok(a), Err(_)) => Ok(a),
            (Err(_), Ok(b)) => Ok(b),
            // A slot that was never written says nothing; the other one's problem is the news.
            (Err(a), Err(b)) => Err(if slot_a[..8] == magic { a } else { b }),
        }
    }

    /// Reads and checks one header slot.
    ///
    /// # Errors
    /// As for [`Header::current`].
    pub fn parse(path: &Path, page: &Page) -> Result<Self, LayoutError> {
        Self::parse_as(path, page, MAGIC)
    }

    /// As [`Header::parse`], of a file that begins with `magic`.
    pub(crate) fn parse_as(path: &Path, page: &Page, magic: [u8; 8]) -> Result<Self, LayoutError> {
        let fields = Fields { path, page };
        fields.check_seal(magic)?;
        let header = fields.header()?;
        fields.check_places(&header)?;
        Ok(header)
    }
}

/// Stores the checksum of a page that ends with one.
pub(crate) fn seal(page: &mut Page) {
    let sum = checksum(&page[..0xffc]);
    put_u32(page, 0xffc, sum);
}
