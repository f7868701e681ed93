//! Emission of surfaces.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::Group;
use super::image::LightImage;
use crate::math::Rgb;
use crate::scene::description::Value;
use crate::shape::{Shape, ShapeSample};
use crate::texture::{TexturePoint, Textures};

/// A shape that emits.
#[derive(Clone, Debug)]
pub struct AreaEmitter {
    /// The shape, in the world.
    pub shape: Shape,
    /// Its emission.
    pub emission: Emission,
    /// Probability of a point being there, `None`: 1. What light samples find is that much darker in the mean.
    pub alpha: Option<Value<f32>>,
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

impl AreaEmitter {
    /// Radiance that a sampled point sends along `wo` in the mean over whether it is there.
    #[inline]
    pub fn sampled(&self, images: &[Arc<LightImage>], textures: &Textures, at: &ShapeSample, wo: Vec3) -> Rgb {
        let radiance = self.emission.radiance(images, at.uv, at.n, wo);
        let Some(alpha) = &self.alpha else { return radiance };
        let at = TexturePoint { p: at.point.p, n: at.n, uv: at.uv, ..TexturePoint::default() };
        radiance * textures.float(alpha, &at).clamp(0.0, 1.0)
    }
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
