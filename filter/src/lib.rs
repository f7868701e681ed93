//! Path space filtering: vertices of light transport paths in, averages over cells of nearby vertices out.
//!
//! A renderer cuts each path at one or two vertices and says in a [`PathRecord`] what arrives there and what becomes of it
//! on the way to its pixel. The filter replaces what one path found by what many paths found nearby. It knows no renderer,
//! no scene, no layout of pixels and no clock: a pixel is a number, here a *slot*, and all that crosses the boundary is in
//! that one plain record.
//!
//! - [`Adaptive`] tells noise from signal and lets cells shrink as samples come in; its bias vanishes. The one to use.
//! - [`talk::Talk`] is the filter of the talk of 2018 \[Binder18\] with all its knobs, to compare with.
//!
//! # Who writes and reads what, and when
//! | what | written by | when | read by | when |
//! |---|---|---|---|---|
//! | [`PathRecord`] | renderer | while it traces a block of samples | filter | in `add`, and not after it |
//! | prefix: light that no selected vertex sent on | renderer, into sums of its own | while it traces | renderer | after `resolve`; the filter never sees it |
//! | cells of second vertices | `Adaptive::add` | first of all in it | `Adaptive::add` | next, as what arrives at first vertices |
//! | cells of first vertices | `Adaptive::add` | then | `Adaptive::resolve` | at the end |
//! | pairs: slot, cell, throughput | `Adaptive::add` | with those cells | `Adaptive::resolve` | at the end |
//! | keys in the talk's table | `Talk::add` | first of all in it | `Talk::add` | next |
//! | cells of the talk | `Talk::add` | when all keys have their places | `Talk::add`, or `resolve` | when all paths have deposited: see [`talk::Reading`] |
//! | sums of slots | `add`, `resolve` | as above | renderer | from `resolve`: it adds the prefix and normalises |
//!
//! Within each step threads work in any order and the result has the same bits: sums are of integers, and what competes
//! for a place is settled by its key, never by who came first.
//!
//! # How to use it
//! 1. Trace a block of samples of the whole frame, and cut every path at the first vertex that is neither mirror nor
//!    smooth glass. Keep the light met before it as the slot's prefix. Fill a record from the rest: light is *local*, as it
//!    arrives at the vertex, and throughput is kept beside it, so nothing is divided by a throughput. Radiance in diffuse
//!    lobes is over albedo, which goes into the throughput: so textures stay sharp.
//! 2. Check that prefix + [`PathRecord::unfiltered`] is the sample that the path would have been. Most mistakes show here.
//! 3. Give the records to `add`, by part: any division of the slots that does not change, such as tiles. A block is what
//!    shares: to have the same result from other threads or machines, keep the blocks, not the order.
//! 4. After the last block, or whenever there is to be a picture, call `resolve`, add each slot's prefix, and divide by
//!    what an unfiltered sum would be divided by.
//!
//! ```
//! use filter::{Adaptive, Anchor, Lobe, PackedRgb, Params, PathRecord, Vertex};
//! use glam::{DVec3, Vec3};
//!
//! let anchor = Anchor { origin: DVec3::ZERO, extent: 10.0 };
//! let mut filter = Adaptive::new(&Params::default(), &anchor, 1);
//! // Two paths of neighbouring pixels reach a white wall in one place. One finds light, one does not.
//! let path = |slot: u32, radiance: f32| PathRecord {
//!     slot,
//!     first: Vertex::new(Vec3::new(0.001 * slot as f32, 0.0, 5.0), -Vec3::Z, 0.1, 0, 0),
//!     diffuse: Lobe {
//!         throughput: PackedRgb::new(Vec3::splat(0.8)),
//!         rest: PackedRgb::new(Vec3::splat(radiance)),
//!         ..Lobe::default()
//!     },
//!     ..PathRecord::default()
//! };
//! filter.add(&[vec![path(0, 1.0), path(1, 0.0)]]);
//! for (_slot, value) in filter.resolve().into_iter().flatten() {
//!     assert!((value.diffuse - Vec3::splat(0.4)).abs().max_element() < 1e-3);
//! }
//! ```
//! `examples/other_renderer.rs` has a whole small renderer.
#![forbid(unsafe_code)]

pub mod adaptive;
mod belief;
mod buckets;
mod cell;
mod first;
mod grid;
mod hash;
mod packed;
mod packed_pairs;
mod pairs;
mod record;
mod second;
mod shards;
mod shrink;
mod sides;
mod slot_sums;
mod stored;
mod sums;
mod table;
pub mod talk;

pub use adaptive::{Adaptive, Params, Report, Resolved};
pub use belief::most_probable;
pub use grid::Anchor;
pub use packed::{PackedFootprint, PackedNormal, PackedRgb};
pub use record::{Lobe, PathRecord, Vertex, direction_bin};
pub use shrink::Shrinkage;
pub use stored::{Branch, EpochPiece, Merging, Slots, StoredError};
