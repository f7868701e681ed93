//! Layered materials: a base under a dielectric coat, in closed form.
//!
//! pbrt-v4 evaluates these by a random walk per evaluation. Here the same walk is summed at build (see
//! [`super::coat`] and [`super::metal`]), so that evaluating is cheap and without noise. Under rough coats pbrt-v4's estimate
//! of the walk is too bright, which is not followed: `tests/layered_values.rs` has the figures.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::BsdfSample;
use super::coat::{Coat, attenuation};
use super::conductor::{Reflection, on_side_of, upward};
use super::fresnel::{ConductorFresnel, dielectric};
use super::lambert::cosine_around;
use super::metal::{BASE_BOUNCES, MetalPosition, MetalTable, inside, widened};
use super::microfacet::Ggx;
use crate::math::{LocalDir, Rgb};

/// Reflection by the coat's outer interface: a delta lobe if it is smooth.
struct CoatLobe;

impl CoatLobe {
    /// f·cosθᵢ and density; zero for a smooth coat.
    #[inline]
    fn eval_pdf(coat: &Coat, wo: Vec3, wi: Vec3) -> (f32, f32) {
        if coat.ggx.is_smooth() {
            return (0.0, 0.0);
        }
        let Some(lobe) = Reflection::new(&coat.ggx, wo, wi) else { return (0.0, 0.0) };
        (lobe.value * dielectric(lobe.cos_d, coat.table.eta()).reflectance, lobe.pdf)
    }

    /// The delta lobe of a smooth coat, chosen with `probability`.
    #[inline]
    fn mirror(coat: &Coat, wo: LocalDir, probability: f32) -> BsdfSample {
        let reflectance = dielectric(wo.abs_cos_theta(), coat.table.eta()).reflectance;
        BsdfSample::mirror(wo.flipped().reversed(), Rgb::splat(reflectance / probability), probability)
    }
}

/// Lambertian under a dielectric coat, the same from both sides.
///
/// The base sends back f = T(ωₒ) T(ωᵢ) ρ/(πη²) · Σₖ (ρ r)ᵏ, where T is what the coat lets through to the base and r what it
/// returns of the base's Lambertian light: each bounce forgets where the light came from, so the sum is exact. It ends
/// where pbrt-v4's walk does.
#[derive(Clone, Copy, Debug)]
pub struct CoatedDiffuse<'w> {
    coat: Coat<'w>,
    albedo: Rgb,
    /// ρ/η² Σ(ρr)ᵏ.
    base: Rgb,
    /// Largest channel of the base's albedo seen through the coat, but for T(ωₒ).
    base_energy: f32,
}

impl<'w> CoatedDiffuse<'w> {
    /// A base of `albedo` in [0, 1] under `coat`.
    #[inline]
    pub fn new(albedo: Rgb, coat: Coat<'w>) -> Self {
        let x = albedo * coat.internal();
        let series = (1..BASE_BOUNCES).fold(Rgb::ONE, |sum, _| Rgb::ONE + x * sum);
        let eta = coat.table.eta();
        Self::with_response(albedo, albedo * series / (eta * eta), coat)
    }

    /// As [`Self::new`], where the bounces between base and coat were summed by wavelength: `response` is the RGB of
    /// [`Self::response`] over the spectrum of `albedo`.
    #[inline]
    pub fn with_response(albedo: Rgb, response: Rgb, coat: Coat<'w>) -> Self {
        Self { base_energy: response.max_element() * coat.mean_transmitted(), coat, albedo, base: response }
    }

    /// ρ/η² Σ(ρr)ᵏ, what the base sends back through `coat` of the light that reaches it, for an albedo ρ at one wavelength.
    pub fn response(coat: &Coat<'_>, albedo: f64) -> f64 {
        let x = albedo * f64::from(coat.internal());
        let eta = f64::from(coat.table.eta());
        albedo * (1..BASE_BOUNCES).fold(1.0, |sum, _| 1.0 + x * sum) / (eta * eta)
    }

    pub(super) fn regularized(self) -> Self {
        let coat = self.coat.regularized();
        if coat.ggx == self.coat.ggx {
            return self;
        }
        // Through another width the base sends back as much more or less as it would by RGB: what summing by wavelength
        // makes of that hardly depends on the width.
        let (old, new) = (Self::new(self.albedo, self.coat).base, Self::new(self.albedo, coat).base);
        let more = Rgb::select(old.cmpgt(Rgb::ZERO), new / old, Rgb::ONE);
        Self::with_response(self.albedo, self.base * more, coat)
    }

    /// Probability of choosing the coat's reflection: by energy.
    #[inline]
    fn coat_probability(&self, coat: f32, transmitted: f32) -> f32 {
        let base = transmitted * self.base_energy;
        if coat + base > 0.0 { coat / (coat + base) } else { 0.0 }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: LocalDir, wi: LocalDir) -> (Rgb, f32) {
        if !wo.same_hemisphere(wi) {
            return (Rgb::ZERO, 0.0);
        }
        let (coat, transmitted) = self.coat.reflected_and_transmitted(wo.abs_cos_theta());
        self.mixture(wo, wi, transmitted, self.coat_probability(coat, transmitted))
    }

