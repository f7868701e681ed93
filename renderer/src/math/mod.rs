//! Vectors, frames, rays with error bounds, and the maps and warps from squares to directions.

pub mod frame;
pub mod interval;
pub mod octahedral;
pub mod ray;
pub mod rgb;
pub mod transform;
mod unit;
pub mod warp;
mod wiener;
pub mod window;

pub use frame::{Frame, LocalDir};
pub use interval::{BELOW_ONE, PointWithError, gamma, next_away_from_zero, next_towards_zero};
pub use ray::{Ray, spawn_ray, spawn_segment};
pub use rgb::{Rgb, luminance};
pub use transform::Transform;
pub use unit::{unit, unit_and_inverse_length};
pub use wiener::wiener;
pub use window::{Widening, widened, windows};
