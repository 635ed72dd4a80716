//! Terrain files whose checksums match and whose contents are anything.
//!
//! The input is a whole file, sealed before it is used, or the number of a sound one and a recipe of mutations (see `terrasoar_layout::testing`).

use crate::land::TERRAINS;
use crate::seeds::{self, Inputs};
use crate::use_files::uses;
use terrasoar_layout::file::header::MAGIC;
use terrasoar_layout::testing::{Counts, Sealed, reseal};

pub(crate) fn seeds() -> Inputs {
    let mut inputs = seeds::recipes(&TERRAINS);
    inputs.push(("whole".into(), TERRAINS[0].files.terrain.clone()));
    inputs
}

pub(crate) fn body(data: &[u8]) {
    if data.starts_with(&MAGIC) {
        let mut terrain = data.to_vec();
        reseal(&mut terrain, Counts::Keep);
        return uses(&Sealed { terrain, overlay: None });
    }
    let Some((number, recipe)) = data.split_first() else { return };
    let mut files = TERRAINS[usize::from(*number) % TERRAINS.len()].files.clone();
    files.mutate(recipe);
    uses(&files);
}
