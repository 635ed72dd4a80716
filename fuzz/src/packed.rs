//! Packed files whose checksums match and whose contents are anything.
//!
//! The input is a whole packed file, sealed before it is used, or the number of a sound one and a recipe of changes (see `terrasoar_layout::testing::mutate_packed`).

use crate::land::PACKED;
use crate::seeds::Inputs;
use crate::use_files::uses;
use terrasoar_layout::file::header::MAGIC;
use terrasoar_layout::testing::{Sealed, mutate_packed, reseal_packed};

pub(crate) fn seeds() -> Inputs {
    let mut inputs = Inputs::new();
    for (number, seed) in (0u8..).zip(PACKED.iter()) {
        inputs.push((seed.name.into(), vec![number]));
        for part in 0..24u8 {
            let change = [part, 0, part.wrapping_mul(37), part, 0, 0, part, 1 + part];
            inputs.push((format!("{}, part {part}", seed.name), [&[number][..], &change].concat()));
        }
    }
    inputs.push(("whole".into(), PACKED[0].files.terrain.clone()));
    inputs
}

pub(crate) fn body(data: &[u8]) {
    let terrain = if data.starts_with(&MAGIC) {
        let mut terrain = data.to_vec();
        reseal_packed(&mut terrain);
        terrain
    } else {
        let Some((number, recipe)) = data.split_first() else { return };
        let mut terrain = PACKED[usize::from(*number) % PACKED.len()].files.terrain.clone();
        mutate_packed(&mut terrain, recipe);
        terrain
    };
    uses(&Sealed { terrain, overlay: None });
}
