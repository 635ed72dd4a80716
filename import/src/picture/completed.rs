//! A picture and what stands beside it: world file, `.prj`, `.aux.xml`, `.msk`; and its own mask.
//!
//! The place is the file's own, else that of the files beside it, as of elevation data ([`crate::beside`]). What a mask or a "no data" value hides becomes transparent. Cost: a mask is
//! read before the first row, into a bit a texel. With a stretch rows are made of the picture's numbers, else of its bytes.

use super::bands::{Chosen, ChosenBytes, ChosenNumbers};
use super::stretched::{Limits, Shades, Stretched};
use crate::beside::Beside;
use crate::crs::{self, System};
use crate::mask::{Bits, Masking};
use crate::reader::{Corrects, Declared, NumberRows, Numbers, Picture, Said};
use crate::shown::PictureOptions;
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
    /// The same of pictures of any numbers.
    voids: Vec<f32>,
    /// Colours that bands were chosen among.
    chosen: Option<Chosen>,
    /// Whether numbers are stretched; and how, once that was found.
    is_stretched: bool,
    shades: Option<Shades>,
}

impl Completed {
    /// Looks beside the picture.
    pub(super) fn new(picture: Box<dyn Picture>, options: &PictureOptions) -> Result<Self, LayoutError> {
        let path = picture.path().to_owned();
        let mut info = picture.info().clone();
        let mut declared = Declared::new(info.texels, SampleType::U8, info.format.clone());
        let (map, crs) = picture.said();
        declared.place = map.map(|map| Said::new(map, "the picture"));
        declared.crs = crs;
        // A world file counts first beside a PNG alone.
        let is_png = info.format.contains(" PNG");
        declared.corrects = Corrects { place: !is_png, system: true, nodata: true, ..Corrects::default() };
        let beside = Beside::of_picture(&path, picture.mask().is_some());
        let masking = beside.complete(&mut declared, &options.open_options())?;
        let mut system =
            crs::resolve(&declared.crs, None, &mut declared.warnings).unwrap_or_else(|_| System::unknown());
        let map = declared.place.as_mut().map(|place| &mut place.value);
        declared.warnings.extend(crs::eastings_first(&mut system, map));
        info.georeference = crs::georeference(&system, declared.place.as_ref().map(|place| place.value));
        info.notes.extend(declared.warnings.into_iter().map(|warning| warning.words));
        info.notes.extend(declared.notes);
        let (mut void, mut voids) = (None, Vec::new());
        let is_stretched = options.stretch.is_some();
        for said in &declared.value.nodata {
            let value = said.value.trim().parse::<f64>().ok();
            if let Some(value) = value.filter(|_| is_stretched) {
                voids.push(value as f32);
                continue;
            }
            if let Some(byte) = value.filter(|_| !is_stretched).and_then(|value| picture.byte_of(value)) {
                void = Some(byte);
                continue;
            }
            let why = match value {
                Some(_) if !picture.has_bytes() => {
                    "counts in a picture of more than 8 bits only where black and white are stated, and was passed over"
                }
                _ => "is no value of this picture's colours and was passed over",
            };
            let value = terrasoar_layout::words::harmless(said.value.trim(), 40);
            info.notes.push(format!("\"no data\" {value} from {} {why}", said.by));
        }
        let masks = masking.as_ref().map_or(0, Masking::memory_bytes);
        info.memory_bytes = info.memory_bytes.saturating_add(masks);
        let chosen = match picture.has_chosen_bands() {
            true => None,
            false => Chosen::new(&path, picture.colours(), &options.bands)?,
        };
        if is_stretched {
            // Rows of numbers, as they come and as they are counted.
            info.memory_bytes = info.memory_bytes.saturating_add(u64::from(info.texels[0]) * 64 + (16 << 20));
        }
        let shades = None;
        Ok(Self { picture, info, system, masking, void, voids, chosen, is_stretched, shades })
    }

