//! `scripts/fuzz surfer`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("surfer"), |data: &[u8]| terrasoar_fuzz::surfer(data));
