//! Pictures as JPEG 2000, of any bits, in a JP2 file or bare: a row of tiles at a time, its tiles in parallel.
//!
//! Which channels are colours is said by the file; without a word of it one is grey and three are red, green and blue, of which others are left out. Of more than 8 bits the upper 8
//! of those in use are shown, which costs a pass more, or what a person states. Memory: a row of tiles as texels, and the work on as many tiles as there are threads.

use crate::jpeg2000::{self, Channel, Colours, Jp2, Source, Trouble, limits};
use crate::reader::{CrsSaid, NumberRows, Numbers, Picture, bits_of, upper_eight};
use crate::shown::{PRESS_NOTE, PictureOptions, chosen_bands};
use crate::{geotiff, guard, input};
use rayon::prelude::*;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};
use terrasoar_layout::remedy::Remedy;

/// A JPEG 2000 picture.
#[derive(Debug)]
pub(super) struct Jp2Image {
    path: PathBuf,
    info: ImageInfo,
    jp2: Jp2,
    map: Option<[f64; 6]>,
    crs: CrsSaid,
    /// Channels, as they stand in the file: alpha, and those that are shown: one, three, or four of CMYK.
    alpha: Option<usize>,
    shown: Vec<usize>,
    is_cmyk: bool,
    has_bytes: bool,
    /// Bits in use of more than 8, once they were looked for or said.
    bits: OnceLock<u32>,
}

impl Jp2Image {
    /// Reads the headers, and where the tiles are.
    pub(super) fn open(path: &Path, options: &PictureOptions) -> Result<Self, LayoutError> {
        let file = input::open(path, "cannot open the JPEG 2000 file")?;
        let length = file.metadata().map_err(|e| refused(path, "header", Trouble::Io(e)))?.len();
        let jp2 = Jp2::read(Source::File(&file), length).map_err(|t| refused(path, "header", t))?;
        let (map, crs, note) = said(path, &jp2)?;
        let (stream, header) = (&jp2.stream, &jp2.header);
        let (channels, bits) = (jp2.channels(), stream.bits());
        // A picture of nothing but alpha is one of grey.
        let alpha = header.alpha.filter(|_| channels > 1);
        let colours = channels - usize::from(alpha.is_some());
        let mut notes: Vec<String> = note.into_iter().collect();
        let mut is_cmyk = header.colours == Colours::Cmyk && colours >= 4;
        let mut shown = chosen_bands(path, channels as u64, &options.bands)?;
        if shown.is_empty() {
            let count = match colours {
                _ if is_cmyk => 4,
                3.. if header.colours != Colours::Grey => 3,
                _ => 1,
            };
            shown = header.in_order(channels).filter(|channel| Some(*channel) != alpha).take(count).collect();
            if colours > count {
                let left = colours - count;
                notes.push(format!(
                    "{left} of its {channels} bands are neither colour nor alpha and are left out"
                ));
            }
        } else {
            is_cmyk = false;
        }
        if is_cmyk {
            notes.push(PRESS_NOTE.into());
        }
        let has_bytes = header.palette.is_some() || (bits <= 8 && !stream.is_signed());
        if options.stretch.is_none() && !has_bytes {
            if stream.is_signed() || bits > 16 {
                return Err(LayoutError::unsupported(
                    path,
                    format!(
                        "its samples are {} numbers of {bits} bits, of which nothing says what is black and what is white; state that, in percent or in values",
                        if stream.is_signed() { "signed" } else { "whole" }
                    ),
                )
                .mended_by(Remedy::Stretch));
            }
            notes.push(format!("{bits} bits a channel are cut to the upper 8 of those in use"));
        }
        let [wide, _] = stream.texels();
        let high = stream.largest_tile() / u64::from(stream.tile_size(0)[0]).max(1);
        // Bits in use are looked for among numbers.
        let is_numbers = options.stretch.is_some() || !has_bytes;
        let texel_bytes = if is_numbers { size_of::<Numbers>() as u64 } else { 4 };
        let threads = rayon::current_num_threads().min(stream.tiles()[0] as usize) as u64;
        let info = ImageInfo {
            texels: stream.texels(),
            georeference: Georeference::default(),
            format: format!(
                "{bits}-bit JPEG 2000 of {channels} channels, {} tiles",
                u64::from(stream.tiles()[0]) * u64::from(stream.tiles()[1])
            ),
            notes,
            memory_bytes: (u64::from(wide) * texel_bytes)
                .saturating_mul(high)
                .saturating_add(jp2.tile_bytes().saturating_mul(threads)),
        };
        Ok(Self {
            path: path.to_owned(),
            info,
            jp2,
            map,
            crs,
            alpha,
            shown,
            is_cmyk,
            has_bytes,
            bits: OnceLock::new(),
        })
    }

