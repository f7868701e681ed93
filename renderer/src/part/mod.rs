//! Parts: frames in the making as files, to be added to others or gone on with. `docs/parts.md` has the format in full.
//!
//! | what | |
//! |---|---|
//! | 8 bytes | `TSRpart` and the version of this format |
//! | a section | header: JSON, UTF-8 |
//! | for each row of tiles: a section | bytes of each of its runs |
//! | its runs: for each tree of the filter a section a tile | cells, and which pixels read them (`FrameFilter::store_trees`) |
//! | the last run: a section a tile | the sums of the tile's pixels (`Film::store`), then those that the filter keeps of them |
//! | a section | the number of those that follow |
//! | sections | what the filter shares within an epoch that is not over |
//!
//! Sections but the header are words: see [`section`]. Everything that is added is an integer, so any order of additions
//! gives the same bits, and what is written depends on neither the machine nor the number of threads, but for the order in
//! which an epoch that is not over has its cells.
//!
//! Who writes a part goes through its sums once, tile by tile, so that they are in the cache while all that is to be known of
//! them is written. Who merges parts goes through them once for each tree, for only one tree's cells are in memory at a time:
//! from run to run, which are long enough to be read quickly.

mod header;
mod merge;
mod read;
mod section;
mod write;

use std::io;
use std::ops::Range;
use std::path::PathBuf;

use crate::film::TILE;
use crate::filtering::Filtering;
use crate::frame::{FrameDescription, Samples};

pub use merge::{Merged, Parts};
pub use read::Part;
pub use write::{Written, write};

/// The first bytes; the last is the version.
const MAGIC: [u8; 8] = *b"TSRpart\x04";

/// What keeps a part from being written, read or added.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The system says why.
    #[error("cannot {what} {}: {why}", path.display())]
    File {
        /// What was tried.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// The reason.
        why: io::Error,
    },
    /// Something else.
    #[error("{} is not a part: it does not begin as one", .0.display())]
    Foreign(PathBuf),
    /// Of another format.
    #[error("{} is a part of version {version}, and this program reads {}; render it again with this one", path.display(), MAGIC[7])]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        version: u8,
    },
    /// Cut off.
    #[error("{} is not whole: it ends too early", .0.display())]
    Truncated(PathBuf),
    /// Bits were changed.
    #[error("{} is damaged: its checksums do not match", .0.display())]
    Damaged(PathBuf),
    /// Of another frame.
    #[error("{} belongs to another picture: its {what} is \"{theirs}\" instead of \"{ours}\"", path.display())]
    Mismatch {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: &'static str,
        /// The value in the file.
        theirs: String,
        /// The value that was expected.
        ours: String,
    },
    /// Two parts are of different frames.
    #[error(
        "{} and {} are of different pictures: their {what} is \"{}\" and \"{}\"",
        paths[0].display(), paths[1].display(), values[0], values[1]
    )]
    Different {
        /// The files.
        paths: [PathBuf; 2],
        /// What differs.
        what: &'static str,
        /// Its values.
        values: [String; 2],
    },
    /// Two parts have the same samples.
    #[error(
        "{} and {} both have samples {}:{}; leave one of them out",
        paths[0].display(), paths[1].display(), samples.start, samples.end
    )]
    Overlap {
        /// The files.
        paths: [PathBuf; 2],
        /// The samples.
        samples: std::ops::Range<u64>,
    },
    /// Nothing to add.
    #[error("there are no parts to merge")]
    None,
    /// It ends where others cannot go on.
    #[error(
        "{} ends at sample {end}, within {epoch} that share with each other: finish it with --resume before it is added to \
         others", path.display()
    )]
    Unfinished {
        /// The file.
        path: PathBuf,
        /// Its last sample and one.
        end: u64,
        /// Length of an epoch.
        epoch: u64,
    },
    /// Its filter cannot be taken apart.
    #[error("a frame with the filter \"{0}\" cannot be stored in parts; use --filter adaptive or none")]
    Filter(&'static str),
}

/// Whether frames of this filter can be stored.
///
/// # Errors
/// [`PartError::Filter`].
pub fn storable(filtering: &Filtering) -> Result<(), PartError> {
    match filtering {
        Filtering::None | Filtering::Adaptive(..) => Ok(()),
        Filtering::Talk(..) => Err(PartError::Filter(filtering.name())),
    }
}

/// Tiles of a batch, a row of them: runs of some hundred kilobytes.
fn batch_length(description: &FrameDescription) -> usize {
    description.bounds.width().div_ceil(TILE) as usize
}

/// Number of runs of a batch: one for each tree, and the pixels.
fn runs(description: &FrameDescription) -> usize {
    description.filtering.adaptive(&description.surroundings).map_or(0, |params| params.stored_trees()) + 1
}

/// The sample after the last, if it shares with those before it.
fn unfinished(description: &FrameDescription, samples: &Samples) -> Option<u64> {
    let next = samples.ranges().last().map_or(0, |range| range.end);
    (!description.filtering.begins_epoch(next) && next != description.spp).then_some(next)
}

/// Tiles in batches of so many.
fn batches(tiles: Range<usize>, length: usize) -> impl Iterator<Item = Range<usize>> {
    let end = tiles.end;
    tiles.step_by(length).map(move |first| first..(first + length).min(end))
}
