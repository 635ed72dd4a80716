//! Which of an image's bands holds the heights: the only one, the one that was asked for, or three that heights are packed into.
//!
//! A second band that the file calls alpha makes voids and does not count as a band of heights. Between other bands nothing is guessed.

use super::chunks::Chunks;
use super::convert::Pick;
use super::tags::{self, Directory, TiffFile};
use crate::options::OpenOptions;
use crate::value::{self, Decode};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// What is read of each pixel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bands {
    pub(super) pick: Pick,
    /// Band of alpha, counted from 0.
    pub(super) alpha: Option<usize>,
    /// Band whose metadata count.
    pub(super) described: usize,
}

/// The meaning of the bands of the image `directory`; `names` are those that its metadata give them.
pub(super) fn of(
    file: &mut TiffFile,
    directory: &Directory,
    chunks: &Chunks,
    names: &[Option<String>],
    options: &OpenOptions,
) -> Result<Bands, LayoutError> {
    let bands = chunks.bands as usize;
    let photometric = file.number(directory, tags::PHOTOMETRIC)?.unwrap_or(1);
    let colours = match photometric {
        2 | 6 => 3.min(bands),
        _ => 1,
    };
    let extra = file.numbers(directory, tags::EXTRA_SAMPLES, chunks.bands)?.unwrap_or_default();
    let alpha = extra.iter().position(|kind| matches!(kind, 1 | 2)).map(|at| colours + at);
    let alpha = alpha.filter(|band| *band < bands);
    let path = file.path().to_owned();
    if let Some(text) = &options.decode {
        if bands < 3 {
            return Err(LayoutError::Usage(format!(
                "{}: heights are unpacked from three bands, and this file has {bands}; read it as it is",
                path.display()
            )));
        }
        return Ok(Bands { pick: Pick::Decode(value::decode(text)?), alpha, described: 0 });
    }
    if let Some(word) = &options.band {
        let names: Vec<&str> = names.iter().map(|name| name.as_deref().unwrap_or("")).collect();
        let band = value::band(&path, word, bands, &names)?;
        return Ok(Bands {
            pick: Pick::Band(band),
            alpha: alpha.filter(|alpha| *alpha != band),
            described: band,
        });
    }
    if bands == 1 && photometric == 3 {
        return Err(LayoutError::unsupported(
            &path,
            "this is a palette picture, and heights are numbers of a band; look for the elevation data it was made from",
        ));
    }
    let choices: Vec<usize> = (0..bands).filter(|band| Some(*band) != alpha).collect();
    if let [band] = choices[..] {
        return Ok(Bands { pick: Pick::Band(band), alpha, described: band });
    }
    let is_picture = choices.len() == 3 && chunks.sample_type == SampleType::U8;
    Err(if is_picture {
        LayoutError::unsupported(
            &path,
            "this is a colour picture of three bands of 8 bits; if heights are packed into its colours, say how: mapbox (Terrain-RGB), terrarium, or four \
             factors; if one band holds them, name it; if it is a picture of the ground, look for the elevation data it was made from",
        )
        .mended_by(Remedy::Decode)
    } else {
        LayoutError::unsupported(
            &path,
            format!(
                "this is an image of {} bands{}; say which one holds the heights",
                choices.len(),
                listed(names)
            ),
        )
        .mended_by(Remedy::Band)
    })
}

/// The names of bands, as far as there are some, for a message.
fn listed(names: &[Option<String>]) -> String {
    let known: Vec<String> = (1..)
        .zip(names)
        .filter_map(|(number, name)| name.as_ref().map(|name| format!("{number} \"{name}\"")))
        .take(12)
        .collect();
    if known.is_empty() { String::new() } else { format!(" ({})", known.join(", ")) }
}

/// The packing's own type: heights of decimetres and the like.
pub(super) fn sample_type(pick: &Pick, stored: SampleType) -> SampleType {
    match pick {
        Pick::Band(_) => stored,
        Pick::Decode(_) => Decode::SAMPLE_TYPE,
    }
}