    /// Channels of colour that are shown.
    pub(super) fn colours(&self) -> usize {
        self.chosen.as_ref().map_or(self.picture.colours(), Chosen::colours)
    }

    /// As [`Picture::limits`].
    pub(super) fn limits(&self) -> Option<[i32; 2]> {
        self.picture.limits()
    }

    /// Shows its numbers between black and white of `limits`, which were found as `how` says.
    pub(super) fn stretch(&mut self, limits: Limits, how: &str) {
        let shades = Shades::new(limits, self.picture.is_inverse());
        self.info
            .notes
            .push(format!("shown from black to white: {}{how}", shades.words(self.colours() == 1)));
        self.shades = Some(shades);
    }

    /// Its numbers, NaN where a mask or "no data" hides them.
    pub(super) fn numbers(&self) -> Result<Box<dyn NumberRows + '_>, LayoutError> {
        let mask = self.mask()?;
        let wide = self.info.texels[0] as usize;
        let rows: Box<dyn NumberRows> = match self.picture.numbers()? {
            Some(numbers) => numbers,
            None => Box::new(OfBytes { rows: self.picture.rows()?, bytes: Vec::new() }),
        };
        let seen = SeenNumbers { rows, mask, voids: &self.voids, wide, y: 0 };
        Ok(match &self.chosen {
            None => Box::new(seen),
            Some(chosen) => Box::new(ChosenNumbers { rows: Box::new(seen), chosen }),
        })
    }

    /// The mask, read.
    fn mask(&self) -> Result<Option<(&Masking, Bits)>, LayoutError> {
        let Some(masking) = &self.masking else { return Ok(None) };
        Ok(masking.keep(self.picture.mask())?.map(|bits| (masking, bits)))
    }

    /// As [`Picture::has_bytes`].
    pub(super) fn has_bytes(&self) -> bool {
        self.picture.has_bytes()
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
        let wide = self.info.texels[0] as usize;
        if self.is_stretched {
            let unknown = || {
                LayoutError::Usage(format!("{}: black and white are not known yet", self.path().display()))
            };
            let shades = self.shades.ok_or_else(unknown)?;
            return Ok(Box::new(Stretched { rows: self.numbers()?, shades, wide, row: Vec::new() }));
        }
        let mask = self.mask()?;
        let mut rows = self.picture.rows()?;
        if mask.is_some() || self.void.is_some() {
            rows = Box::new(Rows { rows, mask, void: self.void, wide, y: 0 });
        }
        Ok(match &self.chosen {
            None => rows,
            Some(chosen) => Box::new(ChosenBytes { rows, chosen }),
        })
    }
}

/// Bytes as numbers.
struct OfBytes<'p> {
    rows: Box<dyn RowReader + 'p>,
    bytes: Vec<u8>,
}

impl NumberRows for OfBytes<'_> {
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError> {
        self.bytes.resize(4 * texels.len(), 0);
        self.rows.read(&mut self.bytes)?;
        for (to, from) in texels.iter_mut().zip(self.bytes.as_chunks::<4>().0) {
            *to = from.map(f32::from);
        }
        Ok(())
    }
}

/// Numbers without those that are hidden.
struct SeenNumbers<'p> {
    rows: Box<dyn NumberRows + 'p>,
    mask: Option<(&'p Masking, Bits)>,
    voids: &'p [f32],
    wide: usize,
    y: u32,
}

impl NumberRows for SeenNumbers<'_> {
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError> {
        self.rows.read(texels)?;
        for row in texels.chunks_exact_mut(self.wide) {
            for void in self.voids {
                let hidden = row.iter_mut().filter(|texel| texel[..3] == [*void; 3]);
                hidden.for_each(|texel| *texel = [f32::NAN; 4]);
            }
            if let Some((masking, bits)) = &self.mask {
                masking.hide_row(bits, self.y, |at| row[at] = [f32::NAN; 4])?;
            }
            self.y += 1;
        }
        Ok(())
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
