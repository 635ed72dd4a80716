//! `scripts/fuzz reference_system`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("reference_system"), |data: &[u8]| terrasoar_fuzz::reference_system(data));
