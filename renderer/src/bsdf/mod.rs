//! How surfaces scatter light.
//!
//! # Contract of every model
//! Directions are unit, in the shading frame, away from the surface; `wo` may be on either side, and what is below the
//! shading normal is inside. `eval` is f·|cosθᵢ| in sr⁻¹ (not f), for radiance travelling from `wi` to `wo`: light that
//! crosses an interface is scaled by 1/η². Delta lobes are left out of `eval` and `pdf`, which are 0 for them, and appear
//! only in `sample`. `pdf` is per unit solid angle of `wi`, over all non-delta lobes together, and includes the
//! probability of choosing them; the probabilities of the delta lobes make up the rest of 1, so it need not integrate to
//! 1, nor where sampled facets reflect into the surface. A direction in the tangent plane is on no side: `eval` and `pdf`
//! are 0, `sample` yields nothing. Nothing here is ever NaN or negative.

use glam::Vec2;

use crate::math::{LocalDir, Rgb};

mod coat;
mod coated;
mod conductor;
mod dielectric;
pub mod fresnel;
mod lambert;
mod metal;
pub mod microfacet;
mod table;

pub use coat::{Coat, CoatTable};
pub use coated::{CoatedConductor, CoatedDiffuse};
pub use conductor::Conductor;
pub use dielectric::{Dielectric, ThinDielectric};
pub use lambert::{Diffuse, DiffuseTransmission};
pub use metal::MetalTable;

