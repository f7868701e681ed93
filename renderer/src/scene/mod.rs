//! What a scene file says: plain data, before anything is built from it.

mod assets;
pub mod description;
pub mod diagnostic;
mod origin;
mod path_map;
pub mod pbrt;
pub mod ply;

pub use description::Scene;
pub use diagnostic::{Diagnostic, Severity, SourceMap, Span};
pub use path_map::{PathFormat, PathMap, PathRule};
