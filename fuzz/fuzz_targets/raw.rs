//! `scripts/fuzz raw`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("raw"), |data: &[u8]| terrasoar_fuzz::raw(data));
