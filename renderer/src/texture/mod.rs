//! Textures: values that vary over surfaces.

pub mod encoding;
pub mod image;

pub use image::{RgbImage, load_rgb, load_rgb_encoded};

use glam::{Vec2, Vec3};

/// Where a texture is looked up, and how far one pixel reaches there. World space.
///
/// The derivatives are per pixel; zeros mean no footprint, so nothing is filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexturePoint {
    /// Position.
    pub p: Vec3,
    /// Unit shading normal.
    pub n: Vec3,
    /// Surface parameters.
    pub uv: Vec2,
    /// Change of `p` from this pixel to the next in x.
    pub dpdx: Vec3,
    /// Change of `p` from this pixel to the next in y.
    pub dpdy: Vec3,
    /// Change of `uv` from this pixel to the next in x.
    pub duvdx: Vec2,
    /// Change of `uv` from this pixel to the next in y.
    pub duvdy: Vec2,
}
