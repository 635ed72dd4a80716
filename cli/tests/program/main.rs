//! The real program in a temporary folder: what it prints, what it leaves, how it ends.

#[cfg(target_os = "linux")]
mod aliases;
#[cfg(target_os = "linux")]
mod bare;
mod build;
mod cache;
mod drape;
mod edit;
mod edit_flights;
mod edit_lines;
mod edit_processes;
mod engines;
mod harmless;
mod height_steps;
mod hostile_imports;
mod iobench;
#[cfg(unix)]
mod killed;
#[cfg(unix)]
mod kills;
mod lost_header;
mod misread;
mod mosaics;
mod outputs;
mod overlays;
mod packed_pages;
mod pictures;
mod places;
mod support;
mod taken_out;
#[path = "../../../layout/tests/import_support/tiff.rs"]
mod tiff;
mod usage;
mod verbs;
mod within;