    fn begin<T: Texel>(&self, bits: u32) -> Result<Rows<'_, T>, LayoutError> {
        let file = input::open(&self.path, "cannot open the JPEG 2000 file")?;
        Ok(Rows { image: self, file, y: 0, tiles: Vec::new(), first: 0, bits })
    }

    /// The texels of a tile.
    fn tile<T: Texel>(&self, file: &File, tile: u32, bits: u32) -> Result<Vec<T>, LayoutError> {
        let place = || format!("tile {tile}");
        let stream = &self.jp2.stream;
        let channels = guard(&self.path, place, || {
            jpeg2000::decode_tile(Source::File(file), stream, tile, &self.jp2.header)
                .map_err(|trouble| refused(&self.path, &place(), trouble))
        })?;
        let missing = || {
            LayoutError::damaged(
                &self.path,
                place(),
                "it has fewer channels than its header says; fetch the file again",
            )
        };
        let mut shown = Vec::new();
        for channel in &self.shown {
            shown.push(channels.get(*channel).ok_or_else(missing)?);
        }
        let alpha = self.alpha.map(|channel| channels.get(channel).ok_or_else(missing)).transpose()?;
        let size = stream.tile_size(tile);
        let count = size[0] as usize * size[1] as usize;
        Ok((0..count).map(|at| T::of(self.numbers_at(&shown, alpha, at), bits)).collect())
    }

    fn numbers_at(&self, shown: &[&Channel], alpha: Option<&Channel>, at: usize) -> Numbers {
        let number = |i: usize| {
            let (samples, bits) = shown[i.min(shown.len() - 1)];
            if self.has_bytes { as_byte(samples[at], *bits) } else { samples[at] }
        };
        let full = |(_, bits): &Channel| limits(*bits, false)[1];
        let alpha = alpha.map_or(255.0, |alpha| alpha.0[at] / full(alpha) * 255.0);
        if self.is_cmyk {
            // Inks, of which 0 is none.
            let light = |i: usize| 1.0 - shown[i].0[at] / full(shown[i]);
            let whole = full(shown[0]).max(255.0);
            let [r, g, b] = [0, 1, 2].map(|i| (light(i) * light(3) * whole + 1e-3).floor());
            return [r, g, b, alpha];
        }
        [number(0), number(1), number(2), alpha]
    }
}

/// A number of so many bits, of less than 8 as a share of 255.
fn as_byte(number: f32, bits: u8) -> f32 {
    let whole = if bits < 8 { 255.0 / limits(bits, false)[1] } else { 1.0 };
    (number * whole).round()
}

/// What numbers become.
trait Texel: Copy + Default + Send + Sync {
    fn of(numbers: Numbers, bits: u32) -> Self;
}

impl Texel for Numbers {
    fn of(numbers: Numbers, _: u32) -> Self {
        numbers
    }
}

impl Texel for [u8; 4] {
    fn of(numbers: Numbers, bits: u32) -> Self {
        let [r, g, b, alpha] = numbers;
        let [r, g, b] = [r, g, b].map(|number| upper_eight(number as u16, bits));
        [r, g, b, alpha.round() as u8]
    }
}

impl Picture for Jp2Image {
    fn said(&self) -> (Option<[f64; 6]>, CrsSaid) {
        (self.map, self.crs.clone())
    }

    fn has_bytes(&self) -> bool {
        self.has_bytes
    }

