//! `scripts/fuzz pmtiles`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("pmtiles"), |data: &[u8]| terrasoar_fuzz::pmtiles(data));
