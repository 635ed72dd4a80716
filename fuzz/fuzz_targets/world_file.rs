//! `scripts/fuzz world_file`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("world_file"), |data: &[u8]| terrasoar_fuzz::world_file(data));