    #[inline]
    fn mixture(&self, wo: LocalDir, wi: LocalDir, transmitted: f32, coat_probability: f32) -> (Rgb, f32) {
        let (wo, wi) = (upward(wo), upward(wi));
        let (coat, coat_pdf) = CoatLobe::eval_pdf(&self.coat, wo, wi);
        let cosine = wi.z * FRAC_1_PI;
        let value = self.base * (transmitted * self.coat.transmitted(wi.z) * cosine) + coat;
        (value, coat_probability * coat_pdf + (1.0 - coat_probability) * cosine)
    }

    #[inline]
    pub(super) fn sample(&self, wo: LocalDir, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 {
            return None;
        }
        let (coat, transmitted) = self.coat.reflected_and_transmitted(wo.abs_cos_theta());
        let probability = self.coat_probability(coat, transmitted);
        let wi = if u_lobe < probability {
            if self.coat.ggx.is_smooth() {
                return Some(CoatLobe::mirror(&self.coat, wo, probability));
            }
            on_side_of(wo, Reflection::sample(&self.coat.ggx, upward(wo), u)?.wi)
        } else {
            cosine_around(wo.cos_theta(), u)?
        };
        let (value, pdf) = self.mixture(wo, wi, transmitted, probability);
        (pdf > 0.0).then(|| BsdfSample::reflection(wi, value / pdf, pdf))
    }

    /// The base through the coat on the way out.
    #[inline]
    pub(super) fn diffuse_albedo(&self, wo: LocalDir) -> Rgb {
        self.base * self.coat.reflected_and_transmitted(wo.abs_cos_theta()).1
    }

    /// The coat's transmittance on the way in, times |cosθᵢ|/π.
    #[inline]
    pub(super) fn diffuse(&self, wi: LocalDir) -> f32 {
        self.coat.transmitted(wi.abs_cos_theta()) * wi.abs_cos_theta() * FRAC_1_PI
    }

    pub(super) fn albedo(&self, wo: LocalDir) -> Rgb {
        let (coat, transmitted) = self.coat.reflected_and_transmitted(wo.abs_cos_theta());
        self.base * (transmitted * self.coat.mean_transmitted()) + coat
    }
}

/// Metal under a dielectric coat, the same from both sides.
///
/// Three lobes: the coat's reflection; the metal seen through the refracting coat,
/// T(ωₒ) T(ωᵢ)/η² times the metal's BSDF between the refracted directions, its width increased by a rough coat's; and a
/// diffuse lobe for light that was totally reflected inside. With both surfaces smooth, one mirror.
#[derive(Clone, Copy, Debug)]
pub struct CoatedConductor<'w> {
    coat: Coat<'w>,
    base: Ggx,
    /// `base` as seen through the coat.
    lobe: Ggx,
    fresnel: ConductorFresnel<'w>,
    table: &'w MetalTable,
    position: MetalPosition,
    /// The single bounce and its echo, relative to the single bounce.
    echoed: Rgb,
    /// What the metal leaves of the diffused energy, over the mean of that.
    diffused: Rgb,
    /// Reflectance of the metal for choosing lobes.
    reflectance: f32,
}

/// Densities and energies of the choice between lobes, which depend on `wo` alone.
struct Choice {
    coat: f32,
    single: f32,
    diffused: f32,
    /// Table values that the evaluation needs again.
    transmitted: f32,
    gain: f32,
    diffused_energy: f32,
}

impl<'w> CoatedConductor<'w> {
    /// Cosine at which the metal's reflectance stands for its mean: ∫ 2μ·μ dμ = 2/3.
    const MEAN_COSINE: f32 = 2.0 / 3.0;

    /// A metal with surface `base` under `coat`. `fresnel` is relative to the coat; `table` was made for this coat.
    #[inline]
    pub fn new(base: Ggx, fresnel: ConductorFresnel<'w>, coat: Coat<'w>, table: &'w MetalTable) -> Self {
        let position = table.locate(coat.ggx.mean_alpha(), base.mean_alpha());
        let mean = fresnel.at(Self::MEAN_COSINE);
        let diffused_mean = table.diffused_mean(position);
        let scale = if diffused_mean > 0.0 { 1.0 / diffused_mean } else { 0.0 };
        Self {
            lobe: widened(base, &coat.ggx, coat.table.eta()),
            echoed: Rgb::ONE + table.echo(position, mean),
            diffused: table.diffused_by_metal(position, mean) * scale,
            reflectance: mean.max_element(),
            coat,
            base,
            fresnel,
            table,
            position,
        }
    }

    pub(super) fn regularized(self) -> Self {
        Self::new(self.base.regularized(), self.fresnel, self.coat.regularized(), self.table)
    }

    #[inline]
    pub(super) fn is_specular(&self) -> bool {
        self.lobe.is_smooth()
    }

