//! Long paths: nothing is gained or lost over ten thousand bounces.

use renderer::filtering::Filtering;
use renderer::render::Job;
use renderer::world::Techniques;
use tests::small::{adaptive, values};

use super::support::{ROUNDING, check_all, check_mean, closed_box, diffuse, frame, job, pinhole, scene, sky};

/// A closed box that emits 1 and reflects `albedo`, with paths of `depth` scatterings.
fn glowing_box(albedo: f64, depth: u32) -> String {
    let emission = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n";
    scene([4, 4], depth, &pinhole(80.0), &(diffuse(albedo) + emission + &closed_box(1.0)))
}

#[test]
fn albedo_1_over_10_000_bounces_keeps_energy_to_1e_minus_4() {
    // Without light samples each bounce finds exactly 1: the sum is 1 + 10⁴, in f32 with a rounding per bounce.
    let job = Job { techniques: Techniques::Bsdfs, ..job(4, Filtering::None) };
    let image = values(&frame(&glowing_box(1.0, 10_000), job));
    check_all("10⁴ bounces", &image, 10_001.0, 1e-4);
}

#[test]
fn albedo_1_over_10_000_bounces_with_light_samples() {
    let rendered = frame(&glowing_box(1.0, 10_000), job(4, Filtering::None));
    check_mean("10⁴ bounces, both techniques", &rendered, 10_001.0, 1e-4);
}

#[test]
fn albedo_1_over_10_000_bounces_filtered() {
    let image = values(&frame(&glowing_box(1.0, 10_000), job(4, adaptive())));
    let plain = values(&frame(&glowing_box(1.0, 10_000), job(4, Filtering::None)));
    let ratio = image.mean()[1] / plain.mean()[1];
    println!("filtered: {ratio:.6} of the unfiltered energy");
    // What is stored in 16 bits, first vertex and second.
    assert!((ratio - 1.0).abs() <= 2.0 * 2f64.powi(-15));
}

#[test]
fn albedo_0_shows_emission_alone() {
    for filtering in [Filtering::None, adaptive()] {
        check_all("albedo 0", &values(&frame(&glowing_box(0.0, 10_000), job(4, filtering))), 1.0, 2f64.powi(-15));
    }
}

#[test]
fn albedo_0_999_converges_to_a_thousand() {
    // Roulette ends these paths after a thousand bounces or so: 1/(1 − a).
    check_mean("albedo 0.999", &frame(&glowing_box(0.999, 1_000_000), job(64, Filtering::None)), 1000.0, 1e-4);
}

#[test]
fn depth_0_shows_lights_alone() {
    check_all("depth 0", &values(&frame(&glowing_box(1.0, 0), job(4, Filtering::None))), 1.0, 0.0);
}

#[test]
fn the_largest_depth_ends() {
    check_mean("depth 2³¹ − 1", &frame(&glowing_box(0.5, i32::MAX as u32), job(64, Filtering::None)), 2.0, ROUNDING);
}

#[test]
fn thousands_of_total_reflections_keep_energy() {
    // Within a block of glass of 2 × 10⁴ × 10⁴ that is looked along: thousands of total reflections before the light comes
    // from the sky behind its far end, or after more of them from behind the near one. All of it arrives, times η².
    let glass = "Material \"dielectric\" \"float eta\" 1.5\nScale 1 1e4 1e4\n";
    let camera = format!("LookAt 0 0 0  0.5 0.2 0.8  0 1 0\n{}", pinhole(5.0));
    let text = scene([8, 8], 1_000_000, &camera, &(sky(1.0) + glass + &closed_box(1.0)));
    check_mean("total reflections", &frame(&text, job(16, Filtering::None)), 2.25, 1e-3);
}
