//! `scripts/fuzz vrt`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("vrt"), |data: &[u8]| terrasoar_fuzz::vrt(data));
