//! Lambertian reflection and transmission.

use std::f32::consts::FRAC_1_PI;

use glam::Vec2;

use super::BsdfSample;
use crate::math::{LocalDir, Rgb, warp};

/// Reflects the same radiance in all directions, on both sides of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse {
    /// In [0, 1].
    pub albedo: Rgb,
}

impl Diffuse {
    #[inline]
    pub(super) fn eval_pdf(&self, wo: LocalDir, wi: LocalDir) -> (Rgb, f32) {
        if !wo.same_hemisphere(wi) {
            return (Rgb::ZERO, 0.0);
        }
        let pdf = wi.abs_cos_theta() * FRAC_1_PI;
        (self.albedo * pdf, pdf)
    }

    #[inline]
    pub(super) fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        let wi = cosine_around(wo.cos_theta(), u)?;
        Some(BsdfSample::reflection(wi, self.albedo, wi.abs_cos_theta() * FRAC_1_PI))
    }
}

/// Reflects and transmits diffusely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Albedo of reflection.
    pub reflectance: Rgb,
    /// Albedo of transmission.
    pub transmittance: Rgb,
}

impl DiffuseTransmission {
    /// Probability of sampling the reflection.
    fn reflection_probability(&self) -> f32 {
        let (r, t) = (self.reflectance.max_element(), self.transmittance.max_element());
        if r + t > 0.0 { r / (r + t) } else { 1.0 }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: LocalDir, wi: LocalDir) -> (Rgb, f32) {
        let cosine = wi.abs_cos_theta() * FRAC_1_PI;
        let pr = self.reflection_probability();
        if wo.same_hemisphere(wi) {
            (self.reflectance * cosine, pr * cosine)
        } else if wo.cos_theta() != 0.0 {
            (self.transmittance * cosine, (1.0 - pr) * cosine)
        } else {
            (Rgb::ZERO, 0.0)
        }
    }

    #[inline]
    pub(super) fn sample(&self, wo: LocalDir, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let pr = self.reflection_probability();
        if u_lobe < pr {
            let wi = cosine_around(wo.cos_theta(), u)?;
            Some(BsdfSample::reflection(wi, self.reflectance / pr, pr * wi.abs_cos_theta() * FRAC_1_PI))
        } else {
            let pt = 1.0 - pr;
            let wi = cosine_around(-wo.cos_theta(), u)?;
            let pdf = pt * wi.abs_cos_theta() * FRAC_1_PI;
            Some(BsdfSample { transmission: true, ..BsdfSample::reflection(wi, self.transmittance / pt, pdf) })
        }
    }
}

/// Cosine-distributed on the side that `side` has the sign of; `None` for zero and where the cosine rounds to zero.
#[inline]
pub(super) fn cosine_around(side: f32, u: Vec2) -> Option<LocalDir> {
    let wi = warp::cosine_hemisphere(u);
    if side == 0.0 || wi.cos_theta() <= 0.0 {
        return None;
    }
    Some(if side > 0.0 { wi } else { wi.flipped() })
}
