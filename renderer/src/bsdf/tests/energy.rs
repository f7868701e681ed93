//! Albedos, reciprocity, furnaces.

use super::*;

/// Mean weight of samples, deltas included, with its standard error.
pub(super) fn mean_weight(bsdf: &Bsdf, wo: LocalDir, n: u32, specular: bool) -> (Rgb, f32) {
    let mut random = Random::new(u64::from(wo.cos_theta().to_bits()));
    let (mut sum, mut square) = (Rgb::ZERO, 0.0);
    for _ in 0..n {
        let Some(s) = bsdf.sample(wo, random.next(), random.pair()) else { continue };
        if s.specular && !specular {
            continue;
        }
        sum += s.weight;
        square += s.weight.max_element() * s.weight.max_element();
    }
    let mean = sum / n as f32;
    let variance = (square / n as f32 - mean.max_element() * mean.max_element()).max(0.0);
    (mean, (variance / n as f32).sqrt())
}

const DIRECTIONS: [(f32, f32); 5] = [(0.99, 0.0), (0.6, 1.0), (0.2, 2.0), (-0.8, 0.4), (-0.3, -2.0)];

#[test]
fn sample_weights_average_to_the_albedo() {
    for (name, bsdf) in rough_models() {
        for (z, phi) in DIRECTIONS {
            let wo = direction(z, phi);
            let albedo = integrate(128, |wi| bsdf.eval(wo, wi));
            let (mean, error) = mean_weight(&bsdf, wo, 20_000, false);
            // 4.5 standard errors: 150 tests at 0.1 % together; and the error of the quadrature.
            let bound = 4.5 * error + 0.004;
            assert!((mean - albedo).abs().max_element() < bound, "{name} from {z}: {mean} {albedo} ± {bound}");
        }
    }
}

#[test]
fn eval_is_eval_pdf_and_nothing_creates_energy() {
    for (name, bsdf) in rough_models() {
        for (z, phi) in DIRECTIONS {
            let wo = direction(z, phi);
            // Radiance, times η² where it was transmitted, is energy.
            let energy = integrate(128, |wi| {
                let (value, pdf) = bsdf.eval_pdf(wo, wi);
                assert_eq!(value, bsdf.eval(wo, wi));
                assert_eq!(pdf, bsdf.pdf(wo, wi));
                let scale = match &bsdf {
                    Bsdf::Dielectric(b) if !wo.same_hemisphere(wi) => {
                        if wo.cos_theta() > 0.0 {
                            b.eta * b.eta
                        } else {
                            1.0 / (b.eta * b.eta)
                        }
                    }
                    _ => 1.0,
                };
                value * scale
            });
            assert!(energy.max_element() < 1.005, "{name} from {z}: {energy}");
        }
    }
}

#[test]
fn values_are_reciprocal() {
    let mut random = Random::new(7);
    for (name, bsdf) in rough_models() {
        for _ in 0..500 {
            let a = direction(2.0 * random.next() - 1.0, std::f32::consts::TAU * random.next());
            let b = direction(2.0 * random.next() - 1.0, std::f32::consts::TAU * random.next());
            let (ab, ba) = (bsdf.eval(a, b) / b.abs_cos_theta(), bsdf.eval(b, a) / a.abs_cos_theta());
            // Radiance: η²f is what is symmetric when the interface is crossed.
            let eta2 = match &bsdf {
                Bsdf::Dielectric(glass) if !a.same_hemisphere(b) => glass.eta * glass.eta,
                _ => 1.0,
            };
            let (ab, ba) = if a.cos_theta() > 0.0 { (ab * eta2, ba) } else { (ab, ba * eta2) };
            // Rounding of the half vector, which a narrow lobe amplifies.
            let bound = 2e-3 * ab.max(ba).max_element() + 1e-6;
            assert!((ab - ba).abs().max_element() <= bound, "{name} {a:?} {b:?}: {ab} {ba}");
        }
    }
}

#[test]
fn smooth_lobes_conserve_energy_exactly() {
    for z in [1.0, 0.7, 0.2, 0.01, -0.9, -0.5] {
        let wo = direction(z, 0.3);
        let cases = [
            ("glass", glass(1.5, Vec2::ZERO)),
            ("pane", Bsdf::ThinDielectric(ThinDielectric { eta: 1.5 })),
            ("mirror", metal(Vec2::ZERO, ConductorFresnel::Table(&PERFECT))),
        ];
        for (name, bsdf) in cases {
            assert!(bsdf.is_specular());
            let mut total = 0.0;
            for u in [0.0, 0.999_999] {
                let s = bsdf.sample(wo, u, Vec2::splat(0.5)).expect("a smooth surface always leads on");
                assert!(s.specular && s.transmission != wo.same_hemisphere(s.wi), "{name}");
                // Both draws give the same lobe where only one exists.
                let scale = if s.transmission { s.eta * s.eta } else { 1.0 };
                total += if s.pdf == 1.0 { 0.5 } else { s.pdf } * s.weight.x * scale;
            }
            assert!((total - 1.0).abs() < 1e-5, "{name} from {z}: {total}");
        }
    }
}

#[test]
fn a_perfect_metal_loses_only_what_single_scattering_loses() {
    // Energy after one bounce on GGX is E[G₂/G₁] over visible normals: it falls with roughness, from 1.
    let albedo = |alpha: f32, z: f32| {
        let bsdf = metal(Vec2::splat(alpha), ConductorFresnel::Table(&PERFECT));
        integrate(128, |wi| bsdf.eval(direction(z, 0.0), wi)).x
    };
    assert!((albedo(0.1, 0.9) - 1.0).abs() < 0.02);
    // At alpha = 1, D = 1/π and s = 1, so visible normals at normal incidence have cos²θₘ = c uniform, cosθᵢ = 2c − 1 and
    // G₂/G₁ = 2 cosθᵢ/(cosθᵢ + 1): the albedo is ∫_½¹ (2 − 1/c) dc = 1 − ln 2.
    assert!((albedo(1.0, 1.0) - (1.0 - 2.0_f32.ln())).abs() < 1e-3, "{}", albedo(1.0, 1.0));
    assert!(albedo(0.3, 0.5) > albedo(0.6, 0.5) && albedo(0.6, 0.5) > albedo(1.0, 0.5));
    let diffuse = Bsdf::Diffuse(Diffuse { albedo: Rgb::new(0.8, 0.3, 0.0) });
    let white = integrate(64, |wi| diffuse.eval(direction(0.3, 0.0), wi));
    assert!((white - Rgb::new(0.8, 0.3, 0.0)).abs().max_element() < 1e-3);
}

#[test]
fn the_albedo_channel_is_the_albedo_where_it_says_so() {
    for (name, bsdf) in rough_models() {
        let (Bsdf::CoatedDiffuse(_) | Bsdf::CoatedConductor(_)) = bsdf else { continue };
        for z in [0.95, 0.5, -0.3] {
            let wo = direction(z, 1.0);
            let (mean, error) = mean_weight(&bsdf, wo, 20_000, true);
            let difference = (mean - bsdf.albedo(wo)).abs().max_element();
            assert!(difference < 0.03 + 4.5 * error, "{name} {z}: {mean} {}", bsdf.albedo(wo));
        }
    }
}
