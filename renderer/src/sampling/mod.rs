//! Uniform numbers for the integrator, and piecewise constant distributions built from data.

mod hash;
pub mod piecewise;
pub mod sampler;
#[cfg(test)]
pub(crate) mod stats;

pub use hash::mix64;
pub use piecewise::PiecewiseConstant2D;
pub use sampler::{Dimension, Numbers, Sampler, Use, VertexNumbers};
