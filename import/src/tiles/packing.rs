//! How heights are packed into the colours of a pyramid: as a person says, as it states, or as the colours themselves leave no doubt.
//!
//! Cost: where nobody says, some tiles are decoded.

use super::decode::{Stored, Texels};
use super::{Pyramid, Tile, decode};
use crate::png::{Evidence, Packing};
use crate::value::{Decode, decode as named};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// A packing and how it was found.
pub(super) struct Found {
    pub(super) packing: Decode,
    /// What the colours were taken for, where nobody said; each is held against it.
    pub(super) guessed: Option<Packing>,
    /// Where it came from, in words.
    pub(super) by: String,
    pub(super) warning: Option<Warning>,
}

/// Finds out how heights are packed.
///
/// # Errors
/// [`LayoutError::Unsupported`] where nobody says and the colours leave a doubt, or where they are not kept exactly.
pub(super) fn find(pyramid: &Pyramid, typed: Option<&str>) -> Result<Found, LayoutError> {
    let first = pyramid.plan.samples.first();
    let mut bytes = Vec::new();
    if let Some(tile) = first
        && let Some(texels) = pyramid.tile(*tile, &mut bytes)?
    {
        check(pyramid, *tile, &texels)?;
    }
    if let Some(typed) = typed {
        return Ok(Found { packing: named(typed)?, guessed: None, by: "as typed".into(), warning: None });
    }
    if let Some(said) = &pyramid.archive.about().encoding {
        let packing = Decode::parse(&said.value).ok_or_else(|| {
            let problem = format!(
                "{} states that heights are packed as \"{}\", which is not known; state how: mapbox, terrarium or factors",
                said.by, said.value
            );
            LayoutError::unsupported(pyramid.path(), problem).mended_by(Remedy::Decode)
        })?;
        return Ok(Found {
            packing,
            guessed: None,
            by: format!("{} from {}", said.value, said.by),
            warning: None,
        });
    }
    guess(pyramid)
}

/// Refuses a tile whose colours are not those that were packed.
pub(super) fn check(pyramid: &Pyramid, tile: Tile, texels: &Texels) -> Result<(), LayoutError> {
    let refused = |problem: String| {
        let label = pyramid.archive.label(tile);
        Err(LayoutError::unsupported(pyramid.path(), format!("{label} {problem}")))
    };
    match texels.stored {
        Stored::About(how) => refused(format!(
            "is {how}, which changes colours a little; heights packed into them would be wrong by metres to thousands of metres; use tiles of PNG or lossless WebP, or lay these over a terrain as a picture"
        )),
        Stored::Exactly { bits: 16 } => refused(
            "has 16 bits a channel, and heights are packed into channels of 8; make the tiles again".into(),
        ),
        Stored::Exactly { .. } => Ok(()),
    }
}

fn guess(pyramid: &Pyramid) -> Result<Found, LayoutError> {
    let mut evidence = [Packing::Mapbox, Packing::Terrarium].map(Evidence::new);
    let mut bytes = Vec::new();
    let mut looked_at = 0;
    for tile in &pyramid.plan.samples {
        if !pyramid.archive.fetch(*tile, decode::most_bytes(pyramid.plan.side), &mut bytes)? {
            continue;
        }
        let texels = decode::decode(pyramid.path(), || pyramid.archive.label(*tile), &bytes)?;
        looked_at += 1;
        for row in texels.rgba.chunks_exact(texels.side as usize) {
            let mut before = None;
            for [red, green, blue, alpha] in row {
                let pixel = (*alpha != 0).then_some([*red, *green, *blue]);
                if let Some(pixel) = pixel {
                    evidence.iter_mut().for_each(|evidence| evidence.add(before, pixel));
                }
                before = pixel;
            }
        }
    }
    let Some(found) = evidence.iter().find(|evidence| evidence.is_certain()).map(Evidence::packing) else {
        return Err(LayoutError::unsupported(
            pyramid.path(),
            "nothing says how heights are packed into the colours of these tiles, and the colours leave a doubt; state it (mapbox, terrarium or factors) if they are heights; if they are a picture, lay it over a terrain with drape",
        )
        .mended_by(Remedy::Decode));
    };
    let other = if found == Packing::Mapbox { Packing::Terrarium } else { Packing::Mapbox };
    let tiles = if looked_at == 1 { "a tile".to_owned() } else { format!("{looked_at} tiles") };
    let warning = Warning::new(format!(
        "nothing says how heights are packed into the colours; the colours of {tiles} can only be {}'s, so that was taken; state it if it is another",
        found.name()
    ));
    Ok(Found {
        packing: found.decode(),
        guessed: Some(found),
        by: format!("{} by the colours themselves", found.name()),
        warning: Some(warning.mended_by(Remedy::Decode, other.name())),
    })
}
