//! Every model against its contract.

mod chi_square;
mod energy;
mod layered;
mod layered_values;
mod limits;

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::fresnel::ConductorFresnel;
use super::microfacet::Ggx;
use super::*;
use crate::spectrum::{ConductorTable, Spectrum};

/// A small counter-based generator: the tests' numbers must not change when the renderer's sampler does.
///
/// **Source**: \[Steele14\] SplitMix64.
pub(super) struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn pair(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }
}

/// Direction at polar cosine `z` and azimuth `phi`.
pub(super) fn direction(z: f32, phi: f32) -> LocalDir {
    let r = (1.0 - z * z).max(0.0).sqrt();
    LocalDir::new(Vec3::new(r * phi.cos(), r * phi.sin(), z))
}

/// Aluminium at about 550 nm in all channels but with different losses.
pub(super) const METAL: ConductorFresnel<'static> =
    ConductorFresnel::Index { eta: Rgb::new(1.2, 0.96, 0.7), k: Rgb::new(7.3, 6.7, 5.5) };

/// A metal that reflects everything.
pub(super) static PERFECT: LazyLock<ConductorTable> =
    LazyLock::new(|| ConductorTable::new(&Spectrum::constant(1.0), &Spectrum::Rgb(Rgb::splat(1e9)), 1.0));

/// The coats of the tests, made once: index 1.5, pbrt-v4's default thickness.
pub(super) struct Coats(Vec<CoatOf>);

/// A coat of width `alpha`, and metals under it by their widths.
struct CoatOf {
    alpha: f32,
    coat: CoatTable,
    metals: Vec<(f32, MetalTable)>,
}

pub(super) static COATS: LazyLock<Coats> = LazyLock::new(|| {
    let coats = [0.0, 0.1, 0.316_227_8, 0.547_722_6, 0.774_596_7].map(|alpha| {
        let coat = CoatTable::new(1.5, 0.01, Some(alpha));
        let metals = [0.0, 0.05, 0.223_606_8, 0.5].map(|base| (base, MetalTable::new(&coat, Some(base))));
        CoatOf { alpha, metals: metals.into(), coat }
    });
    Coats(coats.into())
});

impl Coats {
    pub fn alphas(&self) -> impl Iterator<Item = f32> {
        self.0.iter().map(|entry| entry.alpha)
    }

    fn entry(&self, alpha: f32) -> &CoatOf {
        self.0.iter().find(|entry| entry.alpha == alpha).expect("a width that the tests have made a coat of")
    }

    pub fn diffuse(&'static self, alpha: f32, albedo: Rgb) -> Bsdf<'static> {
        let coat = Coat::new(Ggx::isotropic(alpha), &self.entry(alpha).coat);
        Bsdf::CoatedDiffuse(CoatedDiffuse::new(albedo, coat))
    }

    pub fn metal(&'static self, alpha: f32, base: f32, fresnel: ConductorFresnel<'static>) -> Bsdf<'static> {
        let CoatOf { coat, metals, .. } = self.entry(alpha);
        let table = &metals.iter().find(|metal| metal.0 == base).expect("a width that the tests have a metal of").1;
        let coat = Coat::new(Ggx::isotropic(alpha), coat);
        Bsdf::CoatedConductor(CoatedConductor::new(Ggx::isotropic(base), fresnel, coat, table))
    }
}

pub(super) fn glass(eta: f32, alpha: Vec2) -> Bsdf<'static> {
    Bsdf::Dielectric(Dielectric { eta, ggx: Ggx::new(alpha) })
}

pub(super) fn metal(alpha: Vec2, fresnel: ConductorFresnel<'static>) -> Bsdf<'static> {
    Bsdf::Conductor(Conductor { ggx: Ggx::new(alpha), fresnel })
}

/// One of every model, rough enough for quadrature where it has non-delta lobes.
pub(super) fn rough_models() -> Vec<(String, Bsdf<'static>)> {
    let mut models = vec![
        ("diffuse".to_owned(), Bsdf::Diffuse(Diffuse { albedo: Rgb::new(0.8, 0.5, 0.1) })),
        (
            "diffuse transmission".to_owned(),
            Bsdf::DiffuseTransmission(DiffuseTransmission {
                reflectance: Rgb::new(0.5, 0.2, 0.1),
                transmittance: Rgb::new(0.1, 0.3, 0.4),
            }),
        ),
    ];
    for alpha in [Vec2::splat(0.2), Vec2::new(0.2, 0.5), Vec2::splat(0.5), Vec2::splat(1.0)] {
        models.push((format!("conductor {alpha}"), metal(alpha, METAL)));
        models.push((format!("dielectric 1.5 {alpha}"), glass(1.5, alpha)));
    }
    models.push(("dielectric 1.2".to_owned(), glass(1.2, Vec2::splat(0.3))));
    models.push(("dielectric 0.8".to_owned(), glass(0.8, Vec2::splat(0.3))));
    for alpha in COATS.alphas().filter(|&alpha| alpha != 0.1) {
        models.push((format!("coated diffuse {alpha}"), COATS.diffuse(alpha, Rgb::new(0.8, 0.5, 0.05))));
        for base in [0.223_606_8, 0.5] {
            models.push((format!("coated conductor {alpha} {base}"), COATS.metal(alpha, base, METAL)));
        }
    }
    models
}

/// ∫ over all `wi` of `f(wi)` by midpoints, `res` × `res` on either hemisphere, uniform in the polar angle.
pub(super) fn integrate(res: u32, mut f: impl FnMut(LocalDir) -> Rgb) -> Rgb {
    use std::f64::consts::{PI, TAU};
    let mut sum = glam::DVec3::ZERO;
    for i in 0..2 * res {
        let theta = (f64::from(i) + 0.5) * PI / f64::from(2 * res);
        let mut ring = glam::DVec3::ZERO;
        for j in 0..res {
            let phi = (f64::from(j) + 0.5) * TAU / f64::from(res);
            ring += f(direction(theta.cos() as f32, phi as f32)).as_dvec3();
        }
        sum += ring * theta.sin();
    }
    (sum * PI / f64::from(2 * res) * TAU / f64::from(res)).as_vec3()
}

#[test]
fn a_value_is_small() {
    assert!(size_of::<Bsdf>() <= 128, "{}", size_of::<Bsdf>());
}

#[test]
fn tables_and_indices_agree() {
    let ConductorFresnel::Index { eta, k } = METAL else { unreachable!() };
    let table = ConductorTable::new(&Spectrum::Rgb(eta), &Spectrum::Rgb(k), 1.0);
    let (wo, wi) = (direction(0.4, 0.3), direction(0.6, 3.0));
    let a = Bsdf::Conductor(Conductor { ggx: Ggx::isotropic(0.3), fresnel: ConductorFresnel::Table(&table) });
    let b = metal(Vec2::splat(0.3), METAL);
    assert!((a.eval(wo, wi) / b.eval(wo, wi) - 1.0).abs().max_element() < 0.003);
}
