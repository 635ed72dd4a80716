//! `scripts/fuzz map_tile`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("map_tile"), |data: &[u8]| terrasoar_fuzz::map_tile(data));
