//! `scripts/fuzz ascii_grid`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("ascii_grid"), |data: &[u8]| terrasoar_fuzz::ascii_grid(data));
