//! Several images as one picture: the smallest rectangle of texels around them. Later images in the list lie above earlier ones.
//!
//! Images of a mosaic have one texel size and lie on one grid of texels. Others must be resampled first, for example by gdalwarp. Where no image is, the picture is
//! transparent, and costs nothing. Cost: a copy of the rows.

use super::place::{Extent, Place, PlaceOrigin, place};
use super::rows::{Area, Arrival, Stretch};
use super::shape::{ImageryShape, MAX_TEXELS, TileFormat};
use super::source::{ImageSource, RowReader};
use crate::error::LayoutError;
use crate::file::header::Header;
use crate::remedy::Remedy;
use crate::words::{harmless, number};
use std::ops::Range;

/// How far off the common grid an image may lie, in texels.
const GRID_TEXELS: f64 = 0.1;

/// Longest name of a format.
const MAX_FORMAT_CHARS: usize = 200;

/// Images side by side.
pub(super) struct Mosaic<'i> {
    parts: Vec<Part<'i>>,
    texels: [u32; 2],
    place: Place,
}

struct Part<'i> {
    image: &'i dyn ImageSource,
    /// Texels east and south of the picture's north-west corner.
    at: [u32; 2],
}

impl<'i> Mosaic<'i> {
    pub(super) fn new(
        images: &[&'i dyn ImageSource],
        header: &Header,
        extent: Option<Extent>,
    ) -> Result<Self, LayoutError> {
        let Some(first) = images.first() else {
            return Err(LayoutError::Usage("no image was named; name one".into()).mended_by(Remedy::Image));
        };
        if images.len() > 1 && extent.is_some() {
            return Err(LayoutError::Usage(
                "an extent goes with one image; of several each must say itself where it lies (GeoTIFF)"
                    .into(),
            ));
        }
        let places: Vec<Place> =
            images.iter().map(|image| place(*image, header, extent)).collect::<Result<_, _>>()?;
        let texel_m = places[0].texel_m;
        let mut from = [f64::INFINITY; 2];
        let mut to = [f64::NEG_INFINITY; 2];
        let mut corners = Vec::new();
        for (image, place) in images.iter().zip(&places) {
            let texels = image.info().texels;
            let refused = |what: &str| {
                Err(LayoutError::Usage(format!(
                    "{} {what} {}; images of a mosaic lie on one grid of texels: bring them together with gdalbuildvrt and \
                     gdal_translate, or with gdalwarp -tr",
                    image.path().display(),
                    first.path().display()
                )))
            };
            if images.len() > 1 && place.origin == PlaceOrigin::Assumed {
                return refused("does not say where it lies, unlike what a mosaic needs, as does");
            }
            let size_matters = |i: usize| {
                (place.texel_m[i] - texel_m[i]).abs() * f64::from(texels[i]) > GRID_TEXELS * texel_m[i]
            };
            if size_matters(0) || size_matters(1) {
                return refused("has texels of another size than");
            }
            let east = (place.north_west_m[0] - places[0].north_west_m[0]) / texel_m[0];
            let south = (places[0].north_west_m[1] - place.north_west_m[1]) / texel_m[1];
            let corner = [east.round(), south.round()];
            if (east - corner[0]).abs().max((south - corner[1]).abs()) > GRID_TEXELS {
                return refused("lies between the texels of");
            }
            for i in 0..2 {
                from[i] = from[i].min(corner[i]);
                to[i] = to[i].max(corner[i] + f64::from(texels[i]));
            }
            corners.push(corner);
        }
        let texels = [to[0] - from[0], to[1] - from[1]];
        if texels.iter().any(|side| *side > f64::from(MAX_TEXELS)) {
            return Err(LayoutError::Usage(format!(
                "{}: {} x {} texels are more than {MAX_TEXELS} a side; drape a part, or coarser images",
                first.path().display(),
                number(texels[0]),
                number(texels[1])
            )));
        }
        let parts = images
            .iter()
            .zip(corners)
            .map(|(image, corner)| Part {
                image: *image,
                at: [(corner[0] - from[0]) as u32, (corner[1] - from[1]) as u32],
            })
            .collect();
        let [east, north] = places[0].north_west_m;
        let north_west_m = [east + from[0] * texel_m[0], north - from[1] * texel_m[1]];
        let place = Place { north_west_m, ..places[0] };
        Ok(Self { parts, texels: texels.map(|side| side as u32), place })
    }

    pub(super) fn shape(&self, format: TileFormat) -> ImageryShape {
        let [west, north] = self.place.north_west_m;
        let south = north - f64::from(self.texels[1]) * self.place.texel_m[1];
        ImageryShape::new(format, self.texels, [west, south], self.place.texel_m)
    }

    pub(super) fn place(&self) -> PlaceOrigin {
        self.place.origin
    }

    /// Format in words.
    pub(super) fn format(&self) -> String {
        let format = |part: &Part<'_>| harmless(&part.image.info().format, MAX_FORMAT_CHARS);
        match &self.parts[..] {
            [part] => format(part),
            parts => format!("{} images: {}", parts.len(), format(&parts[0])),
        }
    }

    /// Memory that reading takes.
    pub(super) fn memory_bytes(&self) -> u64 {
        self.parts.iter().fold(0, |sum: u64, part| sum.saturating_add(part.image.info().memory_bytes))
    }

    /// What the images cover.
    pub(super) fn areas(&self) -> Vec<Area> {
        let area = |part: &Part<'_>| {
            let [wide, high] = part.image.info().texels;
            let north = self.texels[1] - part.at[1];
            Area { columns: part.at[0]..part.at[0] + wide, rows: north - high..north }
        };
        self.parts.iter().map(area).collect()
    }

