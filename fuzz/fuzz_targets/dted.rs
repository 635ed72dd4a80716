//! `scripts/fuzz dted`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("dted"), |data: &[u8]| terrasoar_fuzz::dted(data));
