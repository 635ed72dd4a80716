//! Overlays whose checksums match and whose contents are anything, over a sound terrain.
//!
//! The input is a whole overlay, sealed before it is used, or a byte and a recipe of mutations (see `terrasoar_layout::testing`).

use crate::land::OVERLAYS;
use crate::seeds::{self, Inputs};
use crate::use_files::uses;
use terrasoar_layout::testing::{Counts, reseal_overlay};

pub(crate) fn seeds() -> Inputs {
    let mut inputs = seeds::recipes(&OVERLAYS);
    inputs.extend(OVERLAYS[0].files.overlay.clone().map(|whole| ("whole".into(), whole)));
    inputs
}

pub(crate) fn body(data: &[u8]) {
    let Some((number, recipe)) = data.split_first() else { return };
    if data.starts_with(b"\x89IQO") {
        let mut files = OVERLAYS[0].files.clone();
        let mut overlay = data.to_vec();
        reseal_overlay(&files.terrain, &mut overlay, Counts::Keep);
        files.overlay = Some(overlay);
        return uses(&files);
    }
    let mut files = OVERLAYS[usize::from(*number) % OVERLAYS.len()].files.clone();
    files.mutate(recipe);
    uses(&files);
}
