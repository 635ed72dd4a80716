//! `scripts/fuzz netcdf`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("netcdf"), |data: &[u8]| terrasoar_fuzz::netcdf(data));
