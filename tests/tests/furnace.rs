//! Scenes whose radiance is known everywhere, because the same comes from everywhere.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use tests::render::{altered, mean_and_error};

/// 4.4 standard errors: a correct renderer fails one such check in 10⁵, and the seed is fixed, so none that passes once.
const Z: f64 = 4.4;

/// What f32 may do to a path of many factors: far below anything visible, far above its rounding.
const ROUNDING: f64 = 1e-4;

#[test]
fn a_closed_box_shows_the_geometric_series() {
    for albedo in [0.0, 0.5, 0.8, 0.95] {
        let reflectance = format!("[ {albedo} {albedo} {albedo} ]");
        let frame = altered("furnace/closed-box.pbrt", &[("[ 0.5 0.5 0.5 ]", &reflectance)], 64);
        let (mean, error) = mean_and_error(&frame.film);
        let expected = 1.0 / (1.0 - albedo);
        println!("albedo {albedo}: mean {mean:.5} ± {error:.5}, expected {expected}");
        assert!((mean - expected).abs() <= Z * error + ROUNDING * expected, "{mean} ± {error} is not {expected}");
        assert_eq!(frame.statistics.counters.rejected_samples, 0);
    }
}

#[test]
fn a_white_diffuse_sphere_cannot_be_told_from_a_white_environment() {
    let frame = altered("furnace/sphere.pbrt", &[], 64);
    let (mean, error) = mean_and_error(&frame.film);
    assert!((mean - 1.0).abs() <= Z * error + ROUNDING, "{mean} ± {error}");
}

#[test]
fn no_material_shows_more_than_it_receives() {
    let materials = [
        r#"Material "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k" "float roughness" 0.3"#,
        r#"Material "conductor" "rgb reflectance" [ 0.9999 0.9999 0.9999 ] "float roughness" 0"#,
        r#"Material "dielectric" "float eta" 1.5"#,
        r#"Material "dielectric" "float eta" 1.5 "float roughness" 0.4"#,
        r#"Material "thindielectric" "float eta" 1.5"#,
        r#"Material "coateddiffuse" "rgb reflectance" [ 1 1 1 ] "float roughness" 0"#,
        r#"Material "coateddiffuse" "rgb reflectance" [ 1 1 1 ] "float roughness" 0.3"#,
        r#"Material "coatedconductor" "rgb reflectance" [ 0.99 0.99 0.99 ]"#,
        r#"Material "diffusetransmission" "rgb reflectance" [ 0.5 0.5 0.5 ] "rgb transmittance" [ 0.5 0.5 0.5 ]"#,
    ];
    for material in materials {
        let frame =
            altered("furnace/sphere.pbrt", &[(r#"Material "diffuse" "rgb reflectance" [ 1 1 1 ]"#, material)], 64);
        let (mean, error) = mean_and_error(&frame.film);
        println!("{mean:.5} ± {error:.5}  {material}");
        assert!(mean <= 1.0 + Z * error + ROUNDING, "{mean} ± {error}: {material}");
        assert_eq!(frame.statistics.counters.rejected_samples, 0, "{material}");
        // What absorbs nothing and loses nothing between its microfacets shows all that it receives.
        let lossless = material.contains("dielectric") && !material.contains("roughness");
        if lossless || material.contains("diffusetransmission") {
            assert!((mean - 1.0).abs() <= Z * error + ROUNDING, "{mean} ± {error}: {material}");
        }
    }
}
