//! A world file beside a picture that is sound.

use crate::image::{brings, reads_and_drapes};
use crate::seeds::{self, Inputs};
use crate::words::told;
use terrasoar_import::open_image;

/// The picture.
const PICTURE: &[u8] = include_bytes!("../../import/tests/image_fixtures/rgba.png");

pub(crate) fn seeds() -> Inputs {
    seeds::world_files()
}

pub(crate) fn body(data: &[u8]) {
    let folder = crate::scratch::folder();
    let path = folder.path().join("picture.png");
    seeds::write(&path, PICTURE);
    seeds::write(&folder.path().join("picture.pgw"), data);
    // One that says something else than where the picture lies is refused.
    let Some(image) = told(open_image(&path)) else { return };
    let map = image.info().georeference.pixel_to_crs;
    assert!(map.is_none_or(|map| map.iter().all(|number| number.is_finite())), "{map:?}");
    reads_and_drapes(image, folder.path());
    brings(&path);
}
