//! What can go wrong, in words for the user.

use std::path::PathBuf;

/// A failure of an image operation. Every message names the file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The file is absent, unreadable, or in a format that OpenImageIO does not know.
    #[error("cannot open the image \"{}\": {reason}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// OpenImageIO's message.
        reason: String,
    },
    /// The file was opened, but its pixels cannot be read: it is truncated or damaged.
    #[error("cannot read the pixels of \"{}\": {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// OpenImageIO's message.
        reason: String,
    },
    /// The file could not be written.
    #[error("cannot write the image \"{}\": {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// OpenImageIO's message.
        reason: String,
    },
    /// The library itself refused.
    #[error("OpenImageIO: {0}")]
    Library(String),
}
