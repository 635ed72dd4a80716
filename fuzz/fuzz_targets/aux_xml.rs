//! `scripts/fuzz aux_xml`.
#![no_main]
use libfuzzer_sys::fuzz_target;
fuzz_target!(init: terrasoar_fuzz::prepare("aux_xml"), |data: &[u8]| terrasoar_fuzz::aux_xml(data));
