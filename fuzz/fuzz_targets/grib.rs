//! `scripts/fuzz grib`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("grib"), |data: &[u8]| terrasoar_fuzz::grib(data));