/// What a surface does at one point, with its textures looked up. Tables are borrowed from the world.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'w> {
    /// Lambertian.
    Diffuse(Diffuse),
    /// Lambertian on both sides.
    DiffuseTransmission(DiffuseTransmission),
    /// Metal.
    Conductor(Conductor<'w>),
    /// Glass.
    Dielectric(Dielectric),
    /// A pane.
    ThinDielectric(ThinDielectric),
    /// Lambertian under a dielectric coat.
    CoatedDiffuse(CoatedDiffuse<'w>),
    /// Metal under a dielectric coat.
    CoatedConductor(CoatedConductor<'w>),
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where the light comes from.
    pub wi: LocalDir,
    /// f·|cosθᵢ|/pdf; for a delta lobe its reflectance or transmittance (times 1/η²) over the probability of its choice.
    pub weight: Rgb,
    /// What `pdf` yields for `wi`, sr⁻¹; for a delta lobe the probability of its choice.
    pub pdf: f32,
    /// A delta lobe: no other strategy can find this direction.
    pub specular: bool,
    /// `wi` is on the other side.
    pub transmission: bool,
    /// Index of the side of `wi` over that of the side of `wo`; 1 unless the interface was crossed.
    pub eta: f32,
}

impl BsdfSample {
    fn reflection(wi: LocalDir, weight: Rgb, pdf: f32) -> Self {
        Self { wi, weight, pdf, specular: false, transmission: false, eta: 1.0 }
    }

    fn mirror(wi: LocalDir, weight: Rgb, probability: f32) -> Self {
        Self { specular: true, ..Self::reflection(wi, weight, probability) }
    }
}

impl Bsdf<'_> {
    /// f·|cosθᵢ|, sr⁻¹, without delta lobes.
    #[inline]
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Rgb {
        self.eval_pdf(wo, wi).0
    }

    /// Density of [`Self::sample`], sr⁻¹, without delta lobes.
    #[inline]
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.eval_pdf(wo, wi).1
    }

    /// [`Self::eval`] and [`Self::pdf`] at the price of one.
    #[inline]
    pub fn eval_pdf(&self, wo: LocalDir, wi: LocalDir) -> (Rgb, f32) {
        match self {
            Self::Diffuse(b) => b.eval_pdf(wo, wi),
            Self::DiffuseTransmission(b) => b.eval_pdf(wo, wi),
            Self::Conductor(b) => b.eval_pdf(wo, wi),
            Self::Dielectric(b) => b.eval_pdf(wo, wi),
            Self::ThinDielectric(_) => (Rgb::ZERO, 0.0),
            Self::CoatedDiffuse(b) => b.eval_pdf(wo, wi),
            Self::CoatedConductor(b) => b.eval_pdf(wo, wi),
        }
    }

    /// Draws `wi`. `u_lobe` and `u` are uniform in [0, 1). `None`: the sampled facet leads nowhere, the path ends.
    #[inline]
    pub fn sample(&self, wo: LocalDir, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self {
            Self::Diffuse(b) => b.sample(wo, u),
            Self::DiffuseTransmission(b) => b.sample(wo, u_lobe, u),
            Self::Conductor(b) => b.sample(wo, u),
            Self::Dielectric(b) => b.sample(wo, u_lobe, u),
            Self::ThinDielectric(b) => b.sample(wo, u_lobe),
            Self::CoatedDiffuse(b) => b.sample(wo, u_lobe, u),
            Self::CoatedConductor(b) => b.sample(wo, u_lobe, u),
        }
    }

    /// All lobes are deltas: `eval` is 0 everywhere, so a light need not be sampled.
    #[inline]
    pub fn is_specular(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::DiffuseTransmission(_) | Self::CoatedDiffuse(_) => false,
            Self::Conductor(b) => b.ggx.is_smooth(),
            Self::Dielectric(b) => b.is_specular(),
            Self::ThinDielectric(_) => true,
            Self::CoatedConductor(b) => b.is_specular(),
        }
    }

    /// Some light goes through: what is below the surface matters.
    #[inline]
    pub fn is_transmissive(&self) -> bool {
        matches!(self, Self::DiffuseTransmission(_) | Self::Dielectric(_) | Self::ThinDielectric(_))
    }

    /// Roughened where it is smoother than alpha = 0.3, as pbrt-v4 does after a diffuse bounce. A pane stays as it is.
    #[cold]
    pub fn regularized(self) -> Self {
        match self {
            Self::Conductor(b) => Self::Conductor(Conductor { ggx: b.ggx.regularized(), ..b }),
            Self::Dielectric(b) => Self::Dielectric(Dielectric { ggx: b.ggx.regularized(), ..b }),
            Self::CoatedDiffuse(b) => Self::CoatedDiffuse(b.regularized()),
            Self::CoatedConductor(b) => Self::CoatedConductor(b.regularized()),
            Self::Diffuse(_) | Self::DiffuseTransmission(_) | Self::ThinDielectric(_) => self,
        }
    }

    /// The part that a [`Self::diffuse`] lobe reflects, but for light's way in: the diffuse share of [`Self::eval`] is
    /// this times that. Holds all of the texture and all that depends on `wo`; zero where there is no such lobe.
    #[inline]
    pub fn diffuse_albedo(&self, wo: LocalDir) -> Rgb {
        match self {
            Self::Diffuse(b) => b.albedo,
            Self::DiffuseTransmission(b) => b.reflectance,
            Self::CoatedDiffuse(b) => b.diffuse_albedo(wo),
            Self::Conductor(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::CoatedConductor(_) => Rgb::ZERO,
        }
    }

    /// How much of the light from `wi` arrives in the diffuse lobe, times |cosθᵢ|/π, sr⁻¹. The same for all `wo` on the
    /// side of `wi`, zero for those on the other.
    #[inline]
    pub fn diffuse(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        if !wo.same_hemisphere(wi) {
            return 0.0;
        }
        match self {
            Self::Diffuse(_) | Self::DiffuseTransmission(_) => wi.abs_cos_theta() * std::f32::consts::FRAC_1_PI,
            Self::CoatedDiffuse(b) => b.diffuse(wi),
            Self::Conductor(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::CoatedConductor(_) => 0.0,
        }
    }

    /// Fraction of uniform light from all around that leaves towards `wo`, for the albedo channel: masking losses of rough
    /// metals and glass are left out.
    pub fn albedo(&self, wo: LocalDir) -> Rgb {
        match self {
            Self::Diffuse(b) => b.albedo,
            Self::DiffuseTransmission(b) => b.reflectance + b.transmittance,
            Self::Conductor(b) => b.fresnel.at(wo.abs_cos_theta()),
            Self::Dielectric(_) | Self::ThinDielectric(_) => Rgb::ONE,
            Self::CoatedDiffuse(b) => b.albedo(wo),
            Self::CoatedConductor(b) => b.albedo(wo),
        }
    }
}

#[cfg(test)]
mod tests;
