//! `scripts/fuzz overlay_sealed`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("overlay_sealed"), |data: &[u8]| terrasoar_fuzz::overlay_sealed(data));
