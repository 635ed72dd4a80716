//! `scripts/fuzz netpbm`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("netpbm"), |data: &[u8]| terrasoar_fuzz::netpbm(data));
