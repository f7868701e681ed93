//! Lights beyond everything: uniform and image environments, and parallel light.

use std::f64::consts::PI;

use glam::{DMat3, Mat3, Vec2, Vec3};

use super::image::LightImage;
use super::octahedral;
use crate::math::{Frame, Rgb, warp};
use crate::sampling::PiecewiseConstant2D;

/// A light at infinite distance.
#[derive(Clone, Debug)]
pub enum Infinite {
    /// The same radiance from everywhere.
    Uniform {
        /// W/(sr m²).
        radiance: Rgb,
        /// Whether light samples are drawn from it.
        sampled: bool,
    },
    /// An environment image.
    Image(Box<ImageLight>),
    /// Parallel light: a delta.
    Distant {
        /// Irradiance orthogonal to it, W/m².
        irradiance: Rgb,
        /// Unit, towards the light.
        wi: Vec3,
    },
}

/// A direction towards an infinite light.
#[derive(Clone, Copy, Debug)]
pub struct DirectionSample {
    /// Unit, towards the light.
    pub wi: Vec3,
    /// Radiance from there; of a delta: irradiance orthogonal to it.
    pub radiance: Rgb,
    /// Density in sr⁻¹; 1 for a delta.
    pub pdf: f32,
    /// The direction has no density.
    pub delta: bool,
}

impl Infinite {
    /// Whether [`Self::sample`] ever returns a sample.
    pub fn is_sampled(&self) -> bool {
        match self {
            Infinite::Uniform { sampled, .. } => *sampled,
            Infinite::Image(image) => image.distribution.is_some(),
            Infinite::Distant { .. } => true,
        }
    }

    /// Leaves to BSDF samples what they find better. See [`super::Lights::beside_bsdf_samples`].
    pub fn leave_to_bsdf_samples(&mut self) {
        match self {
            Infinite::Uniform { sampled, .. } => *sampled = false,
            Infinite::Image(image) => image.compensate(),
            Infinite::Distant { .. } => {}
        }
    }

    /// A direction for a receiver that lies in the hemisphere around `n`, or has both if `n` is zero.
    #[inline]
    pub fn sample(&self, n: Vec3, u: Vec2) -> Option<DirectionSample> {
        match self {
            Infinite::Uniform { radiance, .. } => {
                let wi = if n == Vec3::ZERO {
                    warp::uniform_sphere(u)
                } else {
                    Frame::from_normal(n).to_world(warp::cosine_hemisphere(u))
                };
                let pdf = uniform_pdf(wi, n);
                (pdf > 0.0).then_some(DirectionSample { wi, radiance: *radiance, pdf, delta: false })
            }
            Infinite::Image(image) => image.sample(u),
            Infinite::Distant { irradiance, wi } => {
                Some(DirectionSample { wi: *wi, radiance: *irradiance, pdf: 1.0, delta: true })
            }
        }
    }

    /// Radiance from the unit direction `wi`, and the density (sr⁻¹) with which [`Self::sample`] draws it. A delta is
    /// never met by chance.
    #[inline]
    pub fn radiance_and_pdf(&self, wi: Vec3, n: Vec3) -> (Rgb, f32) {
        match self {
            Infinite::Uniform { radiance, sampled } => (*radiance, if *sampled { uniform_pdf(wi, n) } else { 0.0 }),
            Infinite::Image(image) => image.radiance_and_pdf(wi),
            Infinite::Distant { .. } => (Rgb::ZERO, 0.0),
        }
    }
}

#[inline]
fn uniform_pdf(wi: Vec3, n: Vec3) -> f32 {
    if n == Vec3::ZERO { (0.25 / PI) as f32 } else { warp::cosine_hemisphere_pdf(wi.dot(n)) }
}

/// An environment given by an equal-area octahedral image.
#[derive(Clone, Debug)]
pub struct ImageLight {
    /// Of determinant ±1, so that the factor between the solid angles of both spaces is |M d|⁻³.
    light_from_world: Mat3,
    world_from_light: Mat3,
    scale: Rgb,
    image: LightImage,
    /// Over the image's square; `None`: light samples are not drawn.
    distribution: Option<PiecewiseConstant2D>,
    /// Sum of channels below which a texel is not sampled.
    threshold: f32,
    /// Density on the light's sphere (sr⁻¹) per unit of [`Self::importance`].
    pdf_scale: f32,
}

