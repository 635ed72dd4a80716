//! Where the program's output goes: a file, a folder of files, or a stream.
//!
//! **Nothing is seen before it is complete.** A file goes through [`AtomicFile`](terrasoar_layout::file::atomic::AtomicFile); a folder's files wait in one file without a
//! name until all of them are there. Only streams, such as standard output, pipes and devices, get what is written at once.
#![cfg(feature = "files")]

mod file;
mod folder;

pub use file::{FileSink, is_stream};
pub use folder::FolderSink;
