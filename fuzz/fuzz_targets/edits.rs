//! `scripts/fuzz edits`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("edits"), |data: &[u8]| terrasoar_fuzz::edits(data));
