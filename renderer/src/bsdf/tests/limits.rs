//! Extreme parameters and arbitrary directions.

use proptest::prelude::*;

use super::*;

fn check(bsdf: &Bsdf, wo: LocalDir, wi: LocalDir, u_lobe: f32, u: Vec2) {
    let sane = |value: Rgb, pdf: f32| value.is_finite() && value.min_element() >= 0.0 && pdf.is_finite() && pdf >= 0.0;
    let (value, pdf) = bsdf.eval_pdf(wo, wi);
    assert!(sane(value, pdf), "{bsdf:?} {wo:?} {wi:?}: {value} {pdf}");
    if wo.cos_theta() == 0.0 {
        assert!(value == Rgb::ZERO && pdf == 0.0 && bsdf.sample(wo, u_lobe, u).is_none());
    }
    if let Some(s) = bsdf.sample(wo, u_lobe, u) {
        assert!(sane(s.weight, s.pdf) && s.pdf > 0.0, "{bsdf:?} {wo:?} {u_lobe} {u}: {s:?}");
        assert!((s.wi.vec().length() - 1.0).abs() < 1e-3);
        assert_eq!(s.transmission, wo.cos_theta() * s.wi.cos_theta() < 0.0, "{bsdf:?} {wo:?}: {s:?}");
        assert!(s.specular || !bsdf.is_specular());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn nothing_is_ever_nan_or_negative(
        zo in prop_oneof![-1.0f32..=1.0, -1e-6f32..1e-6, Just(1e-30), Just(0.0), Just(1.0), Just(-1.0)], phi_o in 0.0f32..6.3,
        zi in prop_oneof![-1.0f32..=1.0, -1e-6f32..1e-6, Just(1e-30), Just(0.0), Just(1.0), Just(-1.0)], phi_i in 0.0f32..6.3,
        alpha_x in prop_oneof![0.0f32..1.0, 0.0f32..2e-3, Just(1.0)],
        alpha_y in prop_oneof![0.0f32..1.0, 0.0f32..2e-3, Just(1.0)],
        eta in prop_oneof![0.2f32..3.0, Just(1.0), Just(1.0001), Just(1000.0), Just(0.001)],
        r in 0.0f32..1.0, u_lobe in 0.0f32..1.0, ux in 0.0f32..1.0,
        uy in prop_oneof![0.0f32..1.0, Just(0.0), Just(1.0 - f32::EPSILON / 2.0)],
    ) {
        let alpha = Vec2::new(alpha_x, alpha_y);
        let index = ConductorFresnel::Index { eta: Rgb::splat(eta), k: Rgb::new(0.0, r, 1.0 / (1.0001 - r)) };
        let coat = COATS.alphas().nth((r * 5.0) as usize).unwrap_or(0.0);
        let models = [
            Bsdf::Diffuse(Diffuse { albedo: Rgb::splat(r) }),
            Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: Rgb::ZERO, transmittance: Rgb::splat(r) }),
            Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: Rgb::ZERO, transmittance: Rgb::ZERO }),
            metal(alpha, index),
            glass(eta, alpha),
            Bsdf::ThinDielectric(ThinDielectric { eta }),
            COATS.diffuse(coat, Rgb::splat(r)),
            COATS.metal(coat, 0.0, index),
            COATS.metal(coat, 0.05, index),
        ];
        let (wo, wi) = (direction(zo, phi_o), direction(zi, phi_i));
        for bsdf in models {
            check(&bsdf, wo, wi, u_lobe, Vec2::new(ux, uy));
            check(&bsdf, wo, wo.flipped().reversed(), u_lobe, Vec2::new(ux, uy));
            check(&bsdf, wo, wo.reversed(), u_lobe, Vec2::new(ux, uy));
            check(&bsdf.regularized(), wo, wi, u_lobe, Vec2::new(ux, uy));
        }
    }
}

#[test]
fn a_coat_without_a_step_of_index_or_thickness_is_not_there() {
    let table = CoatTable::new(1.0, 1e-9, Some(0.3));
    let coat = Coat::new(Ggx::isotropic(0.3), &table);
    let albedo = Rgb::new(0.8, 0.4, 0.1);
    let coated = Bsdf::CoatedDiffuse(CoatedDiffuse::new(albedo, coat));
    let bare = Bsdf::Diffuse(Diffuse { albedo });
    let metals = MetalTable::new(&table, Some(0.4));
    let coated_metal = Bsdf::CoatedConductor(CoatedConductor::new(Ggx::isotropic(0.4), METAL, coat, &metals));
    for z in [0.9, 0.3, -0.5] {
        let (wo, wi) = (direction(z, 0.0), direction(0.7 * z, 2.0));
        assert!((coated.eval(wo, wi) - bare.eval(wo, wi)).abs().max_element() < 1e-4);
        let expected = metal(Vec2::splat(0.4), METAL).eval(wo, wi);
        assert!((coated_metal.eval(wo, wi) / expected - 1.0).abs().max_element() < 1e-3);
    }
}

#[test]
fn narrow_lobes_reach_the_delta_limit() {
    let narrow = Vec2::splat(1.01e-3);
    for z in [0.9, 0.4, -0.7] {
        let wo = direction(z, 0.0);
        for (rough, smooth) in
            [(glass(1.5, narrow), glass(1.5, Vec2::ZERO)), (metal(narrow, METAL), metal(Vec2::ZERO, METAL))]
        {
            for u in [0.0, 0.99] {
                let a = rough.sample(wo, u, Vec2::new(0.3, 0.5)).expect("leads on");
                let b = smooth.sample(wo, u, Vec2::new(0.3, 0.5)).expect("leads on");
                assert!((a.wi.vec() - b.wi.vec()).length() < 0.02, "{a:?} {b:?}");
                assert_eq!((a.transmission, a.eta), (b.transmission, b.eta));
                assert!((a.weight.x / b.weight.x - 1.0).abs() < 0.01, "{a:?} {b:?}");
            }
        }
    }
}

#[test]
fn an_index_of_one_lets_light_pass_straight() {
    let wo = direction(0.6, 1.0);
    let s = glass(1.0, Vec2::splat(0.5)).sample(wo, 0.3, Vec2::splat(0.2)).expect("passes");
    assert_eq!((s.wi, s.specular, s.transmission), (wo.reversed(), true, true));
    assert_eq!(s.weight, Rgb::ONE);
}