    fn byte_of(&self, number: f64) -> Option<u8> {
        let bits = self.jp2.stream.bits();
        let is_one = number.fract() == 0.0 && (0.0..=f64::from(limits(bits, false)[1])).contains(&number);
        // Of a palette it is a place, and of inks no light.
        let is_light = self.jp2.header.palette.is_none() && !self.is_cmyk;
        (is_one && self.has_bytes && is_light).then(|| as_byte(number as f32, bits) as u8)
    }

    fn bits(&self) -> Result<u32, LayoutError> {
        if self.has_bytes {
            return Ok(8);
        }
        if let Some(bits) = self.bits.get() {
            return Ok(*bits);
        }
        let [wide, high] = self.info.texels;
        let mut rows = self.begin::<Numbers>(16)?;
        let mut row = vec![[0.0; 4]; wide as usize];
        let mut peak = 0.0f32;
        for _ in 0..high {
            rows.fill(&mut row)?;
            // What nobody sees does not count.
            let seen = row.iter().filter(|texel| texel[3] > 0.0);
            peak = seen.fold(peak, |peak, [r, g, b, _]| peak.max(*r).max(*g).max(*b));
        }
        Ok(*self.bits.get_or_init(|| bits_of(peak as u16)))
    }

    fn use_bits(&mut self, bits: u32) {
        self.bits = OnceLock::from(bits);
    }

    fn colours(&self) -> usize {
        if self.shown.len() == 1 { 1 } else { 3 }
    }

    fn has_chosen_bands(&self) -> bool {
        true
    }

    fn numbers(&self) -> Result<Option<Box<dyn NumberRows + '_>>, LayoutError> {
        Ok(Some(Box::new(self.begin::<Numbers>(16)?)))
    }

    fn limits(&self) -> Option<[i32; 2]> {
        let stream = &self.jp2.stream;
        let bits = if self.has_bytes { 8 } else { stream.bits() };
        let is_signed = stream.has_sign(self.shown[0]);
        // Signed channels beside others, which no picture has, are counted as any numbers are.
        let is_alike = self.shown.iter().all(|channel| stream.has_sign(*channel) == is_signed);
        (bits <= 16 && is_alike).then(|| limits(bits, is_signed).map(|number| number as i32))
    }
}

impl ImageSource for Jp2Image {
    fn path(&self) -> &Path {
        &self.path
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        Ok(Box::new(self.begin::<[u8; 4]>(self.bits()?)?))
    }
}

/// Rows as they are asked for, from the row of tiles at hand.
struct Rows<'i, T> {
    image: &'i Jp2Image,
    file: File,
    y: u32,
    tiles: Vec<Vec<T>>,
    /// The first tile at hand.
    first: u32,
    bits: u32,
}

impl<T: Texel> Rows<'_, T> {
    fn fill(&mut self, texels: &mut [T]) -> Result<(), LayoutError> {
        let stream = &self.image.jp2.stream;
        let [across, down] = stream.tiles();
        for row in texels.chunks_exact_mut(stream.texels()[0] as usize) {
            let ends = |tile: u32| stream.tile_at(tile)[1] + stream.tile_size(tile)[1];
            if self.tiles.is_empty() || self.y >= ends(self.first) {
                let first = if self.tiles.is_empty() { 0 } else { self.first + across };
                // The readers of rows ask for no more than there are.
                self.first = first.min(across * (down - 1));
                self.tiles.clear();
                let (image, file, bits) = (self.image, &self.file, self.bits);
                let tiles = (self.first..self.first + across).into_par_iter();
                self.tiles = tiles.map(|tile| image.tile(file, tile, bits)).collect::<Result<_, _>>()?;
            }
            let line = (self.y - stream.tile_at(self.first)[1]) as usize;
            for (number, tile) in (self.first..).zip(&self.tiles) {
                let (at, wide) = (stream.tile_at(number)[0] as usize, stream.tile_size(number)[0] as usize);
                row[at..at + wide].copy_from_slice(&tile[line * wide..(line + 1) * wide]);
            }
            self.y += 1;
        }
        Ok(())
    }
}

