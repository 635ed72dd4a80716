//! `scripts/fuzz usgs_dem`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("usgs_dem"), |data: &[u8]| terrasoar_fuzz::usgs_dem(data));
