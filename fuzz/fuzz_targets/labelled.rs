//! `scripts/fuzz labelled`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("labelled"), |data: &[u8]| terrasoar_fuzz::labelled(data));
