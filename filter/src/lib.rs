//! Path space filtering: vertices of light transport paths in, averages over cells of nearby vertices out.
#![forbid(unsafe_code)]

pub mod adaptive;
mod grid;
mod hash;
mod packed;
mod pairs;
mod record;
mod shrink;
mod snapshot;
mod sums;
mod table;
pub mod talk;

pub use adaptive::{Adaptive, Params, Report, Resolved};
pub use grid::Anchor;
pub use packed::{PackedFootprint, PackedNormal, PackedRgb};
pub use record::{Lobe, PathRecord, Vertex, direction_bin};
pub use shrink::Shrinkage;
pub use snapshot::{Snapshot, SnapshotError};
