//! `scripts/fuzz terrain_sealed`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("terrain_sealed"), |data: &[u8]| terrasoar_fuzz::terrain_sealed(data));
