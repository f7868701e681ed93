//! Support shared by the whole-renderer tests and benchmarks.
#![forbid(unsafe_code)]

pub mod baselines;
pub mod error;
pub mod image;
pub mod render;
pub mod shared;
pub mod small;
pub mod strange;
pub mod synthetic;
