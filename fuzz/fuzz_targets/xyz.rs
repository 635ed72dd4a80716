//! `scripts/fuzz xyz`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("xyz"), |data: &[u8]| terrasoar_fuzz::xyz(data));
