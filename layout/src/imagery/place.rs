//! Where an image lies on a terrain: from both georeferences, from a stated extent, or over the whole terrain if neither is known.
//!
//! The terrain's metres are multiples of its sample spacing, so the way from an image's texel is: texel, coordinate of the reference system, sample, metre. Tiles
//! are upright and unrotated, so an image that is not is refused.

use super::section::is_place;
use super::source::ImageSource;
use crate::error::LayoutError;
use crate::file::header::Header;
use crate::remedy::Remedy;
use crate::words::number;

/// Largest turn and shear, as a share of a texel over the length of the image.
const STRAIGHT_TEXELS: f64 = 0.25;

/// Where an image is to lie, as a user says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Extent {
    /// West, south, east, north in metres from the terrain's south-west sample.
    Metres([f64; 4]),
    /// West, south, east, north in units of the terrain's reference system.
    Crs([f64; 4]),
}

/// Where the place of an image came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaceOrigin {
    /// Its own georeference.
    Georeference,
    /// The extent that was stated.
    Stated,
    /// Nothing was known: it was laid over the whole terrain.
    Assumed,
}

/// A rectangle of texels on the terrain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Outer corner of the north-west texel, metres east and north.
    pub(super) north_west_m: [f64; 2],
    /// Metres a texel, positive.
    pub(super) texel_m: [f64; 2],
    pub(super) origin: PlaceOrigin,
}

/// The place of one image.
pub(super) fn place(
    image: &dyn ImageSource,
    header: &Header,
    extent: Option<Extent>,
) -> Result<Place, LayoutError> {
    let texels = image.info().texels.map(f64::from);
    let georeference = &image.info().georeference;
    let whole = {
        let [east, north] = header.grid.extent_m();
        [0.0, 0.0, east, north]
    };
    let found = match (extent, georeference.pixel_to_crs, header.sample_to_crs) {
        (Some(Extent::Metres(sides)), ..) => over(sides, texels, PlaceOrigin::Stated),
        (Some(Extent::Crs(sides)), _, Some(map)) => {
            let [west, south, east, north] = sides;
            let from = [west, north, (east - west) / texels[0], (south - north) / texels[1]];
            let corner = [from[0] + 0.5 * from[2], from[2], 0.0, from[1] + 0.5 * from[3], 0.0, from[3]];
            referenced(image, corner, map, header, PlaceOrigin::Stated)?
        }
        (Some(Extent::Crs(_)), _, None) => {
            return Err(LayoutError::Usage(
                "the terrain does not say where it lies, so an extent in its reference system means nothing; state it in \
                 metres from the terrain's south-west sample: west, south, east, north"
                    .into(),
            )
            .mended_by(Remedy::Extent));
        }
        (None, Some(pixels), Some(map)) => {
            if let (Some(ours), Some(theirs)) = (header.epsg, georeference.epsg)
                && ours != theirs
            {
                return Err(LayoutError::unsupported(
                    image.path(),
                    format!(
                        "the image is in EPSG:{theirs} and the terrain in EPSG:{ours}; bring it into the terrain's: \
                         gdalwarp -t_srs EPSG:{ours} INPUT output.tif"
                    ),
                ));
            }
            referenced(image, pixels, map, header, PlaceOrigin::Georeference)?
        }
        (None, ..) => over(whole, texels, PlaceOrigin::Assumed),
    };
    let [west, north] = found.north_west_m;
    let [south, east] = [north - texels[1] * found.texel_m[1], west + texels[0] * found.texel_m[0]];
    if !is_place([west, south], found.texel_m) {
        return Err(LayoutError::Usage(format!(
            "{}: the image would lie at {west}, {south} m with texels of {} x {} m, which is out of range; check the extent",
            image.path().display(),
            number(found.texel_m[0]),
            number(found.texel_m[1]),
            west = number(west),
            south = number(south)
        )));
    }
    if west >= whole[2] || south >= whole[3] || east <= 0.0 || north <= 0.0 {
        return Err(LayoutError::Usage(format!(
            "{}: the image lies from {}, {} to {}, {} m and the terrain from 0, 0 to {}, {}: they do \
             not meet; check the reference systems, or state where the image lies",
            image.path().display(),
            tenths(west),
            tenths(south),
            tenths(east),
            tenths(north),
            tenths(whole[2]),
            tenths(whole[3])
        ))
        .mended_by(Remedy::Extent));
    }
    Ok(found)
}

/// Metres to a tenth.
fn tenths(metres: f64) -> String {
    number((10.0 * metres).round() / 10.0)
}

fn over([west, south, east, north]: [f64; 4], texels: [f64; 2], origin: PlaceOrigin) -> Place {
    Place {
        north_west_m: [west, north],
        texel_m: [(east - west) / texels[0], (north - south) / texels[1]],
        origin,
    }
}

/// Texel centres -> reference system -> samples -> metres.
fn referenced(
    image: &dyn ImageSource,
    pixels: [f64; 6],
    samples: [f64; 6],
    header: &Header,
    origin: PlaceOrigin,
) -> Result<Place, LayoutError> {
    let [dx, dy] = header.grid.spacing_m();
    let determinant = samples[1] * samples[5] - samples[2] * samples[4];
    let refused = |what: &str| {
        LayoutError::unsupported(
            image.path(),
            format!(
                "{what}; turn it north-up into the terrain's reference system with gdalwarp, or state where it lies"
            ),
        )
        .mended_by(Remedy::Extent)
    };
    // Metres of a step in the reference system.
    let step = |x: f64, y: f64| {
        [
            dx * (samples[5] * x - samples[2] * y) / determinant,
            dy * (samples[1] * y - samples[4] * x) / determinant,
        ]
    };
    let column = step(pixels[1], pixels[4]);
    let row = step(pixels[2], pixels[5]);
    let centre = step(pixels[0] - samples[0], pixels[3] - samples[3]);
    if ![column, row, centre].as_flattened().iter().all(|v| v.is_finite()) {
        return Err(refused("its georeference or the terrain's is no map of the plane"));
    }
    let texels = image.info().texels.map(f64::from);
    let astray = (column[1] * texels[0] / row[1]).abs().max((row[0] * texels[1] / column[0]).abs());
    if astray.is_nan() || astray > STRAIGHT_TEXELS {
        return Err(refused("the image is rotated or sheared against the terrain"));
    }
    if column[0] <= 0.0 || row[1] >= 0.0 {
        return Err(refused(
            "the image is mirrored against the terrain: its rows must run from north to south",
        ));
    }
    Ok(Place {
        north_west_m: [centre[0] - 0.5 * column[0], centre[1] - 0.5 * row[1]],
        texel_m: [column[0], -row[1]],
        origin,
    })
}
