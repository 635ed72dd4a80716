//! `scripts/fuzz tiles`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("tiles"), |data: &[u8]| terrasoar_fuzz::tiles(data));
