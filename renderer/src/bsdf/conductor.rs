//! Metals.

use glam::{Vec2, Vec3};

use super::BsdfSample;
use super::fresnel::{ConductorFresnel, reflect};
use super::microfacet::Ggx;
use crate::math::{LocalDir, Rgb};

/// A metal with a GGX or perfectly smooth surface. Light between the microfacets is lost after one bounce, as in
/// pbrt-v4.
#[derive(Clone, Copy, Debug)]
pub struct Conductor<'w> {
    /// The surface.
    pub ggx: Ggx,
    /// The metal.
    pub fresnel: ConductorFresnel<'w>,
}

impl Conductor<'_> {
    #[inline]
    pub(super) fn eval_pdf(&self, wo: LocalDir, wi: LocalDir) -> (Rgb, f32) {
        if self.ggx.is_smooth() || !wo.same_hemisphere(wi) {
            return (Rgb::ZERO, 0.0);
        }
        let Some(lobe) = Reflection::new(&self.ggx, upward(wo), upward(wi)) else { return (Rgb::ZERO, 0.0) };
        (self.fresnel.at(lobe.cos_d) * lobe.value, lobe.pdf)
    }

    #[inline]
    pub(super) fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 {
            return None;
        }
        if self.ggx.is_smooth() {
            let wi = wo.flipped().reversed();
            return Some(BsdfSample::mirror(wi, self.fresnel.at(wi.abs_cos_theta()), 1.0));
        }
        let lobe = Reflection::sample(&self.ggx, upward(wo), u)?;
        let weight = self.fresnel.at(lobe.cos_d) * (lobe.value / lobe.pdf);
        Some(BsdfSample::reflection(on_side_of(wo, lobe.wi), weight, lobe.pdf))
    }
}

/// `w` mirrored to above the surface. Harmless to GGX, which does not tell its sides apart.
#[inline]
pub(super) fn upward(w: LocalDir) -> Vec3 {
    let v = w.vec();
    Vec3::new(v.x, v.y, v.z.abs())
}

/// `up`, which is above the surface, mirrored to the side of `wo`.
#[inline]
pub(super) fn on_side_of(wo: LocalDir, up: Vec3) -> LocalDir {
    LocalDir::new(Vec3::new(up.x, up.y, up.z.copysign(wo.cos_theta())))
}

/// Reflection by GGX facets that reflect everything, above the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reflection {
    /// Incident direction.
    pub wi: Vec3,
    /// Cosine of the angle between the directions and the facet.
    pub cos_d: f32,
    /// f·cosθᵢ, sr⁻¹.
    pub value: f32,
    /// Density of [`Self::sample`], sr⁻¹.
    pub pdf: f32,
}

impl Reflection {
    /// `None` where either direction is in the tangent plane. Both unit, cosθ ≥ 0.
    #[inline]
    pub fn new(ggx: &Ggx, wo: Vec3, wi: Vec3) -> Option<Self> {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return None;
        }
        let h = wo + wi;
        let h2 = h.length_squared();
        // cosθ = wo·h/|h|, and wo·h = 1 + wo·wi = |h|²/2.
        Some(Self::at(ggx, wo, wi, ggx.d_along(h, h2), 0.5 * h2.sqrt()))
    }

    /// By visible normals; `None` where the facet reflects into the surface.
    #[inline]
    pub fn sample(ggx: &Ggx, wo: Vec3, u: Vec2) -> Option<Self> {
        let m = ggx.sample_visible(wo, u);
        let wi = reflect(wo, m);
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        Some(Self::at(ggx, wo, wi, ggx.d(m), wo.dot(m).max(0.0)))
    }

    #[inline]
    fn at(ggx: &Ggx, wo: Vec3, wi: Vec3, d: f32, cos_d: f32) -> Self {
        let half_d = 0.5 * d;
        let (so, si) = (ggx.stretch(wo), ggx.stretch(wi));
        Self { wi, cos_d, value: half_d * wi.z / (wi.z * so + wo.z * si), pdf: half_d / (wo.z + so) }
    }
}
