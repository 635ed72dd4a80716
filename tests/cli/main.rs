//! The real program in a temporary folder: what it prints, what it leaves, how it ends.

mod build;
mod drape;
mod edit;
mod edit_processes;
mod engines;
mod hostile_imports;
mod iobench;
mod pictures;
mod support;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;
mod usage;
mod verbs;
