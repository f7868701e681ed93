//! Raw Embree 4: exactly what the installed `embree4/rtcore.h` declares, generated at build time.
//!
//! Nothing here is safe or documented; the man pages of `libembree-dev` are the reference, and the crate `embree` is
//! the only one that should use it.
#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals, missing_docs, clippy::all)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));

/// `geomID`, `primID` and `instID` where there is no hit; the header's macro is a cast, which bindgen cannot evaluate.
pub const RTC_INVALID_GEOMETRY_ID: u32 = u32::MAX;
