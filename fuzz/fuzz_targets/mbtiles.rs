//! `scripts/fuzz mbtiles`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("mbtiles"), |data: &[u8]| terrasoar_fuzz::mbtiles(data));
