//! `scripts/fuzz flight`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("flight"), |data: &[u8]| terrasoar_fuzz::flight(data));
