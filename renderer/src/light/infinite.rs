//! Lights beyond everything: uniform and image environments, and parallel light.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::environment::Environment;
use crate::math::{Frame, Rgb, warp};

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
    Image(Box<Environment>),
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
            Infinite::Image(image) => image.is_sampled(),
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
            Infinite::Image(image) => image.sample(n, u),
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
    if n == Vec3::ZERO { 0.25 / PI } else { warp::cosine_hemisphere_pdf(wi.dot(n)) }
}
