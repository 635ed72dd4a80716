//! Why a chunk of a GeoTIFF does not unpack: it cannot be read, or what was read is wrong.

/// Why a chunk does not unpack.
#[derive(Debug)]
pub(super) enum Failure {
    /// The packed bytes cannot be read.
    Io(std::io::Error),
    /// They are wrong, as the words say.
    Damaged(String),
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

pub(super) fn damaged(words: &str) -> Failure {
    Failure::Damaged(words.to_owned())
}
