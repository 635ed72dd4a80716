//! `scripts/fuzz image`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("image"), |data: &[u8]| terrasoar_fuzz::image(data));
