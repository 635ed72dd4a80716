//! `scripts/fuzz openexr`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("openexr"), |data: &[u8]| terrasoar_fuzz::openexr(data));
