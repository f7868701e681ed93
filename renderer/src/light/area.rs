//! Emission of surfaces.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::Group;
use super::image::LightImage;
use crate::math::Rgb;
use crate::shape::Shape;

/// A shape that emits.
#[derive(Clone, Debug)]
pub struct AreaEmitter {
    /// The shape, in the world.
    pub shape: Shape,
    /// Its emission.
    pub emission: Emission,
    /// Its group.
    pub group: Group,
}

/// What each point of a surface emits, the same into all directions of a side.
#[derive(Clone, Debug)]
pub struct Emission {
    /// Radiance, or the factor of the image. W/(sr m²).
    pub radiance: Rgb,
    /// Index of the image over uv in the table of the lights' images.
    pub image: Option<u32>,
    /// Emits also on the side that the normal points away from.
    pub two_sided: bool,
}

impl Emission {
    /// Radiance that leaves the surface point at `uv` with normal `n` along `wo`.
    #[inline]
    pub fn radiance(&self, images: &[Arc<LightImage>], uv: Vec2, n: Vec3, wo: Vec3) -> Rgb {
        if !self.two_sided && n.dot(wo) <= 0.0 {
            return Rgb::ZERO;
        }
        match self.image {
            None => self.radiance,
            // Images have their top at v = 1.
            Some(image) => self.radiance * images[image as usize].bilinear(Vec2::new(uv.x, 1.0 - uv.y)),
        }
    }
}
