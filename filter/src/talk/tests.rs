//! The filter as a whole, by scenes that are formulas.

mod kernel;
mod levels;
mod robust;
mod sequence;
mod support;
