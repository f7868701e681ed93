//! The filter as a whole, by scenes that are formulas.

mod robust;
mod support;
