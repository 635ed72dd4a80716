//! The one way to the disk: how terrain files are made, grow and are replaced. Nothing that was reported as durable is lost, and no other program's file is harmed.
//!
//! * [`atomic`]: a new file appears under its name only when it is complete, keeps what the name stood for (a link, a mode, an owner), and its name is on the disk too.
//! * `lock`: one writer at a time, by a lock on the file itself, whatever name it is reached by.
//! * `tail`: a file grows behind its end, and one write of a header makes that count. Edits, undo, pictures and overlays all go through it.
//! * `directory_shape`: how many pages a directory has; `directory`: where pages lie, written behind them; `page_table`: where they lie, read on need.
//! * `journal`: what commits led to and what was before them.
//! * `mark`: how far the last commit came, in the file's last bytes.
//! * `slots`: which of a file's two headers counts.
//! * `seen`: edits committed to a terrain after it was decided to replace it are not lost.
//! * `publish`: a terrain file that does not open is not published; `seen`: a terrain that was edited meanwhile is not replaced.
//! * `version`: packed terrain is told from a terrain file.
//! * `packed_end`: where a packed file grows.
//! * `opening`: opening a pipe does not wait.

#[cfg(feature = "files")]
pub mod atomic;
pub mod bytes;
#[cfg(feature = "files")]
pub(crate) mod directory;
pub(crate) mod directory_shape;
#[cfg(feature = "files")]
pub mod disk;
pub mod entries;
pub mod header;
pub(crate) mod journal;
#[cfg(feature = "files")]
pub(crate) mod lock;
pub(crate) mod mark;
#[cfg(feature = "files")]
pub mod opening;
#[cfg(feature = "files")]
pub(crate) mod overlay;
pub(crate) mod packed_end;
pub(crate) mod page_table;
#[cfg(feature = "files")]
mod seen;
pub(crate) mod slots;
pub mod source;
pub(crate) mod structure;
#[cfg(feature = "files")]
pub(crate) mod tail;
pub(crate) mod version;