    /// Reflectance of two smooth surfaces, the bounces between them summed.
    #[inline]
    fn mirror_reflectance(&self, cos_o: f32) -> Rgb {
        let interface = dielectric(cos_o, self.coat.table.eta());
        let (r, t) = (interface.reflectance, 1.0 - interface.reflectance);
        if t == 0.0 {
            return Rgb::ONE;
        }
        let crossing = attenuation(self.coat.table.thickness(), interface.cos_t);
        let there_and_back = self.fresnel.at(interface.cos_t) * (crossing * crossing);
        let x = there_and_back * r;
        let series = (1..BASE_BOUNCES).fold(Rgb::ONE, |sum, _| Rgb::ONE + x * sum);
        r + t * t * there_and_back * series
    }

    #[inline]
    fn choice(&self, cos_o: f32) -> Choice {
        let (coat, transmitted) = self.coat.reflected_and_transmitted(cos_o);
        let diffused_energy = self.table.diffused(self.position, cos_o);
        let single = self.reflectance * self.echoed.max_element() * self.table.single(self.position, cos_o);
        let diffused = diffused_energy * self.diffused.max_element() * self.table.diffused_mean(self.position);
        let sum = coat + single + diffused;
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        Choice {
            coat: coat * scale,
            single: single * scale,
            diffused: diffused * scale,
            transmitted,
            gain: self.table.gain(self.position, cos_o),
            diffused_energy,
        }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: LocalDir, wi: LocalDir) -> (Rgb, f32) {
        if self.is_specular() || !wo.same_hemisphere(wi) {
            return (Rgb::ZERO, 0.0);
        }
        self.mixture(wo, wi, &self.choice(wo.abs_cos_theta()))
    }

    #[inline]
    fn mixture(&self, wo: LocalDir, wi: LocalDir, choice: &Choice) -> (Rgb, f32) {
        let (wo, wi) = (upward(wo), upward(wi));
        let (coat, coat_pdf) = CoatLobe::eval_pdf(&self.coat, wo, wi);
        let (single, single_pdf) = self.single_bounce(wo, wi, choice);
        let cosine = wi.z * FRAC_1_PI;
        let diffused = self.diffused * (choice.diffused_energy * self.table.diffused(self.position, wi.z) * cosine);
        let pdf = choice.coat * coat_pdf + choice.single * single_pdf + choice.diffused * cosine;
        (single + diffused + coat, pdf)
    }

    /// f·cosθᵢ and density of the metal seen through the coat.
    #[inline]
    fn single_bounce(&self, wo: Vec3, wi: Vec3, choice: &Choice) -> (Rgb, f32) {
        let eta = self.coat.table.eta();
        let (Some(o), Some(i)) = (inside(wo, eta), inside(wi, eta)) else { return (Rgb::ZERO, 0.0) };
        let Some(lobe) = Reflection::new(&self.lobe, o, i) else { return (Rgb::ZERO, 0.0) };
        // Solid angle inside over outside: cosθ/(η² cosθ′).
        let solid_angle = wi.z / (eta * eta * i.z);
        let gain = choice.gain * self.table.gain(self.position, wi.z);
        let through = choice.transmitted * self.coat.transmitted(wi.z) * gain;
        (self.fresnel.at(lobe.cos_d) * self.echoed * (through * lobe.value * solid_angle), lobe.pdf * solid_angle)
    }

    #[inline]
    pub(super) fn sample(&self, wo: LocalDir, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 {
            return None;
        }
        if self.is_specular() {
            let weight = self.mirror_reflectance(wo.abs_cos_theta());
            return Some(BsdfSample::mirror(wo.flipped().reversed(), weight, 1.0));
        }
        let choice = self.choice(wo.abs_cos_theta());
        let wi = if u_lobe < choice.coat {
            if self.coat.ggx.is_smooth() {
                return Some(CoatLobe::mirror(&self.coat, wo, choice.coat));
            }
            on_side_of(wo, Reflection::sample(&self.coat.ggx, upward(wo), u)?.wi)
        } else if u_lobe < choice.coat + choice.single {
            let eta = self.coat.table.eta();
            let lobe = Reflection::sample(&self.lobe, inside(upward(wo), eta)?, u)?;
            // Total reflection sends the light into the diffuse lobe: here it ends.
            on_side_of(wo, inside(lobe.wi, 1.0 / eta)?)
        } else {
            cosine_around(wo.cos_theta(), u)?
        };
        let (value, pdf) = self.mixture(wo, wi, &choice);
        (pdf > 0.0).then(|| BsdfSample::reflection(wi, value / pdf, pdf))
    }

    pub(super) fn albedo(&self, wo: LocalDir) -> Rgb {
        let mu = wo.abs_cos_theta();
        if self.is_specular() {
            return self.mirror_reflectance(mu);
        }
        let single = self.echoed * self.table.single(self.position, mu);
        let diffused =
            self.diffused * (self.table.diffused(self.position, mu) * self.table.diffused_mean(self.position));
        self.fresnel.at(mu) * single + diffused + self.coat.reflected_and_transmitted(mu).0
    }
}