impl RowReader for Rows<'_, [u8; 4]> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        self.fill(rgba.as_chunks_mut::<4>().0)
    }
}

impl NumberRows for Rows<'_, Numbers> {
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError> {
        self.fill(texels)
    }
}

/// What a box says of the ground: the map from texel centres, and the system.
type Place = (Option<[f64; 6]>, CrsSaid);
/// The same of all boxes, and what was not understood, in words.
type Told = (Option<[f64; 6]>, CrsSaid, Option<String>);

/// What the boxes say. The GeoTIFF counts before GML.
fn said(path: &Path, jp2: &Jp2) -> Result<Told, LayoutError> {
    let tiff = jp2.ground.tiff().map(|tiff| geotiff::place_of(path, tiff));
    together(tiff, jp2.ground.gml())
}

fn together(
    tiff: Option<Result<Place, LayoutError>>,
    gml: Option<Result<([f64; 6], CrsSaid), ()>>,
) -> Result<Told, LayoutError> {
    let (mut crs, mut note) = (CrsSaid::default(), None);
    match tiff {
        Some(Ok((Some(map), crs))) => return Ok((Some(map), crs, None)),
        // A file beside it may say the place.
        Some(Ok((None, said))) => crs = said,
        // What went wrong on this machine is no fault of the file's.
        Some(Err(error @ LayoutError::Io { .. })) => return Err(error),
        Some(Err(_)) => {
            note = Some("its box of a GeoTIFF (GeoJP2) is damaged and was passed over".to_owned());
        }
        None => {}
    }
    Ok(match gml {
        Some(Ok((map, crs))) => (Some(map), crs, note),
        Some(Err(())) => {
            let words = "what it says of its place in GML (GMLJP2) is not understood and was passed over";
            (None, crs, Some(words.to_owned()))
        }
        None => (None, crs, note),
    })
}

fn refused(path: &Path, place: &str, trouble: Trouble) -> LayoutError {
    match trouble {
        Trouble::Io(source) => LayoutError::io(path, "cannot read the JPEG 2000 file", source),
        Trouble::Damaged(problem) => {
            LayoutError::damaged(path, place, format!("{problem}; fetch or write the file again"))
        }
        Trouble::Unsupported(problem) => LayoutError::unsupported(
            path,
            format!(
                "{problem}, which is not read; convert it: gdal_translate -co TILED=YES -co COMPRESS=DEFLATE INPUT output.tif"
            ),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reader::Said;

    fn crs(code: u32) -> CrsSaid {
        CrsSaid { code: Some(Said::new(code, "a test")), ..CrsSaid::default() }
    }

    #[test]
    fn a_box_that_cannot_be_read_here_is_not_called_damaged() {
        let map = [1.0, 2.0, 0.0, 3.0, 0.0, -2.0];
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let error = LayoutError::io(Path::new("a.jp2"), "cannot keep a part of the file", full);
        let refused = together(Some(Err(error)), Some(Ok((map, crs(4326))))).unwrap_err();
        assert!(matches!(refused, LayoutError::Io { .. }), "{refused}");
        let broken = || LayoutError::damaged(Path::new("a.jp2"), "header", "it is cut short");
        let (found, said, note) = together(Some(Err(broken())), Some(Ok((map, crs(4326))))).unwrap();
        assert!(
            found == Some(map) && said.code.is_some() && note.is_some_and(|note| note.contains("GeoJP2"))
        );
    }

    #[test]
    fn a_system_without_a_place_counts_where_gml_says_no_other() {
        let code = |(map, crs, _): Told| (map.is_some(), crs.code.map(|code| code.value));
        let tiff = || Some(Ok((None, crs(32_632))));
        assert_eq!(code(together(tiff(), None).unwrap()), (false, Some(32_632)));
        assert_eq!(code(together(tiff(), Some(Err(()))).unwrap()), (false, Some(32_632)));
        assert_eq!(code(together(tiff(), Some(Ok(([1.0; 6], crs(4326))))).unwrap()), (true, Some(4326)));
    }
}
