//! Glass: one interface, and the pane.

use glam::{Vec2, Vec3};

use super::BsdfSample;
use super::conductor::{Reflection, on_side_of, upward};
use super::fresnel::{dielectric, refract};
use super::microfacet::Ggx;
use crate::math::{LocalDir, Rgb};

/// A dielectric interface with a GGX or perfectly smooth surface.
///
/// What is transmitted is radiance: it changes by 1/η² with the solid angle that it is refracted into.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index below the surface over that above it.
    pub eta: f32,
    /// The surface.
    pub ggx: Ggx,
}

impl Dielectric {
    /// Nothing but delta lobes. Without a step of the index even a rough interface lets light pass straight.
    #[inline]
    pub(super) fn is_specular(&self) -> bool {
        self.ggx.is_smooth() || self.eta == 1.0
    }

    /// Index of the far side over that of the side of `wo`.
    #[inline]
    fn eta_across(&self, wo: LocalDir) -> f32 {
        if wo.cos_theta() > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: LocalDir, wi: LocalDir) -> (Rgb, f32) {
        if self.is_specular() || wo.cos_theta() == 0.0 || wi.cos_theta() == 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let eta = self.eta_across(wo);
        let (value, pdf) = if wo.same_hemisphere(wi) {
            let Some(lobe) = Reflection::new(&self.ggx, upward(wo), upward(wi)) else { return (Rgb::ZERO, 0.0) };
            let reflectance = dielectric(lobe.cos_d, eta).reflectance;
            (lobe.value * reflectance, lobe.pdf * reflectance)
        } else {
            self.transmission(upward(wo), below(upward(wi)), eta)
        };
        (Rgb::splat(value), pdf)
    }

    /// f·cosθ and density of sampling it, for `wo` above and `wi` below.
    #[inline]
    fn transmission(&self, wo: Vec3, wi: Vec3, eta: f32) -> (f32, f32) {
        let Some(m) = (wo + wi * eta).try_normalize() else { return (0.0, 0.0) };
        let m = if m.z < 0.0 { -m } else { m };
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return (0.0, 0.0);
        }
        let transmittance = 1.0 - dielectric(cos_o, eta).reflectance;
        let (visible, pdf) = self.refraction_density(wo, wi, m, eta);
        (transmittance * visible * pdf / (eta * eta), transmittance * pdf)
    }

    /// G₂/G₁ and the density of `wi` when `m` is drawn from the normals visible to `wo`.
    #[inline]
    fn refraction_density(&self, wo: Vec3, wi: Vec3, m: Vec3, eta: f32) -> (f32, f32) {
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        let root = cos_i + cos_o / eta;
        let jacobian = cos_i.abs() / (root * root);
        let so = self.ggx.stretch(wo);
        let pdf = self.ggx.d(m) * 2.0 * cos_o / (wo.z + so) * jacobian;
        (self.visible_fraction(wo, wi, so), pdf)
    }

    /// G₂/G₁: how much of what `wo` sees of a facet also sees `wi`.
    #[inline]
    fn visible_fraction(&self, wo: Vec3, wi: Vec3, so: f32) -> f32 {
        let zi = wi.z.abs();
        zi * (wo.z + so) / (zi * so + wo.z * self.ggx.stretch(wi))
    }

    #[inline]
    pub(super) fn sample(&self, wo: LocalDir, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 {
            return None;
        }
        let eta = self.eta_across(wo);
        let up = upward(wo);
        let smooth = self.is_specular();
        let m = if smooth { Vec3::Z } else { self.ggx.sample_visible(up, u) };
        let cos_o = up.dot(m);
        if cos_o <= 0.0 {
            return None;
        }
        let interface = dielectric(cos_o, eta);
        let reflected = u_lobe < interface.reflectance;
        let probability = if reflected { interface.reflectance } else { 1.0 - interface.reflectance };
        let wi = if reflected { super::fresnel::reflect(up, m) } else { refract(up, m, cos_o, interface.cos_t, eta) };
        if reflected == (wi.z <= 0.0) || wi.z == 0.0 {
            return None;
        }
        let scale = if reflected { 1.0 } else { 1.0 / (eta * eta) };
        let (weight, pdf) = if smooth {
            (scale, probability)
        } else {
            let so = self.ggx.stretch(up);
            let density =
                if reflected { 0.5 * self.ggx.d(m) / (up.z + so) } else { self.refraction_density(up, wi, m, eta).1 };
            (scale * self.visible_fraction(up, wi, so), probability * density)
        };
        // The product may underflow far from the peak: such a direction cannot be told from an impossible one.
        if pdf <= 0.0 || !pdf.is_finite() {
            return None;
        }
        Some(BsdfSample {
            wi: if reflected { on_side_of(wo, wi) } else { on_side_of(wo.flipped(), below(wi)) },
            weight: Rgb::splat(weight),
            pdf,
            specular: smooth,
            transmission: !reflected,
            eta: if reflected { 1.0 } else { eta },
        })
    }
}

/// The direction mirrored at the surface.
#[inline]
fn below(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

/// A pane with two smooth parallel interfaces, thin enough not to displace what is seen through it.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Index of the pane.
    pub eta: f32,
}

impl ThinDielectric {
    /// Fraction reflected, all bounces between the interfaces summed: R + T²R/(1 − R²).
    #[inline]
    fn reflectance(&self, cos_theta: f32) -> f32 {
        let r = dielectric(cos_theta, self.eta).reflectance;
        if r < 1.0 { r + (1.0 - r) * (1.0 - r) * r / (1.0 - r * r) } else { 1.0 }
    }

    #[inline]
    pub(super) fn sample(&self, wo: LocalDir, u_lobe: f32) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 {
            return None;
        }
        let reflectance = self.reflectance(wo.abs_cos_theta());
        if u_lobe < reflectance {
            Some(BsdfSample::mirror(wo.flipped().reversed(), Rgb::ONE, reflectance))
        } else {
            Some(BsdfSample { transmission: true, ..BsdfSample::mirror(wo.reversed(), Rgb::ONE, 1.0 - reflectance) })
        }
    }
}