impl ImageLight {
    /// The square `image` times `scale`, turned by an invertible `light_from_world`.
    pub fn new(image: LightImage, scale: Rgb, light_from_world: DMat3) -> Self {
        debug_assert_eq!(image.width(), image.height());
        let normalized = light_from_world * (1.0 / light_from_world.determinant().abs().cbrt());
        let mut light = Self {
            light_from_world: normalized.as_mat3(),
            world_from_light: normalized.inverse().as_mat3(),
            scale,
            image,
            distribution: None,
            threshold: 0.0,
            pdf_scale: 0.0,
        };
        light.distribute();
        light
    }

    /// Samples only what exceeds the mean, by how much it does. With BSDF samples beside, which find the rest, the
    /// weighted sum of both stays complete and has less variance.
    ///
    /// **Source**: \[Karlik19\] section 4.1.
    fn compensate(&mut self) {
        self.threshold = self.image.mean().element_sum() as f32;
        self.distribute();
    }

    fn distribute(&mut self) {
        let importances: Vec<f32> = self.image.texels().iter().map(|&t| self.importance(t)).collect();
        let sum: f64 = importances.iter().map(|&v| f64::from(v)).sum();
        let pdf_scale = importances.len() as f64 / (sum * 4.0 * PI);
        // A map so dark that the scale overflows (below 1e-38) is black for sampling.
        let lit = (pdf_scale as f32).is_finite() && sum > 0.0;
        self.pdf_scale = if lit { pdf_scale as f32 } else { 0.0 };
        self.distribution = if lit { PiecewiseConstant2D::new(&importances, self.image.width()) } else { None };
    }

    /// What the density of a texel is proportional to.
    #[inline]
    fn importance(&self, texel: Rgb) -> f32 {
        (texel.element_sum() - self.threshold).max(0.0)
    }

    #[inline]
    fn sample(&self, u: Vec2) -> Option<DirectionSample> {
        let (uv, _, [x, y]) = self.distribution.as_ref()?.sample(u);
        let texel = self.image.texels()[y * self.image.width() + x];
        let stretched = self.world_from_light * octahedral::direction_from_square(uv);
        let length = stretched.length();
        let pdf = self.importance(texel) * self.pdf_scale * (length * length * length);
        (pdf > 0.0).then_some(DirectionSample {
            wi: stretched / length,
            radiance: self.scale * texel,
            pdf,
            delta: false,
        })
    }

    #[inline]
    fn radiance_and_pdf(&self, wi: Vec3) -> (Rgb, f32) {
        let stretched = self.light_from_world * wi;
        let length = stretched.length();
        let texel = self.image.nearest(octahedral::square_from_direction(stretched / length));
        (self.scale * texel, self.importance(texel) * self.pdf_scale / (length * length * length))
    }

    /// Whether every direction is black.
    pub fn is_black(&self) -> bool {
        self.scale == Rgb::ZERO || self.image.texels().iter().all(|t| *t == Rgb::ZERO)
    }
}

/// Illuminance (luminance · sr) that `image` gives a surface facing +z of light space, as pbrt computes it.
///
/// pbrt takes the mean over the square times 2π, but only the upper half of the texels contributes, of which each stands
/// for 4π over the number of texels: half the true value. Kept, so that `illuminance` means what it does there.
pub fn pbrt_illuminance(image: &LightImage) -> f64 {
    let (width, height) = (image.width(), image.height());
    let mut sum = 0.0;
    for (i, texel) in image.texels().iter().enumerate() {
        let uv = (Vec2::new((i % width) as f32, (i / width) as f32) + 0.5) / Vec2::new(width as f32, height as f32);
        let cos_theta = octahedral::direction_from_square(uv).z;
        sum += f64::from(crate::math::luminance(*texel)) * f64::from(cos_theta.max(0.0));
    }
    2.0 * PI * sum / (width * height) as f64
}

#[cfg(test)]
#[path = "infinite_tests.rs"]
mod tests;
