//! Roughness at both ends, anisotropy, and the furnace for every material.

use renderer::filtering::Filtering;
use tests::render::mean_and_error;
use tests::small::values;

use super::support::{Z, both, difference, frame, job, lamp, picture, pinhole, quad, scene, sky};

/// Every material that has a roughness, and its name. None adds energy.
fn materials(roughness: &str) -> [(&'static str, String); 6] {
    [
        ("white conductor", format!("Material \"conductor\" \"rgb reflectance\" [ 1 1 1 ] {roughness}\n")),
        (
            "gold",
            format!(
                "Material \"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\" {roughness}\n"
            ),
        ),
        ("glass of 1.5", format!("Material \"dielectric\" \"float eta\" 1.5 {roughness}\n")),
        ("glass of 1.0001", format!("Material \"dielectric\" \"float eta\" 1.0001 {roughness}\n")),
        ("coated white", format!("Material \"coateddiffuse\" \"rgb reflectance\" [ 1 1 1 ] {roughness}\n")),
        (
            "coated metal",
            format!(
                "Material \"coatedconductor\" \"rgb reflectance\" [ 1 1 1 ] {} {}\n",
                roughness.replace("float ", "float interface."),
                roughness.replace("float ", "float conductor.")
            ),
        ),
    ]
}

/// A sphere, which shows all angles, in an environment of radiance 1. `least`: what at most is lost between microfacets.
fn furnace(name: &str, roughness: &str, least: f64) {
    for (material, text) in materials(roughness) {
        let camera = format!("LookAt 0 0 -4  0 0 0  0 1 0\n{}", pinhole(28.0));
        let world = sky(1.0) + &text + "Shape \"sphere\" \"float radius\" 1\n";
        for (mode, filtering) in both() {
            let rendered = frame(&scene([20, 20], 1000, &camera, &world), job(32, filtering));
            let (mean, error) = mean_and_error(&rendered.film);
            let shown = values(&rendered).mean()[1];
            println!("{material}, {name}, {mode}: {shown:.5} (unfiltered {mean:.5} ± {error:.5})");
            assert!(shown <= 1.0 + Z * error + 1e-4, "{material} shows more than it receives");
            // Metals absorb, and layers end the walk of light between them after some bounces, as in pbrt.
            let lossless = !["gold", "coated white", "coated metal"].contains(&material);
            assert!(!lossless || shown >= least - Z * error, "{material} loses light");
        }
    }
}

fn isotropic(alpha: f64, least: f64) {
    let name = format!("alpha {alpha}");
    furnace(&name, &format!("\"float roughness\" {alpha} \"bool remaproughness\" false"), least);
}

#[test]
fn furnace_at_roughness_0() {
    isotropic(0.0, 1.0 - 2e-4);
}

#[test]
fn furnace_at_roughness_1e_minus_4() {
    isotropic(1e-4, 1.0 - 1e-3);
}

#[test]
fn furnace_at_roughness_1e_minus_3() {
    isotropic(1e-3, 1.0 - 1e-3);
}

#[test]
fn furnace_at_roughness_1() {
    // What single scattering between microfacets loses.
    isotropic(1.0, 0.4);
}

#[test]
fn furnace_at_anisotropy_of_1e4_to_1() {
    furnace("anisotropy 10⁴:1", "\"float uroughness\" 1 \"float vroughness\" 1e-4 \"bool remaproughness\" false", 0.5);
}

#[test]
fn furnace_at_anisotropy_of_1_to_1e4() {
    furnace("anisotropy 1:10⁴", "\"float uroughness\" 1e-4 \"float vroughness\" 1 \"bool remaproughness\" false", 0.5);
}

/// A lamp in a mirror: of `alpha`, at grazing angles and straight.
fn mirrored(alpha: f64) -> String {
    let world = lamp(1.0)
        + &quad([[-2.0, 0.0, 4.0], [-2.0, 3.0, 4.0], [2.0, 3.0, 4.0], [2.0, 0.0, 4.0]])
        + &format!(
            "Material \"conductor\" \"rgb reflectance\" [ 0.8 0.8 0.8 ] \"float roughness\" {alpha:e} \"bool remaproughness\" false\n"
        )
        + &quad([[-9.0, -1.0, -9.0], [-9.0, -1.0, 9.0], [9.0, -1.0, 9.0], [9.0, -1.0, -9.0]]);
    scene([32, 32], 3, &pinhole(70.0), &world)
}

#[test]
fn a_mirror_of_roughness_1e_minus_4_is_a_mirror() {
    for (mode, filtering) in both() {
        let (smooth, rough) = (picture(&mirrored(0.0), 64, filtering), picture(&mirrored(1e-4), 64, filtering));
        let ratio = rough.mean()[1] / smooth.mean()[1];
        println!("{mode}: mean {ratio:.5} of that of a mirror, pixels differ by {:.3}", difference(&rough, &smooth));
        assert!((ratio - 1.0).abs() <= 2e-3);
    }
}

#[test]
fn roughness_beyond_its_range_is_finite() {
    for alpha in [1e-30, 1e-8, 1e2, 1e30] {
        let image = picture(&mirrored(alpha), 16, Filtering::None);
        println!("alpha {alpha:e}: mean {:.5}", image.mean()[1]);
        assert!(image.mean()[1] > 0.0);
    }
}
