//! Uniform numbers for the integrator, and discrete and piecewise constant distributions built from data.

pub mod discrete;
mod hash;
pub mod piecewise;
pub mod sampler;
#[cfg(test)]
pub(crate) mod stats;

pub use discrete::AliasTable;
pub use hash::mix64;
pub use piecewise::{PiecewiseConstant1D, PiecewiseConstant2D};
pub use sampler::{Dimension, Numbers, Sampler, Use, VertexNumbers};
