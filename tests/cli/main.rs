//! The real program in a temporary folder: what it prints, what it leaves, how it ends.

mod build;
mod drape;
mod edit;
mod edit_processes;
mod engines;
mod harmless;
mod iobench;
mod pictures;
mod support;
mod usage;
mod verbs;
