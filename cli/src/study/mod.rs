//! `tessera study`: the trade between time and error, measured.
//!
//! [`plan`] says what is to be rendered, [`renders`] does what is not there yet, [`measure`] compares it with the
//! reference, [`verdict`] draws conclusions, [`page`] shows all of it.

pub mod chart;
pub mod measure;
pub mod page;
pub mod picture;
pub mod plan;
pub mod renders;
pub mod verdict;
