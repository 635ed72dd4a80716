//! `scripts/fuzz packed_png`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("packed_png"), |data: &[u8]| terrasoar_fuzz::packed_png(data));
