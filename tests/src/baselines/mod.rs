//! Other people's filters, to be compared with.

pub mod cross_bilateral;
pub mod range_search;