    /// The rows of the picture.
    pub(super) fn rows(&self) -> Result<MosaicRows<'_>, LayoutError> {
        Ok(MosaicRows {
            mosaic: self,
            y: 0,
            readers: self.parts.iter().map(|_| None).collect(),
            rows: Vec::new(),
        })
    }
}

/// Rows of a mosaic, from the north. An image is opened when its first row is due and closed after its last.
pub(super) struct MosaicRows<'m> {
    mosaic: &'m Mosaic<'m>,
    y: u32,
    readers: Vec<Option<Box<dyn RowReader + 'm>>>,
    rows: Vec<u8>,
}

impl MosaicRows<'_> {
    /// Reads the next rows of the picture.
    pub(super) fn read(&mut self, rows: u32, into: &mut Arrival) -> Result<(), LayoutError> {
        let (from, to) = (self.y, self.y + rows);
        self.y = to;
        into.rows = rows;
        let parts = &self.mosaic.parts;
        let meets = |part: &Part<'_>| {
            let [wide, high] = part.image.info().texels;
            let is_met = rows > 0 && part.at[1] < to && from < part.at[1] + high;
            is_met.then_some(part.at[0]..part.at[0] + wide)
        };
        lay_out(parts.iter().filter_map(meets).collect(), into);
        if let [part] = &parts[..] {
            let reader = match &mut self.readers[0] {
                Some(reader) => reader,
                reader => reader.insert(part.image.rows()?),
            };
            return into.stretches.iter_mut().try_for_each(|stretch| reader.read(&mut stretch.rgba));
        }
        for (part, reader) in parts.iter().zip(&mut self.readers) {
            let [part_wide, part_high] = part.image.info().texels;
            let (first, last) = (from.max(part.at[1]), to.min(part.at[1] + part_high));
            if first >= last {
                *reader = None;
                continue;
            }
            let reader = match reader {
                Some(reader) => reader,
                None => reader.insert(part.image.rows()?),
            };
            self.rows.resize((last - first) as usize * part_wide as usize * 4, 0);
            reader.read(&mut self.rows)?;
            // The stretch that holds the part's columns.
            let at = into.stretches.partition_point(|stretch| stretch.columns.end <= part.at[0]);
            let Stretch { columns, rgba } = &mut into.stretches[at];
            let wide = columns.len();
            let (picture, _) = rgba.as_chunks_mut::<4>();
            let (texels, _) = self.rows.as_chunks::<4>();
            for (y, row) in (first..last).zip(texels.chunks_exact(part_wide as usize)) {
                let at = (y - from) as usize * wide + (part.at[0] - columns.start) as usize;
                for (below, above) in picture[at..].iter_mut().zip(row) {
                    if above[3] > 0 {
                        *below = *above;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Makes transparent stretches of the columns, those that overlap or meet as one.
fn lay_out(mut columns: Vec<Range<u32>>, into: &mut Arrival) {
    columns.sort_by_key(|columns| columns.start);
    columns.dedup_by(|next, last| {
        let is_met = next.start <= last.end;
        last.end = if is_met { last.end.max(next.end) } else { last.end };
        is_met
    });
    into.stretches.resize_with(columns.len(), Stretch::default);
    for (stretch, columns) in into.stretches.iter_mut().zip(columns) {
        let bytes = columns.len() * into.rows as usize * 4;
        stretch.columns = columns;
        stretch.rgba.clear();
        stretch.rgba.resize(bytes, 0);
    }
}
