//! `scripts/fuzz packed`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("packed"), |data: &[u8]| terrasoar_fuzz::packed(data));
