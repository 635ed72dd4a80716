//! `scripts/fuzz import`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("import"), |data: &[u8]| terrasoar_fuzz::import(data));
